"""Lines for a terminal: whatever text of files and devices is in them, the terminal obeys none of it."""

from __future__ import annotations

import unicodedata

import typer


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
