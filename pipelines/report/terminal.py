"""Lines for a terminal: whatever text of files and devices is in them, the terminal obeys none of it."""

from __future__ import annotations

import os
import sys
import unicodedata
from typing import Final, Literal

import typer

Tone = Literal["error", "flag"]
_COLOURS: Final[dict[Tone, str]] = {"error": "red", "flag": "yellow"}


def printable(text: str) -> str:
    """`text` with everything that a terminal would obey or hide written out.

    Control characters move the cursor, change colours and titles, or begin a line that looks like another result;
    characters for the direction of text make it read as something else. Spaces of any width stay.

    Examples
    --------
    >>> print(printable("run 7" + chr(27) + "[2J" + chr(10) + "all channels usable"))
    run 7\\x1b[2J\\nall channels usable
    """
    return "".join(
        character
        if character.isprintable() or unicodedata.category(character) == "Zs"
        else character.encode("unicode_escape").decode("ascii")
        for character in text
    )


def say(line: str, *, error: bool = False) -> None:
    """Print one line at once, to standard error if `error`."""
    typer.echo(printable(line), err=error)


def complain(line: str, tone: Tone = "error") -> None:
    """Print one line to standard error, its beginning up to the first colon in colour where that is seen."""
    shown = printable(line)
    head, colon, rest = shown.partition(":")
    if colon and errors_are_coloured():
        shown = f"{typer.style(head + colon, fg=_COLOURS[tone], bold=True)}{rest}"
    typer.echo(shown, err=True)


def errors_are_coloured() -> bool:
    """Whether standard error is a terminal that shows colours, and nobody asked for none (no-color.org)."""
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def warn(line: str) -> None:
    """Print one line to standard error at once, as a warning."""
    complain(line, "flag")
