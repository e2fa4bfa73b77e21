"""From cards to a deck: which cards are understood, which say nothing about modes, and refusal of all others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from sloshlab.aircraft.aerodynamic_cards import AERODYNAMIC_CARDS, complete_aerodynamics
from sloshlab.aircraft.bulk_data import Card, put_once, read_cards
from sloshlab.aircraft.deck import Beam, Bush, Deck, Frame, Grid, Material, PointMass, RigidElement, ScalarElement
from sloshlab.aircraft.section_cards import SECTION_CARDS
from sloshlab.errors import FileFormatError

_PASSED_OVER: Final = (
    "EIGR", "EIGRL", "MKAERO1", "FLFACT", "FLUTTER", "TABDMP1", "PAERO1", "AEROS", "ECHOON", "ECHOOFF",
)  # fmt: skip
"""Cards that choose an analysis or its output; none changes masses, stiffnesses or surfaces."""


def read_deck(*paths: str | Path, instead: Mapping[str, str | Path] | None = None) -> Deck:
    """The structure and the aerodynamic surfaces of Nastran bulk data.

    Parameters
    ----------
    *paths : str or Path
        A deck, and further files of bulk data that it does not include.
    instead : mapping of str to (str or Path), optional
        Files that stand for included ones, by the name in the INCLUDE line.

    Returns
    -------
    Deck
        In the units of the deck.

    Raises
    ------
    FileFormatError
        If a card is unknown, a field damaged, a number given twice, or something refers to what is not there.
        Its message names file, line, card and field.
    """
    replaced = {name: Path(path) for name, path in (instead or {}).items()}
    return deck_of(read_cards(*(Path(path) for path in paths), instead=replaced))


def deck_of(cards: Iterable[Card]) -> Deck:
    """The deck that cards describe."""
    deck = Deck()
    later: dict[str, list[Card]] = {}
    for card in cards:
        if card.name in _PASSED_OVER:
            continue
        if card.name not in _READERS and card.name not in AERODYNAMIC_CARDS and card.name not in _IN_FRAMES:
            raise FileFormatError(
                card.place,
                got="a card that is not known here",
                allowed=", ".join(sorted({*_READERS, *_IN_FRAMES, *AERODYNAMIC_CARDS, *_PASSED_OVER})),
                remedy="take it out of the deck if modes do not depend on it",
            )
        later.setdefault(card.name, []).append(card)
    # frames before what stands in them, nodes before what refers to them
    for name in ("CORD2R", "GRID", *(name for name in _READERS if name not in ("CORD2R", "GRID"))):
        for card in later.get(name, []):
            (_IN_FRAMES | _READERS)[name](deck, card)
    complete_aerodynamics(deck, {name: later.get(name, []) for name in AERODYNAMIC_CARDS})
    return deck


def components(card: Card, field: int, default: str = "") -> tuple[int, ...]:
    """Digits 1 to 6 of a field as indices 0 to 5."""
    text = card.text(field, default)
    if not text or text == "0":
        return ()
    if not set(text) <= set("123456") or len(set(text)) != len(text):
        raise card.error(field, text, "digits of 123456, each once")
    return tuple(int(digit) - 1 for digit in text)


def _frame(deck: Deck, card: Card) -> None:
    reference = deck.frame(card.integer(3, 0), card.place)
    a, b, c = (
        reference.origin + reference.axes @ np.array(card.reals(first, 3)) for first in (4, 7, 10)
    )  # fmt: skip
    z, across = b - a, np.cross(b - a, c - a)
    if np.linalg.norm(z) == 0 or np.linalg.norm(across) <= 1e-9 * np.linalg.norm(z) * np.linalg.norm(c - a):
        raise FileFormatError(card.place, got="three points on one line", allowed="points that span a plane")
    z, y = z / np.linalg.norm(z), across / np.linalg.norm(across)
    put_once(deck.frames, card.identifier(2), Frame(a, np.stack([np.cross(y, z), y, z], axis=1)), card)


def _grid(deck: Deck, card: Card) -> None:
    frame = deck.frame(card.integer(3, 0), card.place)
    place = frame.origin + frame.axes @ np.array(card.reals(4, 3))
    held = card.integer(7, 0)
    deck.frame(held, card.place)
    put_once(deck.grids, card.identifier(2), Grid(place, held, components(card, 8)), card)


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


def _beam(deck: Deck, card: Card) -> None:
    ends = (card.identifier(4), card.identifier(5))
    offset_frames = card.text(9, "GGG").upper()
    if offset_frames != "GGG":
        raise card.error(9, offset_frames, "GGG")
    x1 = card.text(6, "")
    is_node = x1.isdigit() and not card.text(7, "") and not card.text(8, "")
    orientation = int(x1) if is_node else np.array(card.reals(6, 3))
    offsets = np.array([card.reals(12, 3), card.reals(15, 3)])
    beam = Beam(
        card.place,
        ends,
        (card.name.removeprefix("C"), card.integer(3, card.identifier(2))),
        orientation,
        (components(card, 10), components(card, 11)),
        offsets,
    )
    put_once(deck.beams, card.identifier(2), beam, card)


def _point_mass(deck: Deck, card: Card) -> None:
    grid, number = card.identifier(3), card.integer(4, 0)
    offset = np.array(card.reals(6, 3))
    frame = deck.frames[0] if number == -1 else deck.frame(number, card.place)
    arm = offset - deck.grid(grid, card.place).place if number == -1 else frame.axes @ offset
    i11, i21, i22, i31, i32, i33 = card.reals(10, 6)
    # products of inertia are stated positive and enter the matrix negative
    inertia = np.array([[i11, -i21, -i31], [-i21, i22, -i32], [-i31, -i32, i33]])
    mass = PointMass(card.place, grid, card.real(5, 0.0), arm, frame.axes @ inertia @ frame.axes.T)
    put_once(deck.masses, card.identifier(2), mass, card)


def _rigid(deck: Deck, card: Card) -> None:
    fields = list(card.fields)
    # a thermal expansion may stand last, told from a node by its point
    if len(fields) > 4 and "." in fields[-1]:
        fields.pop()
    nodes = Card(card.name, tuple(fields), card.file, card.line).listed(5)
    moved = components(card, 4)
    if not nodes or not moved:
        raise card.error(5, "no dependent node or component", "at least one")
    put_once(deck.rigid, card.identifier(2), RigidElement(card.place, card.identifier(3), moved, nodes), card)


def _ends(card: Card, first: int, second: int) -> tuple[tuple[int, int], ...]:
    ends = []
    for field in (first, second):
        number = card.integer(field, 0)
        if number:
            ends.append((number, components(card, field + 1)[0] if components(card, field + 1) else 0))
    if not ends:
        raise card.error(first, "no node", "at least one")
    return tuple(ends)


def _spring(deck: Deck, card: Card) -> None:
    spring = ScalarElement(card.place, card.real(3), _ends(card, 4, 6))
    put_once(deck.springs, card.identifier(2), spring, card)


def _spring_with_property(deck: Deck, card: Card) -> None:
    number = card.integer(3, card.identifier(2))
    if number not in deck.spring_constants:
        raise card.error(3, str(number), "the number of a PELAS")
    spring = ScalarElement(card.place, deck.spring_constants[number], _ends(card, 4, 6))
    put_once(deck.springs, card.identifier(2), spring, card)


def _spring_property(deck: Deck, card: Card) -> None:
    put_once(deck.spring_constants, card.identifier(2), card.real(3), card)


def _scalar_mass(deck: Deck, card: Card) -> None:
    mass = ScalarElement(card.place, card.real(3), _ends(card, 4, 6))
    put_once(deck.scalar_masses, card.identifier(2), mass, card)


def _bush(deck: Deck, card: Card) -> None:
    ends = tuple(number for number in (card.identifier(4), card.integer(5, 0)) if number)
    frame = card.integer(9) if card.text(9, "") else None
    x1, orientation = card.text(6, ""), None
    if x1:
        is_node = x1.isdigit() and not card.text(7, "")
        orientation = int(x1) if is_node else np.array(card.reals(6, 3))
    if any(card.text(field, "") for field in range(11, 15)):
        raise card.error(11, card.text(11, "an offset"), "blank: springs between their nodes")
    bush = Bush(
        card.place, ends, card.integer(3, card.identifier(2)), frame, orientation, card.real(10, 0.5)
    )  # fmt: skip
    put_once(deck.bushes, card.identifier(2), bush, card)


def _bush_property(deck: Deck, card: Card) -> None:
    kind = card.text(3, "K").upper()
    further = [text for text in card.fields[8:] if text]
    if kind != "K" or further:
        raise card.error(3, kind if kind != "K" else further[0], "K and six stiffnesses alone")
    put_once(deck.bush_stiffnesses, card.identifier(2), card.reals(4, 6), card)


def _constraint(deck: Deck, card: Card) -> None:
    held = deck.constraints.setdefault(card.identifier(2), [])
    if card.name == "SPC1":
        held.extend((node, components(card, 3)) for node in card.listed(4))
        return
    for first in (3, 6):
        if card.text(first, ""):
            if card.real(first + 2, 0.0) != 0:
                raise card.error(first + 2, card.text(first + 2), "0: a node that is held")
            held.append((card.identifier(first), components(card, first + 1)))


def _support(deck: Deck, card: Card) -> None:
    for first in range(2, len(card.fields) + 1, 2):
        deck.supported.extend((card.identifier(first), c) for c in components(card, first + 1))


def _parameter(deck: Deck, card: Card) -> None:
    deck.parameters[card.text(2).upper()] = card.text(3, "")


_IN_FRAMES: Final[dict[str, Callable[[Deck, Card], None]]] = {"CORD2R": _frame, "GRID": _grid}
_READERS: Final[dict[str, Callable[[Deck, Card], None]]] = {
    "MAT1": _material,
    **SECTION_CARDS,
    "CBAR": _beam,
    "CBEAM": _beam,
    "CONM2": _point_mass,
    "CMASS2": _scalar_mass,
    "RBE2": _rigid,
    "PELAS": _spring_property,
    "CELAS1": _spring_with_property,
    "CELAS2": _spring,
    "CBUSH": _bush,
    "PBUSH": _bush_property,
    "SPC": _constraint,
    "SPC1": _constraint,
    "SUPORT": _support,
    "PARAM": _parameter,
}
