"""The facts of ``laboratory.toml``: what the source says of its tank on the shaker, half filled unless stated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from sloshlab.errors import InputError
from sloshlab.toml_file import read_toml

PLACE: Final = Path(__file__).with_name("laboratory.toml")
_HALVES: Final = ("chooses", "judges")
_NEEDED: Final = ("name", "where", "half", "what", "published")


@dataclass(frozen=True)
class MeasuredWork:
    """W̄ at a place of the plane."""

    omega_bar: float
    u_bar: float
    w_bar: float


@dataclass(frozen=True)
class LaboratoryFact:
    """One fact of the source.

    Attributes
    ----------
    name : str
        By which code knows it.
    where : str
        Section, figure or equation of the source.
    half : {"chooses", "judges"}
        Whether a coefficient may be chosen by it, or is judged by it.
    what, published : str
        Of tables.
    numbers : mapping
        What it is measured by; see ``laboratory.toml``.
    """

    name: str
    where: str
    half: Literal["chooses", "judges"]
    what: str
    published: str
    numbers: Mapping[str, Any]

    def agrees(self, value: float) -> bool:
        """Whether a value is within the spread of the fact: its range, or its share of the measured value.

        Examples
        --------
        >>> FACTS["threshold"].agrees(1.2), FACTS["largest"].agrees(2.3)
        (True, False)
        """
        if "range" in self.numbers:
            low, high = self.numbers["range"]
            return bool(low <= value <= high)
        return bool(abs(value / self.numbers["value"] - 1) < self.numbers["share"])


def laboratory_facts(tables: Mapping[str, Any]) -> dict[str, LaboratoryFact]:
    """Facts by their names, in the order of the file.

    Parameters
    ----------
    tables : mapping
        Of a file like ``laboratory.toml``.

    Raises
    ------
    InputError
        If a fact lacks one of its words, has a half that is none, or a name that another one has.
    """
    facts: dict[str, LaboratoryFact] = {}
    for k, entry in enumerate(tables.get("fact", [])):
        missing = [word for word in _NEEDED if not isinstance(entry.get(word), str)]
        if missing:
            raise InputError(
                f"fact {k + 1}", got=f"no {', '.join(missing)}", remedy=f"complete it in {PLACE.name}"
            )
        if entry["half"] not in _HALVES:
            raise InputError(f"fact {entry['name']}, half", got=entry["half"], allowed=", ".join(_HALVES))
        if entry["name"] in facts:
            raise InputError("facts", got=f"two of the name {entry['name']}", remedy="rename one")
        numbers = {key: value for key, value in entry.items() if key not in _NEEDED}
        facts[entry["name"]] = LaboratoryFact(**{word: entry[word] for word in _NEEDED}, numbers=numbers)
    return facts


_TABLES: Final = read_toml(PLACE, PLACE.name)
FACTS: Final = laboratory_facts(_TABLES)

FILLING_LEVEL: Final[float] = _TABLES["filling_level"]
FULL_BAND: Final[tuple[float, float]] = tuple(_TABLES["full_band_omega_bar"])
"""Frequencies ω̄ between which levels of acceleration are compared."""
ONSET_W_BAR: Final[float] = _TABLES["onset_w_bar"]
"""W̄ from which the liquid counts as dissipating."""
SHARE_OF_LARGEST: Final[float] = _TABLES["share_of_largest"]
"""On the isolines of the source."""


def _measured_work(name: str) -> MeasuredWork:
    numbers = FACTS[name].numbers
    omega_bar = numbers["omega_bar"]
    # a₀/g = ū ω̄²
    u_bar = numbers["u_bar"] if "u_bar" in numbers else numbers["acceleration_g"] / omega_bar**2
    return MeasuredWork(omega_bar, u_bar, numbers["value"])


LARGEST: Final = _measured_work("largest")
BEAM: Final = _measured_work("beam")
"""Where the sloshing beam works."""
ISOLINE_U_BAR: Final[tuple[float, float]] = tuple(FACTS["region_0.5"].numbers["range"])
WEAKEST_G: Final[float] = FACTS["weakest"].numbers["acceleration_g"]
BETA_AT_WEAKEST: Final[float] = FACTS["weakest"].numbers["value"]
