"""Cards of cross-sections: PBAR, PBARL, PBEAM and PBEAML, constant or tapered along the beam."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Final

from sloshlab.aircraft.bulk_data import Card
from sloshlab.aircraft.deck import Deck, Section, TaperedSection
from sloshlab.aircraft.section_shapes import SHAPES
from sloshlab.errors import FileFormatError

_STATION: Final = ("YES", "YESA", "NO")
_MOST_STATIONS: Final = 100


def _put(deck: Deck, card: Card, family: str, sections: dict[float, Section]) -> None:
    """Enter a property by its cross-sections at shares of the length."""
    key = (family, card.identifier(2))
    if key in deck.sections:
        raise FileFormatError(card.place, got=f"number {key[1]} a second time", allowed="each number once")
    for section in sections.values():
        if section.area < 0 or section.inertia_1 < 0 or section.inertia_2 < 0 or section.torsion < 0:
            raise FileFormatError(card.place, got="a negative area or inertia", allowed="≥ 0")
        if section.inertia_12**2 > section.inertia_1 * section.inertia_2:
            raise FileFormatError(card.place, got=f"I12 {section.inertia_12:g}", allowed="I12² ≤ I1 I2")
    stations = tuple(sorted(sections))
    first = sections[stations[0]]
    if all(section == first for section in sections.values()):
        deck.sections[key] = first
        return
    if stations[-1] != 1.0:
        raise FileFormatError(card.place, got="stations without one at end B", allowed="X/XB up to 1.0")
    deck.sections[key] = TaperedSection(stations, tuple(sections[station] for station in stations))


def _share_in_shear(value: float | None) -> float:
    """Area in shear over the area; 0 and blank mean in the manual that shear deforms nothing."""
    return value if value else inf


def _bar(deck: Deck, card: Card) -> None:
    area, i1, i2, torsion, per_length = card.reals(4, 5)
    # line 2 has places for stresses, line 3 shear and I12
    i12 = card.real(20, 0.0)
    # with I12 the manual ignores areas in shear
    shear_1, shear_2 = (inf if i12 else _share_in_shear(card.real(field, 0.0)) for field in (18, 19))
    section = Section(card.identifier(3), area, i1, i2, i12, torsion, per_length, shear_1, shear_2)
    _put(deck, card, "BAR", {0.0: section})


def _by_dimensions(deck: Deck, card: Card) -> None:
    """PBARL, and PBEAML with the dimensions of further stations."""
    kind = card.text(5).upper()
    if kind not in SHAPES:
        raise card.error(5, kind, ", ".join(SHAPES))
    n_dimensions = SHAPES[kind][0]
    sections = {0.0: _shaped(card, kind, 10, None)}
    field = 10 + n_dimensions + 1
    while card.name == "PBEAML" and field < len(card.fields) + 2:
        if card.text(field, "YES").upper() not in _STATION:
            raise card.error(field, card.text(field, ""), ", ".join(_STATION))
        share = _share(card, field + 1, sections)
        sections[share] = _shaped(card, kind, field + 2, 10)
        field += n_dimensions + 3
    _put(deck, card, card.name[1:-1], sections)


def _shaped(card: Card, kind: str, first: int, otherwise: int | None) -> Section:
    """The cross-section whose dimensions begin at a field; `otherwise` is where those stand that blanks repeat."""
    n_dimensions, shape = SHAPES[kind]
    numbers = [
        card.real(first + n, None if otherwise is None else card.real(otherwise + n)) for n in range(n_dimensions)
    ]
    if min(numbers) < 0 or numbers[0] == 0:
        raise card.error(first, " ".join(map(str, numbers)), "> 0")
    try:
        found = shape(*numbers)
    except ValueError as error:
        raise card.error(first, " ".join(f"{number:g}" for number in numbers), str(error)) from error
    last = n_dimensions
    per_length = card.real(first + last, 0.0 if otherwise is None else card.real(otherwise + last, 0.0))
    return Section(
        card.identifier(3), found.area, found.inertia_1, found.inertia_2, 0.0, found.torsion, per_length,
        found.shear_1, found.shear_2,
    )  # fmt: skip


def _share(card: Card, field: int, sections: dict[float, Section]) -> float:
    share = card.real(field, 1.0)
    if not 0 < share <= 1 or share in sections or len(sections) >= _MOST_STATIONS:
        raise card.error(field, f"{share:g}", f"above 0, up to 1, each once, ≤ {_MOST_STATIONS}")
    return share


def _beam(deck: Deck, card: Card) -> None:
    at_a = card.reals(4, 6)
    lines = [card.fields[first : first + 8] for first in range(8, len(card.fields), 8)]
    field = 10
    if lines and not _is_station(lines[0]):
        lines, field = lines[1:], field + 8  # places for stresses
    stations: list[int] = []
    while lines and _is_station(lines[0]):
        stations.append(field)
        # after YES the places for stresses at the station follow
        used = 2 if lines[0][0].upper() == "YES" and len(lines) > 1 and not _is_station(lines[1]) else 1
        lines, field = lines[used:], field + 8 * used
    shear = (1.0, 1.0)
    polar = (0.0, 0.0)
    if lines:
        shear = (card.real(field, 1.0), card.real(field + 1, 1.0))
        polar = (card.real(field + 4, 0.0), card.real(field + 5, card.real(field + 4, 0.0)))
        # CW, fields 6 and 7, is for beams with warping, which CBEAM here cannot have
        for further in (field + 2, field + 3, *range(field + 8, len(card.fields) + 2)):
            if card.real(further, 0.0) != 0:
                raise card.error(further, card.text(further), "0: no relief in shear, no axis or mass beside it")
    _put(deck, card, "BEAM", _at_stations(card, at_a, stations, shear, polar))


def _at_stations(
    card: Card,
    at_a: tuple[float, ...],
    stations: list[int],
    shear: tuple[float, float],
    polar: tuple[float, float],
) -> dict[float, Section]:
    """Cross-sections by share of the length; blank numbers are those of A at B, and linear between A and B."""

    def section(numbers: tuple[float, ...], share: float) -> Section:
        of_mass = (1 - share) * polar[0] + share * polar[1]
        area, i1, i2, i12, torsion, per_length = numbers
        shear_1, shear_2 = map(_share_in_shear, shear)
        return Section(card.identifier(3), area, i1, i2, i12, torsion, per_length, shear_1, shear_2, of_mass)

    sections = {0.0: section(at_a, 0.0)}
    fields: dict[float, int] = {}
    for field in stations:
        share = _share(card, field + 1, sections)
        if share in fields:
            raise card.error(field + 1, f"{share:g}", "each station once")
        fields[share] = field
    at_b = tuple(card.real(fields[1.0] + 2 + n, value) for n, value in enumerate(at_a)) if 1.0 in fields else at_a
    if 1.0 in fields or polar[0] != polar[1]:
        sections[1.0] = section(at_b, 1.0)
    for share, field in fields.items():
        between = tuple((1 - share) * a + share * b for a, b in zip(at_a, at_b, strict=True))
        sections[share] = section(tuple(card.real(field + 2 + n, value) for n, value in enumerate(between)), share)
    return sections


def _is_station(line: tuple[str, ...]) -> bool:
    return bool(line) and line[0].upper() in _STATION


SECTION_CARDS: Final[dict[str, Callable[[Deck, Card], None]]] = {
    "PBAR": _bar,
    "PBARL": _by_dimensions,
    "PBEAM": _beam,
    "PBEAML": _by_dimensions,
}
