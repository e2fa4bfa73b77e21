"""Lines of Nastran bulk data, cut into cards and fields: 8 and 16 characters wide or with commas, continued.

Kept by hand because pyNastran, the library for it, pins NumPy below 2.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sloshlab.aircraft.bulk_lines import Line, read_lines
from sloshlab.errors import FileFormatError

_MOST_CARDS: Final = 1_000_000
_MOST_FIELDS: Final = 1_000_000
_LONGEST_LIST: Final = 200_000
_LARGEST_IDENTIFIER: Final = 2**31 - 1
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
        if value != default and not 0 < value <= _LARGEST_IDENTIFIER:
            raise self.error(field, str(value), f"an integer > 0, ≤ {_LARGEST_IDENTIFIER}")
        return value

    def real(self, field: int, default: float | None = None) -> float:
        """Field as a real number; the exponent may stand without e, and zero without a point."""
        text = self.text(field, "" if default is not None else None)
        if not text:
            return default if default is not None else 0.0
        value = real_number(text)
        if value is None:
            raise self.error(field, text, f"a real number up to {_LARGEST_NUMBER:g}")
        return value

    def reals(self, first: int, number: int, default: float = 0.0) -> tuple[float, ...]:
        """Some fields as real numbers."""
        return tuple(self.real(field, default) for field in range(first, first + number))

    def ranges(self, first: int) -> tuple[range, ...]:
        """The rest of the fields as integers, with THRU and BY; blank fields between are left out.

        A number alone is a range of itself; what stands after THRU begins at the number before it.
        """
        found: list[range] = []
        words = [(field, text) for field, text in enumerate(self.fields[first - 2 :], start=first) if text]
        at = 0
        while at < len(words):
            field, text = words[at]
            if text.upper() == "THRU":
                stop, step, used = self._range(words, at)
                if not found or len(found[-1]) != 1 or stop < found[-1][0]:
                    raise self.error(field, f"THRU {stop}", "a range upwards")
                found[-1] = range(found[-1][0], stop + 1, step)
                at += used
                continue
            number = self.identifier(field)
            found.append(range(number, number + 1))
            at += 1
        return tuple(found)

    def listed(self, first: int) -> tuple[int, ...]:
        """The numbers of `ranges`, one by one."""
        ranges = self.ranges(first)
        if sum(map(len, ranges)) > _LONGEST_LIST:
            raise FileFormatError(
                self.place, got=f"{sum(map(len, ranges))} numbers", allowed=f"≤ {_LONGEST_LIST} in a list"
            )
        return tuple(number for numbers in ranges for number in numbers)

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


def components(card: Card, field: int, default: str = "") -> tuple[int, ...]:
    """Digits 1 to 6 of a field as indices 0 to 5."""
    text = card.text(field, default)
    if not text or text == "0":
        return ()
    if not set(text) <= set("123456") or len(set(text)) != len(text):
        raise card.error(field, text, "digits of 123456, each once")
    return tuple(int(digit) - 1 for digit in text)


def one_component(card: Card, field: int) -> int:
    """One digit 1 to 6 of a field as an index 0 to 5."""
    found = components(card, field)
    if len(found) != 1:
        raise card.error(field, card.text(field, ""), "one digit of 123456")
    return found[0]


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
    return tuple(cards_of(read_lines(*paths, instead=instead).bulk))


def cards_of(lines: Iterable[Line]) -> Iterator[Card]:
    """Cards in their order; a continuation stands right after what it continues."""
    name, label_before, start, n_cards = "", "", Line("", "", 0), 0
    fields: list[str] = []
    for line in lines:
        first, cut, label_after = _fields_of(line)
        if _is_continuation(first):
            if not name:
                raise FileFormatError(line.place, got="a continuation without a card")
            label = first.lstrip("+*").upper()
            if label and label_before and label != label_before:
                raise FileFormatError(
                    f"{line.place}: continuation {first[:8]}",
                    got=f"after a line that names {label_before[:8]}",
                    allowed="continuations right after their card",
                )
            fields.extend(cut)
        else:
            if name:
                yield Card(name, _without_tail(fields), start.file, start.number)
            n_cards += 1
            if n_cards > _MOST_CARDS:
                raise FileFormatError(line.place, got=f"more than {_MOST_CARDS} cards", allowed="fewer")
            name, fields, start = first.rstrip("*").strip().upper(), list(cut), line
        if len(fields) > _MOST_FIELDS:
            raise FileFormatError(start.place, got=f"more than {_MOST_FIELDS} fields", allowed="fewer")
        label_before = label_after.lstrip("+*").strip().upper()
    if name:
        yield Card(name, _without_tail(fields), start.file, start.number)


def _is_continuation(first: str) -> bool:
    return not first or first[0] in "+*"


def _without_tail(fields: list[str]) -> tuple[str, ...]:
    end = len(fields)
    while end and not fields[end - 1]:
        end -= 1
    return tuple(fields[:end])


def _fields_of(line: Line) -> tuple[str, list[str], str]:
    """Name or name of a continuation, fields, and the name of the next line's continuation."""
    if "," in line.text:
        # free format: eight fields to a line, wide or not
        parts = [part.strip() for part in line.text.replace("\t", " ").split(",")]
        if len(parts) > 10:
            raise FileFormatError(line.place, got=f"{len(parts)} fields", allowed="≤ 10 to a line")
        n_fields = 4 if "*" in parts[0] else 8
        cut, label = parts[1 : 1 + n_fields], "".join(parts[1 + n_fields :])
        return parts[0], cut + [""] * (n_fields - len(cut)), label
    text = line.text.expandtabs(8)
    first = text[:8].strip()
    width, n_fields = (16, 4) if "*" in first else (8, 8)
    cut = [text[8 + width * n : 8 + width * (n + 1)].strip() for n in range(n_fields)]
    return first, cut, text[72:80].strip()
