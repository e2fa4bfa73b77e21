"""Lines of Nastran bulk data, cut into cards and fields: 8 and 16 characters wide or with commas, continued.

Kept by hand because pyNastran, the library for it, pins NumPy below 2.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sloshlab.errors import FileFormatError

_LARGEST_FILE_BYTES: Final = 50 * 2**20
_LARGEST_DEPTH: Final = 8
_MOST_CARDS: Final = 1_000_000
_LARGEST_NUMBER: Final = 1e30
_WITHOUT_E: Final = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+))([+-]\d+)$")
_REAL: Final = re.compile(r"^[+-]?(?:\d+\.\d*|\.\d+)(?:[eEdD][+-]?\d+)?$|^[+-]?\d+[eEdD][+-]?\d+$")
_INTEGER: Final = re.compile(r"^[+-]?\d{1,18}$")


@dataclass(frozen=True)
class Card:
    """One card.

    Attributes
    ----------
    name : str
        In capitals, without the star of wide fields.
    fields : tuple of str
        After the name, without those that hold names of continuations; trailing blank fields are left out.
    file : str
    line : int
        Of its first line, from 1.
    """

    name: str
    fields: tuple[str, ...]
    file: str
    line: int

    @property
    def place(self) -> str:
        """File, line and name, for messages."""
        return f"{self.file}:{self.line}: {self.name}"

    def error(self, field: int, got: str, allowed: str) -> FileFormatError:
        """What to raise for a field that is damaged; fields count as in the manuals, the name is field 1."""
        return FileFormatError(f"{self.place}: field {field}", got=got[:80] or "nothing", allowed=allowed)

    def text(self, field: int, default: str | None = None) -> str:
        """Field as text."""
        index = field - 2
        value = self.fields[index] if index < len(self.fields) else ""
        if not value:
            if default is None:
                raise self.error(field, "", "a value")
            return default
        if " " in value:
            # blanks within a field, unlike those around it, are a value that has slipped out of its columns
            raise self.error(field, repr(value), "one value in its columns")
        return value

    def integer(self, field: int, default: int | None = None) -> int:
        """Field as an integer."""
        text = self.text(field, "" if default is not None else None)
        if not text:
            return default if default is not None else 0
        if not _INTEGER.match(text):
            raise self.error(field, text, "an integer")
        return int(text)

    def identifier(self, field: int, default: int | None = None) -> int:
        """Field as a positive integer."""
        value = self.integer(field, default)
        if value <= 0 and value != default:
            raise self.error(field, str(value), "an integer > 0")
        return value

    def real(self, field: int, default: float | None = None) -> float:
        """Field as a real number; the exponent may stand without e, and zero without a point."""
        text = self.text(field, "" if default is not None else None)
        if not text:
            return default if default is not None else 0.0
        value = real_number(text)
        if value is None:
            raise self.error(field, text, "a real number")
        return value

    def reals(self, first: int, number: int, default: float = 0.0) -> tuple[float, ...]:
        """Some fields as real numbers."""
        return tuple(self.real(field, default) for field in range(first, first + number))

    def listed(self, first: int) -> tuple[int, ...]:
        """The rest of the fields as integers, with THRU and BY; blank fields between are left out."""
        numbers: list[int] = []
        words = [(field, text) for field, text in enumerate(self.fields[first - 2 :], start=first) if text]
        at = 0
        while at < len(words):
            field, text = words[at]
            if text.upper() == "THRU":
                stop, step, used = self._range(words, at)
                if not numbers or stop < numbers[-1] or (stop - numbers[-1]) // step > _MOST_CARDS:
                    raise self.error(field, f"THRU {stop}", "a range upwards")
                numbers.extend(range(numbers[-1] + step, stop + 1, step))
                at += used
                continue
            numbers.append(self.identifier(field))
            at += 1
        return tuple(numbers)

    def _range(self, words: list[tuple[int, str]], at: int) -> tuple[int, int, int]:
        if at + 1 >= len(words):
            raise self.error(words[at][0], "THRU", "THRU and a number")
        stop, step, used = self.identifier(words[at + 1][0]), 1, 2
        if at + 3 < len(words) and words[at + 2][1].upper() == "BY":
            step, used = self.identifier(words[at + 3][0]), 4
        return stop, step, used


def real_number(text: str) -> float | None:
    """A real number of bulk data; None where it is none.

    Examples
    --------
    >>> [real_number(text) for text in ("-9.537-7", "1.+3", ".5d2", "0", "7.1x")]
    [-9.537e-07, 1000.0, 50.0, 0.0, None]
    """
    without_e = _WITHOUT_E.match(text)
    if without_e:
        value = float(f"{without_e[1]}e{without_e[2]}")
    elif _REAL.match(text) or _INTEGER.match(text):
        # a real number without a point is against the manual and in many decks
        value = float(text.lower().replace("d", "e"))
    else:
        return None
    # no deck has larger ones, and none of their powers may overflow
    return value if abs(value) <= _LARGEST_NUMBER else None


def put_once(table: dict[Any, Any], number: Any, value: object, card: Card) -> None:
    """Enter what a card says, which no other card of its family may have said.

    Raises
    ------
    FileFormatError
        If the number is there.
    """
    if number in table:
        raise FileFormatError(card.place, got=f"number {number} a second time", allowed="each number once")
    table[number] = value


def read_cards(*paths: Path, instead: Mapping[str, Path] | None = None) -> tuple[Card, ...]:
    """All cards of bulk data files, and of the files that they include, in their order.

    Parameters
    ----------
    *paths : Path
        A deck with BEGIN BULK, whose other sections are passed over, or files of bulk data alone.
    instead : mapping of str to Path, optional
        Files that stand for included ones, by the name in the INCLUDE line.

    Raises
    ------
    FileFormatError
        If a file is missing, too large or no text, or a continuation has nothing before it.
    """
    cards: list[Card] = []
    for path in paths:
        for card in _cards_of(_lines_of(path, instead or {}, ())):
            if len(cards) >= _MOST_CARDS:
                raise FileFormatError(f"{path}", got=f"more than {_MOST_CARDS} cards", allowed="fewer")
            cards.append(card)
    return tuple(cards)


@dataclass(frozen=True)
class _Line:
    text: str
    file: str
    number: int


def _text_of(path: Path, what: str) -> str:
    try:
        if path.stat().st_size > _LARGEST_FILE_BYTES:
            raise FileFormatError(what, got="a large file", allowed=f"≤ {_LARGEST_FILE_BYTES // 2**20} MiB")
        return path.read_bytes().decode("latin-1")  # comments have any bytes; cards are ASCII
    except OSError as error:
        raise FileFormatError(what, got=error.strerror or "no file", remedy="give the file") from error


def _beside(deck: Path, name: str) -> Path:
    """The included file; decks written where capitals count for nothing may name it in others."""
    target = deck.parent / name
    if not target.exists() and target.parent.is_dir():
        alike = [path for path in target.parent.iterdir() if path.name.lower() == target.name.lower()]
        if len(alike) == 1:
            return alike[0]
    return target


def _lines_of(path: Path, instead: Mapping[str, Path], within: tuple[Path, ...]) -> Iterator[_Line]:
    if path.resolve() in within or len(within) >= _LARGEST_DEPTH:
        raise FileFormatError(
            str(path), got="an INCLUDE that goes round or deeper than 8", remedy="correct INCLUDE"
        )
    # an INCLUDE may stand over several lines, as long names do; none of the supported decks needs that
    lines = [text.split("$")[0].rstrip() for text in _text_of(path, str(path)).splitlines()]
    begins = [n for n, text in enumerate(lines) if re.match(r"\s*BEGIN\s+BULK", text, re.IGNORECASE)]
    first = begins[-1] + 1 if begins else 0
    for number, text in enumerate(lines[first:], start=first + 1):
        if not text.strip():
            continue
        if re.match(r"\s*ENDDATA", text, re.IGNORECASE):
            return
        included = re.match(r"\s*INCLUDE\s+['\"]?([^'\"]+?)['\"]?\s*$", text, re.IGNORECASE)
        if included:
            name = included[1]
            target = instead.get(name, _beside(path, name))
            if not target.is_file():
                raise FileFormatError(
                    f"{path.name}:{number}: INCLUDE",
                    got=f"no file {name[:80]}",
                    remedy="put it beside the deck, or name what stands for it by `instead`",
                )
            yield from _lines_of(target, instead, (*within, path.resolve()))
            continue
        if any(ord(character) > 126 or ord(character) < 32 for character in text.replace("\t", "")):
            raise FileFormatError(f"{path.name}:{number}", got=repr(text)[:60], allowed="ASCII text")
        yield _Line(text, path.name, number)


def _cards_of(lines: Iterator[_Line]) -> Iterator[Card]:
    name, label_before, start = "", "", _Line("", "", 0)
    fields: list[str] = []
    for line in lines:
        first, cut, label = _fields_of(line)
        if _is_continuation(first):
            if not name:
                raise FileFormatError(f"{line.file}:{line.number}", got="a continuation without a card")
            if first.lstrip("+*") and label_before and first.lstrip("+*") != label_before:
                raise FileFormatError(
                    f"{line.file}:{line.number}: continuation {first[:8]}",
                    got=f"after a line that names {label_before[:8]}",
                    allowed="continuations right after their card",
                )
            fields.extend(cut)
        else:
            if name:
                yield Card(name, _without_tail(fields), start.file, start.number)
            name, fields, start = first.rstrip("*").strip().upper(), list(cut), line
        label_before = label.lstrip("+*").strip()
    if name:
        yield Card(name, _without_tail(fields), start.file, start.number)


def _is_continuation(first: str) -> bool:
    return not first or first[0] in "+*"


def _without_tail(fields: list[str]) -> tuple[str, ...]:
    end = len(fields)
    while end and not fields[end - 1]:
        end -= 1
    return tuple(fields[:end])


def _fields_of(line: _Line) -> tuple[str, list[str], str]:
    """Name or name of a continuation, fields, and the name of the next line's continuation."""
    if "," in line.text:
        # free format: eight fields to a line, wide or not
        parts = [part.strip() for part in line.text.replace("\t", " ").split(",")]
        if len(parts) > 10:
            raise FileFormatError(
                f"{line.file}:{line.number}", got=f"{len(parts)} fields", allowed="≤ 10 to a line"
            )
        n_fields = 4 if "*" in parts[0] else 8
        cut, label = parts[1 : 1 + n_fields], "".join(parts[1 + n_fields :])
        return parts[0], cut + [""] * (n_fields - len(cut)), label
    text = line.text.expandtabs(8)
    first = text[:8].strip()
    width, n_fields = (16, 4) if "*" in first else (8, 8)
    cut = [text[8 + width * n : 8 + width * (n + 1)].strip() for n in range(n_fields)]
    return first, cut, text[72:80].strip()
