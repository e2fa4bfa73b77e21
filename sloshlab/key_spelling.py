"""Which known key of a TOML table an unknown one is meant for: slips of the keyboard and other units."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

_NEAR: Final = 0.6
"""Of all letters, the share that agrees in order, from which one key may be meant for another."""
_NEARLY_THE_SAME: Final = 0.85
"""The same where nothing is missing without that key: one wrong, missing or exchanged letter, not another word."""

_UNITS: Final[Mapping[str, str]] = {
    "kg_per_m3": "kilograms per cubic metre",
    "kg_per_s": "kilograms per second",
    "n_per_m": "newtons per metre",
    "m2_per_s": "square metres per second",
    "kg": "kilograms",
    "hz": "hertz",
    "m": "metres",
    "n": "newtons",
}
"""Units at the end of keys; the longer ones first."""

_UNIT_WORDS: Final = frozenset(
    re.findall(
        "[a-z0-9]+",
        "m mm cm dm um km in inch inches ft feet m2 cm2 mm2 m3 dm3 cm3 mm3 l ml litre g mg kg t lb lbs n mn kn "
        "s ms us hz khz mhz rad deg per st cst percent pct si",
    )
)


def nearest_key(key: str, known: Iterable[str], *, near: float = _NEAR) -> str | None:
    """The known key that is most like another one; None if none is like it.

    Examples
    --------
    >>> nearest_key("fil_level", ["name", "fill_level"]), nearest_key("colour", ["name", "fill_level"])
    ('fill_level', None)
    """
    return next(iter(difflib.get_close_matches(key.lower(), list(known), n=1, cutoff=near)), None)


@dataclass(frozen=True)
class Slip:
    """An unknown key, the known one that is missing, and what to do about it."""

    key: str
    meant: str
    remedy: str


def misspelt_key(keys: Collection[str], known: Collection[str], required: Collection[str]) -> Slip | None:
    """The first key of a table that keeps unknown keys which is meant for a known one that is not there.

    Parameters
    ----------
    keys : collection of str
        Of the table.
    known : collection of str
        Keys that mean something in it.
    required : collection of str
        Those of them that must be there: what is like a missing one is a slip. An optional key is only missed
        where another one is nearly the same, or the same in other units.

    Returns
    -------
    Slip or None

    Examples
    --------
    >>> tank = ["height_m", "length_m", "material"]
    >>> misspelt_key(["height_mm", "length_m", "colour"], tank, ["height_m", "length_m"])
    Slip(key='height_mm', meant='height_m', remedy='this file takes metres: height_m')
    >>> misspelt_key(["height_m", "lenght_m"], tank, ["height_m", "length_m"]).remedy
    "did you mean 'length_m'?"
    >>> misspelt_key(["height_m", "length_m", "colour"], tank, ["height_m", "length_m"])
    """
    absent = [key for key in known if key not in keys]
    missing = [key for key in required if key not in keys]
    for key in keys:
        if key in known:
            continue
        for meant in absent:
            if _is_of_other_units(key, meant, alone=meant in missing):
                return Slip(key, meant, f"this file takes {_units_of(meant)[1]}: {meant}")
        near = nearest_key(key, missing) or nearest_key(key, absent, near=_NEARLY_THE_SAME)
        if near:
            return Slip(key, near, f"did you mean '{near}'?")
    return None


def _units_of(key: str) -> tuple[str, str]:
    """A key without its units, and these in words."""
    for units, words in _UNITS.items():
        if key.endswith(f"_{units}"):
            return key.removesuffix(f"_{units}"), words
    return key, "a share of 1"


def _is_of_other_units(key: str, meant: str, *, alone: bool) -> bool:
    """Whether a key is `meant` with other units, or, where that may count, with none."""
    quantity, given = _units_of(meant)[0], key.lower()
    if given in (meant, quantity):
        return alone and given != meant
    units = given.removeprefix(f"{quantity}_")
    return units != given and _UNIT_WORDS.issuperset(units.split("_"))
