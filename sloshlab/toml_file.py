"""TOML files of people and other programs, whose size and depth are checked before they are parsed.

The parser of Python takes time and memory in the square of the depth of tables and dotted keys: one key of 120 kB
exhausted the memory, and 200 kB of nested tables took minutes. A description of anything here is four tables deep.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable
from typing import Any, Final

from sloshlab.errors import InputError, SloshlabError

LARGEST_BYTES: Final = 1_000_000
DEEPEST: Final = 16
"""Levels of tables, lists and parts of a dotted key, one within the other."""

# Possessive throughout (`++`, `(?>`): no text makes the search go back, so that it takes as long as the text is.
_TOKENS: Final = re.compile(
    r"""
      \#[^\n]*+                                        # a comment
    | \"{3} (?>[^"\\]++|\\.|\"{1,2}(?!\"))*+ (?:\"{3,5}|\Z)
    | '{3} (?>[^']++|'{1,2}(?!'))*+ (?:'{3,5}|\Z)
    | \" (?>[^"\\\n]++|\\[^\n])*+ \"?
    | ' [^'\n]*+ '?
    | (?P<mark>[\[\]{}.=,\n])
    """,
    re.VERBOSE | re.DOTALL,
)


def read_toml(
    path: str | os.PathLike[str], what: str, *, error: Callable[..., SloshlabError] = InputError, remedy: str = ""
) -> dict[str, Any]:
    """Tables of a TOML file.

    Parameters
    ----------
    path : path-like
        A file of at most `LARGEST_BYTES`; no more is read of any.
    what : str
        What messages call it.
    error : type
        What is raised.
    remedy : str
        What to do where it cannot be read.

    Raises
    ------
    InputError
        Or `error`: the file cannot be read, is too large, no UTF-8 text, too deep, or no TOML.
    """
    return parse_toml(read_toml_text(path, what, error=error, remedy=remedy), what, error=error)


def read_toml_text(
    path: str | os.PathLike[str], what: str, *, error: Callable[..., SloshlabError] = InputError, remedy: str = ""
) -> str:
    """Text of a TOML file as `read_toml` takes it, not parsed."""
    try:
        with open(path, "rb") as file:
            content = file.read(LARGEST_BYTES + 1)
            size = max(len(content), os.fstat(file.fileno()).st_size)
    except (OSError, ValueError) as failure:  # ValueError: a null character in the path
        got = getattr(failure, "strerror", None) or str(failure)
        raise error(what, got=got, allowed="a readable TOML file", remedy=remedy) from failure
    if size > LARGEST_BYTES:
        raise error(what, got=f"{size} bytes", allowed=f"≤ {LARGEST_BYTES}", remedy="give a TOML file")
    try:
        # editors on Windows write a mark at the beginning, which TOML does not know
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        raise error(what, got="bytes that are not UTF-8 text", allowed="a TOML file") from failure


def parse_toml(text: str, what: str, *, error: Callable[..., SloshlabError] = InputError) -> dict[str, Any]:
    """Tables of TOML text.

    Parameters
    ----------
    text : str
        Of at most `LARGEST_BYTES` characters.
    what : str
        What messages call it.
    error : type
        What is raised.

    Raises
    ------
    InputError
        Or `error`: the text is too long, too deep, or no TOML.

    Examples
    --------
    >>> parse_toml("[tank]\\nheight_m = 0.0272", "rig")
    {'tank': {'height_m': 0.0272}}
    >>> parse_toml("[" + "a." * 60_000 + "a]", "rig")
    Traceback (most recent call last):
    ...
    sloshlab.errors.InputError: rig: got tables or keys more than 16 deep in line 1; allowed: ≤ 16; remedy: give \
a TOML file of this kind
    """
    if len(text) > LARGEST_BYTES:
        raise error(what, got=f"{len(text)} characters", allowed=f"≤ {LARGEST_BYTES}", remedy="give a TOML file")
    at = _first_too_deep(text)
    if at is not None:
        raise error(
            what,
            got=f"tables or keys more than {DEEPEST} deep in line {text.count(chr(10), 0, at) + 1}",
            allowed=f"≤ {DEEPEST}",
            remedy="give a TOML file of this kind",
        )
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as failure:  # ValueError: also integers of thousands of digits
        raise error(what, got=f"text that is not TOML ({failure})"[:200], allowed="TOML") from failure


def _first_too_deep(text: str) -> int | None:
    """Where the text first goes deeper than `DEEPEST`.

    It is told by brackets and dots outside of strings and comments; up to the first breach of the syntax, where
    the parser stops, it is at least as deep as what the parser finds.
    """
    brackets = dots = 0
    for token in _TOKENS.finditer(text):
        mark = token["mark"]
        if mark is None:
            continue
        if mark in "[{":
            brackets += 1
        elif mark in "]}":
            brackets = max(brackets - 1, 0)
        dots = dots + 1 if mark == "." else 0
        # one dot has a part on either side
        if brackets + dots + (dots > 0) > DEEPEST:
            return token.start()
    return None
