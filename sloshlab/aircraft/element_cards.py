"""Cards of materials and elements: MAT1, beams, rods, springs and masses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi
from typing import Final

import numpy as np

from sloshlab.aircraft.bulk_data import Card, components, one_component, put_once
from sloshlab.aircraft.deck import Beam, Bush, Deck, Material, NodeMass, PointMass, Rod, ScalarElement
from sloshlab.errors import FileFormatError


def _material(deck: Deck, card: Card) -> None:
    given = [card.text(field, "") for field in (3, 4, 5)]
    e, g, nu = card.real(3, 0.0), card.real(4, 0.0), card.real(5, 0.0)
    if sum(map(bool, given)) < 2:
        raise card.error(3, "fewer than two of E, G and ν", "two of them")
    if not given[0]:
        e = 2 * (1 + nu) * g
    if not given[1]:
        g = e / (2 * (1 + nu))
    if e <= 0 or g < 0 or card.real(6, 0.0) < 0:
        raise card.error(3, f"E {e:g}, G {g:g}, density {card.real(6, 0.0):g}", "E > 0, G and density ≥ 0")
    put_once(deck.materials, card.identifier(2), Material(e, g, card.real(6, 0.0)), card)


def _beam(deck: Deck, card: Card, defaults: Card) -> None:
    """CBAR and CBEAM; `defaults` is BAROR or BEAMOR."""
    ends = (card.identifier(4), card.identifier(5))
    frames = card.text(9, defaults.text(9, "GGG")).upper()
    if len(frames) != 3 or frames[0] not in "GB" or not set(frames[1:]) <= set("GO"):
        raise card.error(9, frames, "GGG, or B in place of its first, O of its second or third")
    stated = card if any(card.text(field, "") for field in (6, 7, 8)) else defaults
    x1 = stated.text(6, "")
    is_node = x1.isdigit() and not stated.text(7, "") and not stated.text(8, "")
    if any(card.text(field, "0") not in ("0", "0.", "0.0") for field in (18, 19)):
        raise card.error(18, card.text(18, card.text(19, "")), "blank: beams without warping")
    beam = Beam(
        card.place,
        ends,
        (card.name.removeprefix("C"), card.integer(3, defaults.integer(3, 0) or card.identifier(2))),
        int(x1) if is_node else np.array(stated.reals(6, 3)),
        (components(card, 10), components(card, 11)),
        np.array([card.reals(12, 3), card.reals(15, 3)]),
        frames,
    )
    put_once(deck.beams, card.identifier(2), beam, card)


def _point_mass(deck: Deck, card: Card) -> None:
    grid, number = card.identifier(3), card.integer(4, 0)
    offset = np.array(card.reals(6, 3))
    place = deck.grid(grid, card.place).place
    # in a cylindrical system the directions at the node count, as they do for displacements
    axes = np.eye(3) if number == -1 else deck.frame(number, card.place).axes_at(place)
    arm = offset - place if number == -1 else axes @ offset
    i11, i21, i22, i31, i32, i33 = card.reals(10, 6)
    # products of inertia are stated positive and enter the matrix negative
    inertia = np.array([[i11, -i21, -i31], [-i21, i22, -i32], [-i31, -i32, i33]])
    mass = PointMass(card.place, grid, card.real(5, 0.0), arm, axes @ inertia @ axes.T)
    put_once(deck.masses, card.identifier(2), mass, card)


def _node_mass(deck: Deck, card: Card) -> None:
    """CONM1: the lower triangle of a matrix by rows."""
    grid = card.identifier(3)
    values = iter(card.reals(5, 21))
    matrix = np.zeros((6, 6))
    for row in range(6):
        for column in range(row + 1):
            matrix[row, column] = matrix[column, row] = next(values)
    axes = deck.frame(card.integer(4, 0), card.place).axes_at(deck.grid(grid, card.place).place)
    turned = np.zeros((6, 6))
    turned[:3, :3] = turned[3:, 3:] = axes
    put_once(deck.node_masses, card.identifier(2), NodeMass(card.place, grid, turned @ matrix @ turned.T), card)


def _rod(deck: Deck, card: Card) -> None:
    """CONROD, which has its own properties."""
    area, torsion, _, per_length = card.reals(6, 4)
    ends = (card.identifier(3), card.identifier(4))
    rod = Rod(card.place, ends, card.identifier(5), _not_negative(card, 6, area), torsion, per_length)
    put_once(deck.rods, card.identifier(2), rod, card)


def _not_negative(card: Card, field: int, value: float) -> float:
    if value < 0:
        raise card.error(field, f"{value:g}", "≥ 0")
    return value


def _rod_with_property(deck: Deck, card: Card, properties: dict[int, tuple[int, float, float, float]]) -> None:
    number = card.integer(3, card.identifier(2))
    if number not in properties:
        raise card.error(3, str(number), f"the number of a P{card.name.removeprefix('C')}")
    rod = Rod(card.place, (card.identifier(4), card.identifier(5)), *properties[number])
    put_once(deck.rods, card.identifier(2), rod, card)


def _rod_property(card: Card) -> tuple[int, float, float, float]:
    area, torsion, _, per_length = card.reals(4, 4)
    return card.identifier(3), _not_negative(card, 4, area), _not_negative(card, 5, torsion), per_length


def _tube_property(card: Card) -> tuple[int, float, float, float]:
    outer, per_length, outer_b = card.real(4), card.real(6, 0.0), card.real(7, 0.0)
    thickness = card.real(5, 0.0)
    inner = outer - 2 * thickness if thickness else 0.0
    if outer <= 0 or not 0 <= inner < outer or outer_b not in (0.0, outer):
        raise card.error(4, f"{outer:g}, {thickness:g}", "an outer diameter, not tapered, and a thickness of it")
    return card.identifier(3), pi * (outer**2 - inner**2) / 4, pi * (outer**4 - inner**4) / 32, per_length


def _ends(card: Card, first: int, second: int) -> tuple[tuple[int, int], ...]:
    ends = tuple(
        (card.identifier(field), one_component(card, field + 1))
        for field in (first, second)
        if card.text(field, "0") != "0"
    )
    if not ends:
        raise card.error(first, "no node", "at least one")
    return ends


def _spring(deck: Deck, card: Card) -> None:
    spring = ScalarElement(card.place, card.real(3), _ends(card, 4, 6))
    put_once(deck.springs, card.identifier(2), spring, card)


def _spring_with_property(deck: Deck, card: Card) -> None:
    value = _value(card, deck.spring_constants, "PELAS")
    put_once(deck.springs, card.identifier(2), ScalarElement(card.place, value, _ends(card, 4, 6)), card)


def _value(card: Card, table: dict[int, float], kind: str) -> float:
    number = card.integer(3, card.identifier(2))
    if number not in table:
        raise card.error(3, str(number), f"the number of a {kind}")
    return table[number]


def _spring_property(deck: Deck, card: Card) -> None:
    # two properties may stand on one card
    for first in (2, 6) if card.text(6, "") else (2,):
        put_once(deck.spring_constants, card.identifier(first), card.real(first + 1), card)


def _mass_property(deck: Deck, card: Card) -> None:
    # up to four properties on one card
    for first in (2, 4, 6, 8):
        if first == 2 or card.text(first, ""):
            put_once(deck.mass_values, card.identifier(first), card.real(first + 1), card)


def _scalar_mass(deck: Deck, card: Card) -> None:
    mass = ScalarElement(card.place, card.real(3), _ends(card, 4, 6))
    put_once(deck.scalar_masses, card.identifier(2), mass, card)


def _scalar_mass_with_property(deck: Deck, card: Card) -> None:
    value = _value(card, deck.mass_values, "PMASS")
    put_once(deck.scalar_masses, card.identifier(2), ScalarElement(card.place, value, _ends(card, 4, 6)), card)


def _bush(deck: Deck, card: Card) -> None:
    ends = tuple(number for number in (card.identifier(4), card.integer(5, 0)) if number)
    frame = card.integer(9) if card.text(9, "") else None
    x1, orientation = card.text(6, ""), None
    if x1:
        is_node = x1.isdigit() and not card.text(7, "")
        orientation = int(x1) if is_node else np.array(card.reals(6, 3))
    if card.text(11, "-1") != "-1" or any(card.text(field, "") for field in range(12, 15)):
        raise card.error(11, card.text(11, "an offset"), "-1: springs between their nodes")
    bush = Bush(
        card.place, ends, card.integer(3, card.identifier(2)), frame, orientation, card.real(10, 0.5)
    )  # fmt: skip
    put_once(deck.bushes, card.identifier(2), bush, card)


def _bush_property(deck: Deck, card: Card) -> None:
    """PBUSH: lines of K, of B and GE (dampers, which real modes do not feel), of RCV (for stresses)."""
    stiffness: tuple[float, ...] = (0.0,) * 6
    for first in range(3, len(card.fields) + 2, 8):
        kind = card.text(first, "").upper()
        if kind == "K":
            stiffness = card.reals(first + 1, 6)
        elif kind not in ("", "B", "GE", "RCV") or (not kind and any(card.fields[first - 1 : first + 6])):
            raise card.error(first, kind, "K, B, GE or RCV")
    put_once(deck.bush_stiffnesses, card.identifier(2), stiffness, card)


ELEMENT_CARDS: Final[dict[str, Callable[[Deck, Card], None]]] = {
    "MAT1": _material,
    "CONM1": _node_mass,
    "CONM2": _point_mass,
    "PMASS": _mass_property,
    "CMASS1": _scalar_mass_with_property,
    "CMASS2": _scalar_mass,
    "CONROD": _rod,
    "PELAS": _spring_property,
    "CELAS1": _spring_with_property,
    "CELAS2": _spring,
    "PBUSH": _bush_property,
    "CBUSH": _bush,
}
_BEAM_CARDS: Final = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}
_ROD_CARDS: Final = {"CROD": "PROD", "CTUBE": "PTUBE"}
LINE_CARDS: Final = (*_BEAM_CARDS, *_BEAM_CARDS.values(), *_ROD_CARDS, *_ROD_CARDS.values())


def complete_lines(deck: Deck, cards: Mapping[str, Sequence[Card]]) -> None:
    """Enter beams and rods, which take defaults and properties from other cards."""
    for name, defaults_name in _BEAM_CARDS.items():
        defaults = cards.get(defaults_name, ())
        if len(defaults) > 1:
            raise FileFormatError(defaults[1].place, got=f"a second {defaults_name}", allowed="one")
        for card in cards.get(name, ()):
            _beam(deck, card, defaults[0] if defaults else Card(defaults_name, (), "", 0))
    for name, property_name in _ROD_CARDS.items():
        properties: dict[int, tuple[int, float, float, float]] = {}
        for card in cards.get(property_name, ()):
            read = _rod_property if property_name == "PROD" else _tube_property
            put_once(properties, card.identifier(2), read(card), card)
        for card in cards.get(name, ()):
            _rod_with_property(deck, card, properties)
