"""Lines of a deck in order: INCLUDE followed, comments cut off, bulk data told from the sections before it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from sloshlab.errors import FileFormatError

_LARGEST_FILE_BYTES: Final = 50 * 2**20
_LARGEST_TOTAL_BYTES: Final = 200 * 2**20
_LARGEST_DEPTH: Final = 8
_MOST_FILES: Final = 2000
_LONGEST_NAME_LINES: Final = 20
_BEGIN: Final = re.compile(r"\s*BEGIN(\s+BULK)?\s*$", re.IGNORECASE)
_BEGIN_OTHER: Final = re.compile(r"\s*BEGIN\s+\S", re.IGNORECASE)
_END_OF_EXECUTIVE: Final = re.compile(r"\s*CEND\b", re.IGNORECASE)
_END_OF_DATA: Final = re.compile(r"\s*ENDDATA", re.IGNORECASE)
_INCLUDE: Final = re.compile(r"\s*INCLUDE\s+(.*)$", re.IGNORECASE)


@dataclass(frozen=True)
class Line:
    """One line without its comment."""

    text: str
    file: str
    number: int

    @property
    def place(self) -> str:
        """File and line, for messages."""
        return f"{self.file}:{self.number}"


@dataclass
class DeckLines:
    """Lines of the executive and case control sections, and of the bulk data."""

    control: list[Line] = field(default_factory=list)
    bulk: list[Line] = field(default_factory=list)


def read_lines(*paths: Path, instead: Mapping[str, Path] | None = None) -> DeckLines:
    """All lines of decks, or of files of bulk data alone, and of what they include.

    Parameters
    ----------
    *paths : Path
    instead : mapping of str to Path, optional
        Files that stand for included ones, by the name in the INCLUDE line.

    Raises
    ------
    FileFormatError
        If a file is missing, too large or no text, or INCLUDE goes round.
    """
    lines = DeckLines()
    for path in paths:
        _Reader(path.parent, instead or {}, lines).read(path, within=(), in_bulk=None)
    return lines


class _Reader:
    def __init__(self, folder: Path, instead: Mapping[str, Path], lines: DeckLines) -> None:
        self.folder, self.instead, self.lines = folder, instead, lines
        self.n_files = self.n_bytes = 0

    def read(self, path: Path, within: tuple[Path, ...], *, in_bulk: bool | None) -> bool:
        """Add the lines of a file; whether what follows it is bulk data."""
        if path.resolve() in within or len(within) >= _LARGEST_DEPTH:
            raise FileFormatError(
                str(path), got=f"an INCLUDE that goes round or deeper than {_LARGEST_DEPTH}",
                remedy="correct INCLUDE",
            )  # fmt: skip
        lines = self._lines(path)
        begins = [n for n, line in enumerate(lines) if _BEGIN.match(line.text)]
        if in_bulk is None:  # a deck, or a file of bulk data alone
            in_bulk = not begins and not any(_END_OF_EXECUTIVE.match(line.text) for line in lines)
        elif begins:
            in_bulk = False
        numbered = enumerate(lines)
        for n, line in numbered:
            if begins and n == begins[-1]:
                in_bulk = True
            elif _BEGIN_OTHER.match(line.text) and not _BEGIN.match(line.text):
                raise FileFormatError(line.place, got=line.text.strip()[:40], allowed="BEGIN BULK, one model")
            elif in_bulk and _END_OF_DATA.match(line.text):
                return in_bulk
            elif _INCLUDE.match(line.text):
                target = self._included(line, numbered, path)
                in_bulk = self.read(target, (*within, path.resolve()), in_bulk=in_bulk)
            elif in_bulk:
                _require_ascii(line)
                self.lines.bulk.append(line)
            else:
                self.lines.control.append(line)
        return in_bulk

    def _lines(self, path: Path) -> list[Line]:
        what = str(path)
        try:
            size = path.stat().st_size
            self.n_files, self.n_bytes = self.n_files + 1, self.n_bytes + size
            if size > _LARGEST_FILE_BYTES or self.n_bytes > _LARGEST_TOTAL_BYTES:
                raise FileFormatError(what, got="a large file", allowed=f"≤ {_LARGEST_FILE_BYTES // 2**20} MiB")
            if self.n_files > _MOST_FILES:
                raise FileFormatError(what, got=f"more than {_MOST_FILES} INCLUDE", allowed="fewer")
            text = path.read_bytes().decode("latin-1")  # comments have any bytes; cards are ASCII
        except (OSError, ValueError) as error:
            if isinstance(error, FileFormatError):
                raise
            got = (error.strerror if isinstance(error, OSError) else None) or "no file"
            raise FileFormatError(what, got=got, remedy="give the file") from error
        lines = (
            Line(line.split("$")[0].rstrip(), path.name, number)
            for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1)
        )
        return [line for line in lines if line.text.strip()]

    def _included(self, line: Line, following: Iterator[tuple[int, Line]], deck: Path) -> Path:
        name = _name_in(line, following)
        target = self.instead.get(name) or self._found(name, deck)
        if target is None or not target.is_file():
            raise FileFormatError(
                f"{line.place}: INCLUDE",
                got=f"no file {name[:80]}",
                remedy="put it beside the deck, or name what stands for it by `instead`",
            )
        return target

    def _found(self, name: str, deck: Path) -> Path | None:
        """The included file, beside the file that names it or beside the deck."""
        for folder in dict.fromkeys((deck.parent, self.folder)):
            try:
                target = _whatever_its_capitals(folder, name.replace("\\", "/"))
            except (OSError, ValueError):
                return None
            if target is not None:
                return target
        return None


def _name_in(line: Line, following: Iterator[tuple[int, Line]]) -> str:
    """The name in an INCLUDE line; within quotes it may go on over several lines."""
    match = _INCLUDE.match(line.text)
    text = match[1].strip() if match else ""
    quote = text[:1]
    if quote not in ("'", '"'):
        return text
    text = text[1:]
    for _ in range(_LONGEST_NAME_LINES):
        if quote in text:
            return text.split(quote)[0].strip()
        _, further = next(following, (0, None))
        if further is None:
            break
        text += further.text.strip()
    raise FileFormatError(
        f"{line.place}: INCLUDE", got="a name whose quotes do not end", remedy="close the quotes"
    )


def _whatever_its_capitals(folder: Path, name: str) -> Path | None:
    """A file by its name; decks written where capitals count for nothing may name it in others."""
    if (folder / name).exists():
        return folder / name
    at = folder
    for part in Path(name).parts:
        if (at / part).exists():
            at = at / part
            continue
        alike = [p for p in at.iterdir() if p.name.lower() == part.lower()] if at.is_dir() else []
        if len(alike) != 1:
            return None
        at = alike[0]
    return at


def _require_ascii(line: Line) -> None:
    if any(ord(character) > 126 or ord(character) < 32 for character in line.text.replace("\t", "")):
        raise FileFormatError(line.place, got=repr(line.text)[:60], allowed="ASCII text")
