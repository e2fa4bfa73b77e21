"""A mark that a person sets while it records: a text and the moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

MOST_MARKS: Final = 200
LONGEST_TEXT: Final = 60
"""Letters; so many marks with so long texts still fit into one attribute."""


@dataclass(frozen=True)
class Mark:
    """A mark.

    Attributes
    ----------
    text : str
        One line, maybe empty.
    host_monotonic_ns, host_utc_ns : int
        When it was set.
    """

    text: str
    host_monotonic_ns: int
    host_utc_ns: int
