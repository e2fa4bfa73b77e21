"""Cards of cross-sections: PBAR, PBARL and PBEAM, constant along the beam."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi
from typing import Final

from sloshlab.aircraft.bulk_data import Card
from sloshlab.aircraft.deck import Deck, Section
from sloshlab.errors import FileFormatError

_STATION: Final = ("YES", "YESA", "NO")


def _put(deck: Deck, card: Card, family: str, section: Section) -> None:
    key = (family, card.identifier(2))
    if key in deck.sections:
        raise FileFormatError(card.place, got=f"number {key[1]} a second time", allowed="each number once")
    if section.area < 0 or section.inertia_1 < 0 or section.inertia_2 < 0 or section.torsion < 0:
        raise FileFormatError(card.place, got="a negative area or inertia", allowed="≥ 0")
    if section.inertia_12**2 > section.inertia_1 * section.inertia_2:
        raise FileFormatError(card.place, got=f"I12 {section.inertia_12:g}", allowed="I12² ≤ I1 I2")
    deck.sections[key] = section


def _share_in_shear(value: float | None) -> float:
    """Area in shear over the area; 0 and blank mean in the manual that shear deforms nothing."""
    return value if value else inf


def _bar(deck: Deck, card: Card) -> None:
    area, i1, i2, torsion, per_length = card.reals(4, 5)
    # line 2 has places for stresses, line 3 shear and I12
    shear_1, shear_2 = (_share_in_shear(card.real(field, 0.0)) for field in (18, 19))
    _put(
        deck, card, "BAR",
        Section(card.identifier(3), area, i1, i2, card.real(20, 0.0), torsion, per_length, shear_1, shear_2),
    )  # fmt: skip


def _bar_by_dimensions(deck: Deck, card: Card) -> None:
    kind = card.text(5).upper()
    if kind not in _SHAPES:
        raise card.error(5, kind, ", ".join(_SHAPES))
    n_dimensions, shape, in_shear = _SHAPES[kind]
    dimensions = tuple(card.real(field) for field in range(10, 10 + n_dimensions))
    if min(dimensions) < 0 or dimensions[0] == 0:
        raise card.error(10, " ".join(map(str, dimensions)), "> 0")
    area, i1, i2, torsion = shape(*dimensions)
    per_length = card.real(10 + n_dimensions, 0.0)
    _put(
        deck, card, "BAR",
        Section(card.identifier(3), area, i1, i2, 0.0, torsion, per_length, in_shear, in_shear),
    )  # fmt: skip


def _rectangle(width: float, height: float) -> tuple[float, float, float, float]:
    """Area, I1, I2 and the torsion of a rectangle (Roark)."""
    a, b = max(width, height), min(width, height)
    torsion = a * b**3 * (1 / 3 - 0.21 * b / a * (1 - b**4 / (12 * a**4)))
    return width * height, width * height**3 / 12, height * width**3 / 12, torsion


def _rod(radius: float) -> tuple[float, float, float, float]:
    return _tube(radius, 0.0)


def _tube(outer: float, inner: float) -> tuple[float, float, float, float]:
    inertia = pi * (outer**4 - inner**4) / 4
    return pi * (outer**2 - inner**2), inertia, inertia, 2 * inertia


_SHAPES: Final[dict[str, tuple[int, Callable[..., tuple[float, float, float, float]], float]]] = {
    "BAR": (2, _rectangle, 5 / 6),
    "ROD": (1, _rod, 0.9),
    "TUBE": (2, _tube, 0.5),
}
"""By TYPE: number of dimensions, shape, and area in shear over the area as the manual has it."""


def _beam(deck: Deck, card: Card) -> None:
    area, i1, i2, i12, torsion, per_length = card.reals(4, 6)
    lines = [card.fields[first : first + 8] for first in range(8, len(card.fields), 8)]
    field = 10
    if lines and not _is_station(lines[0]):
        lines, field = lines[1:], field + 8  # places for stresses
    while lines and _is_station(lines[0]):
        _require_constant(card, field, (area, i1, i2, i12, torsion, per_length))
        # after YES the places for stresses at the station follow
        used = 2 if lines[0][0].upper() == "YES" and len(lines) > 1 and not _is_station(lines[1]) else 1
        lines, field = lines[used:], field + 8 * used
    shear_1, shear_2 = 1.0, 1.0
    if lines:
        shear_1, shear_2 = (card.real(field + n, 1.0) for n in (0, 1))
        for further in range(field + 2, len(card.fields) + 2):
            if card.real(further, 0.0) != 0:
                raise card.error(further, card.text(further), "0: no inertia, warping or offset of its own")
    _put(
        deck, card, "BEAM",
        Section(
            card.identifier(3), area, i1, i2, i12, torsion, per_length,
            _share_in_shear(shear_1), _share_in_shear(shear_2),
        ),
    )  # fmt: skip


def _is_station(line: tuple[str, ...]) -> bool:
    return bool(line) and line[0].upper() in _STATION


def _require_constant(card: Card, field: int, at_a: tuple[float, ...]) -> None:
    names = ("A", "I1", "I2", "I12", "J", "NSM")
    for number, (name, value) in enumerate(zip(names, at_a, strict=True)):
        here = card.real(field + 2 + number, value)
        if abs(here - value) > 1e-9 * abs(value):
            raise card.error(field + 2 + number, f"{name} {here:g} after {value:g}", "a constant section")


SECTION_CARDS: Final[dict[str, Callable[[Deck, Card], None]]] = {
    "PBAR": _bar,
    "PBARL": _bar_by_dimensions,
    "PBEAM": _beam,
}
