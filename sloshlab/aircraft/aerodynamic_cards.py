"""Cards of aerodynamic surfaces and of what moves them: CAERO1, AEFACT, SPLINE4, AELIST, SET1, AERO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sloshlab.aircraft.bulk_data import Card, put_once
from sloshlab.aircraft.deck import AerodynamicReference, Deck, Panel, SurfaceSpline
from sloshlab.errors import FileFormatError

AERODYNAMIC_CARDS: Final = ("AEFACT", "CAERO1", "AELIST", "SET1", "SPLINE4", "AERO")
_MOST_BOXES: Final = 100_000


def complete_aerodynamics(deck: Deck, cards: Mapping[str, Sequence[Card]]) -> None:
    """Enter panels, splines and the reference of a deck whose frames and nodes are known."""
    factors = {number: card for number, card in _numbered(cards["AEFACT"]).items()}
    lists = {name: _numbered(cards[name]) for name in ("AELIST", "SET1")}
    for card in cards["CAERO1"]:
        panel = _panel(deck, card, factors)
        put_once(deck.panels, panel.number, panel, card)
    for card in cards["SPLINE4"]:
        put_once(deck.splines, card.identifier(2), _spline(deck, card, lists), card)
    for card in cards["AERO"]:
        if deck.reference is not None:
            raise FileFormatError(card.place, got="a second AERO", allowed="one")
        deck.reference = AerodynamicReference(card.real(4), card.real(5))


def _numbered(cards: Sequence[Card]) -> dict[int, Card]:
    table: dict[int, Card] = {}
    for card in cards:
        put_once(table, card.identifier(2), card, card)
    return table


def _edges(card: Card, count_field: int, list_field: int, factors: Mapping[int, Card]) -> tuple[float, ...]:
    """Edges of boxes, by their number or by a list."""
    count = card.integer(count_field, 0)
    if count:
        if not 1 <= count <= _MOST_BOXES:
            raise card.error(count_field, str(count), f"1 … {_MOST_BOXES}")
        return tuple(float(edge) for edge in np.linspace(0.0, 1.0, count + 1))
    number = card.integer(list_field, 0)
    if number not in factors:
        raise card.error(
            list_field, str(number) if number else "", "the number of an AEFACT, or a number of boxes"
        )
    factor = factors[number]
    edges = tuple(factor.real(field) for field in range(3, len(factor.fields) + 2))
    if len(edges) < 2 or edges[0] != 0 or edges[-1] != 1 or min(np.diff(edges)) <= 0:
        raise FileFormatError(factor.place, got=f"edges of {card.place}", allowed="0 to 1, rising")
    return edges


def _panel(deck: Deck, card: Card, factors: Mapping[int, Card]) -> Panel:
    frame = deck.frame(card.integer(4, 0), card.place)
    ends = [frame.origin + frame.axes @ np.array(card.reals(first, 3)) for first in (10, 14)]
    chords = card.real(13), card.real(17)
    if min(chords) < 0 or max(chords) == 0 or np.linalg.norm((ends[1] - ends[0])[1:]) == 0:
        raise FileFormatError(card.place, got="no span or no chord", allowed="a surface")
    first, second = ((float(e[0]), float(e[1]), float(e[2])) for e in ends)
    return Panel(
        card.identifier(2), first, second, chords[0], chords[1],
        _edges(card, 5, 7, factors), _edges(card, 6, 8, factors),
    )  # fmt: skip


def _spline(deck: Deck, card: Card, lists: Mapping[str, Mapping[int, Card]]) -> SurfaceSpline:
    panel, boxes, nodes = card.identifier(3), card.identifier(4), card.identifier(6)
    if panel not in deck.panels:
        raise card.error(3, str(panel), "the number of a CAERO1")
    for name, field, number in (("AELIST", 4, boxes), ("SET1", 6, nodes)):
        if number not in lists[name]:
            raise card.error(field, str(number), f"the number of an {name}")
    method = card.text(8, "IPS").upper()
    if method not in ("IPS", "TPS"):
        raise card.error(8, method, "IPS or TPS")
    of_nodes = lists["SET1"][nodes].listed(3)
    for node in of_nodes:
        deck.grid(node, lists["SET1"][nodes].place)
    listed = lists["AELIST"][boxes].listed(3)
    known = {(p.number, p.number + p.n_boxes) for p in deck.panels.values()}
    strange = [box for box in listed if not any(low <= box < high for low, high in known)]
    if strange:
        raise FileFormatError(
            lists["AELIST"][boxes].place, got=f"box {strange[0]}", allowed="boxes of the deck's CAERO1"
        )
    return SurfaceSpline(card.identifier(2), panel, listed, of_nodes, method)
