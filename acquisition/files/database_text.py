"""DBC files as cantools reads them, after a look at what they would make it allocate.

cantools makes a list of every bit of a signal and of every number of a multiplexer, before it compares them with
the length of the message: 149 bytes of text take gigabytes.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from acquisition.files.reading_limits import ReaderGuard, library
from sloshlab.errors import FileFormatError

LONGEST_MESSAGE_BYTES: Final = 1785
"""The longest of any CAN protocol in DBC files: 255 packets of 7 bytes (SAE J1939-21, transport protocol)."""

LARGEST_MULTIPLEXER: Final = 1 << 16
"""Multiplexers have 16 bits or fewer; each number in a range is listed."""

_MESSAGE = re.compile(r"\bBO_\s+\d+\s+\w+\s*:\s*(\d+)")
_SIGNAL_BITS = re.compile(r"(\d+)\s*\|\s*(\d+)\s*@")
_MULTIPLEXERS = re.compile(r"\bSG_MUL_VAL_\s[^;]*")
_RANGE = re.compile(r"(\d+)\s*-\s*(\d+)")
# of a number that could be allowed; longer ones are not even converted
_MOST_DIGITS = 9


def loaded_database(text: str, name: str) -> Any:
    """The database, strictly: signals that overlap or leave their message are refused.

    Parameters
    ----------
    text : str
        Content of the file.
    name : str
        Of the file, for messages.

    Returns
    -------
    cantools.database.can.Database

    Raises
    ------
    FileFormatError
        If it is no DBC file, or describes what no bus can carry.
    MissingExtraError
        If cantools is not installed.
    """
    cantools = library("cantools", "decoding CAN logs")
    _require_possible_sizes(text, name)
    with ReaderGuard(Path(name), "DBC", loggers=("cantools",)):
        return cantools.database.load_string(text, database_format="dbc", strict=True)


def decoded_text(content: bytes) -> str:
    """Text of a DBC file: UTF-8, or cp1252, the usual encoding where units and comments are beyond ASCII."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _require_possible_sizes(text: str, name: str) -> None:
    for found in _MESSAGE.finditer(text):
        _require_at_most(LONGEST_MESSAGE_BYTES, found[1], "bytes of a message", name)
    for found in _SIGNAL_BITS.finditer(text):
        for number in found.groups():
            _require_at_most(8 * LONGEST_MESSAGE_BYTES, number, "as bit or length of a signal", name)
    n_listed = 0
    for statement in _MULTIPLEXERS.finditer(text):
        for found in _RANGE.finditer(statement[0]):
            _require_at_most(LARGEST_MULTIPLEXER, found[2], "as number of a multiplexer", name)
            n_listed += max(0, int(found[2]) - int(found[1][-_MOST_DIGITS:]))
    # each of them alone may be as long
    _require_at_most(16 * LARGEST_MULTIPLEXER, str(n_listed), "numbers of multiplexers", name)


def _require_at_most(largest: int, number: str, what: str, name: str) -> None:
    if len(number) > _MOST_DIGITS or int(number) > largest:
        raise FileFormatError(
            f"source {name}",
            got=f"{number[:20]} {what}",
            allowed=f"≤ {largest}",
            remedy="the database is damaged; export it again",
        )
