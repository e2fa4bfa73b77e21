"""Cards of coordinate systems and nodes: CORD1R, C, S, CORD2R, C, S, GRID and GRDSET."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.bulk_data import Card, components, put_once
from sloshlab.aircraft.deck import Deck, Frame, Grid
from sloshlab.errors import FileFormatError

FloatArray = npt.NDArray[np.float64]
FRAME_CARDS: Final = ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S", "GRID", "GRDSET")
_LONGEST_CHAIN: Final = 100


def complete_places(deck: Deck, cards: Mapping[str, Sequence[Card]]) -> None:
    """Enter all coordinate systems and nodes; they may refer to each other in any order, but not in a circle."""
    places = _Places(deck, cards)
    for number in places.frame_cards:
        places.frame(number, "CORD", ())
    for number in places.grid_cards:
        places.grid(number, "GRID", ())
    for number, grid in deck.grids.items():
        deck.frame(grid.displacement_frame, places.grid_cards[number].place)


class _Places:
    def __init__(self, deck: Deck, cards: Mapping[str, Sequence[Card]]) -> None:
        self.deck = deck
        self.frame_cards: dict[int, tuple[Card, int]] = {}
        for name in FRAME_CARDS[:3]:
            for card in cards.get(name, ()):
                # two systems may stand on one card
                for first in (2, 6) if card.text(6, "") else (2,):
                    put_once(self.frame_cards, card.identifier(first), (card, first), card)
        for name in FRAME_CARDS[3:6]:
            for card in cards.get(name, ()):
                put_once(self.frame_cards, card.identifier(2), (card, 2), card)
        self.grid_cards: dict[int, Card] = {}
        for card in cards.get("GRID", ()):
            put_once(self.grid_cards, card.identifier(2), card, card)
        defaults = cards.get("GRDSET", ())
        if len(defaults) > 1:
            raise FileFormatError(defaults[1].place, got="a second GRDSET", allowed="one")
        self.defaults = defaults[0] if defaults else Card("GRDSET", (), "", 0)

    def frame(self, number: int, place: str, within: tuple[str, ...]) -> Frame:
        if number in self.deck.frames or number not in self.frame_cards:
            return self.deck.frame(number, place)
        card, first = self.frame_cards[number]
        within = _further(within, f"coordinate system {number}", card)
        if card.name.startswith("CORD1"):
            a, b, c = (
                self.grid(card.identifier(field), card.place, within).place
                for field in range(first + 1, first + 4)
            )
        else:
            reference = self.frame(card.integer(3, 0), card.place, within)
            a, b, c = (reference.to_basic(card.reals(field, 3)) for field in (4, 7, 10))
        self.deck.frames[number] = Frame(a, _axes(a, b, c, card), card.name[-1])
        return self.deck.frames[number]

    def grid(self, number: int, place: str, within: tuple[str, ...]) -> Grid:
        if number in self.deck.grids or number not in self.grid_cards:
            return self.deck.grid(number, place)
        card = self.grid_cards[number]
        within = _further(within, f"node {number}", card)
        frame = self.frame(card.integer(3, self.defaults.integer(3, 0)), card.place, within)
        if card.integer(9, self.defaults.integer(9, 0)) != 0:
            raise card.error(9, card.text(9, "a superelement"), "0: one model without superelements")
        held = components(card if card.text(8, "") else self.defaults, 8)
        axes = card.integer(7, self.defaults.integer(7, 0))
        self.deck.grids[number] = Grid(frame.to_basic(card.reals(4, 3)), axes, held)
        return self.deck.grids[number]


def _further(within: tuple[str, ...], what: str, card: Card) -> tuple[str, ...]:
    if what in within or len(within) >= _LONGEST_CHAIN:
        raise FileFormatError(
            card.place, got=f"{what} that refers to itself", allowed=f"no circle, ≤ {_LONGEST_CHAIN} in a row"
        )
    return (*within, what)


def _axes(a: FloatArray, b: FloatArray, c: FloatArray, card: Card) -> FloatArray:
    """Axes by the origin, a place on z and one in the plane of x and z."""
    z, across = b - a, np.cross(b - a, c - a)
    if np.linalg.norm(z) == 0 or np.linalg.norm(across) <= 1e-9 * np.linalg.norm(z) * np.linalg.norm(c - a):
        raise FileFormatError(card.place, got="three points on one line", allowed="points that span a plane")
    z, y = z / np.linalg.norm(z), across / np.linalg.norm(across)
    return np.stack([np.cross(y, z), y, z], axis=1)
