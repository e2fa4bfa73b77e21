"""Cards of aerodynamic surfaces and of what moves them.

CAERO1 with AEFACT; SPLINE1, 2, 4 and 5 with AELIST, SET1 and SET2; AERO.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sloshlab.aircraft.bulk_data import Card, put_once
from sloshlab.aircraft.deck import AerodynamicReference, Deck, Panel, SurfaceSpline
from sloshlab.errors import FileFormatError

AERODYNAMIC_CARDS: Final = (
    "AEFACT", "CAERO1", "AELIST", "SET1", "SET2", "SPLINE1", "SPLINE2", "SPLINE4", "SPLINE5", "AERO",
)  # fmt: skip
_MOST_BOXES: Final = 100_000
_MOST_LISTED: Final = 1_000_000


def complete_aerodynamics(deck: Deck, cards: Mapping[str, Sequence[Card]]) -> None:
    """Enter panels, splines and the reference of a deck whose frames and nodes are known."""
    factors = _numbered(cards["AEFACT"])
    lists = {name: _numbered(cards[name]) for name in ("AELIST", "SET1", "SET2")}
    for card in cards["CAERO1"]:
        panel = _panel(deck, card, factors)
        put_once(deck.panels, panel.number, panel, card)
    _require_own_numbers(deck, cards["CAERO1"])
    n_listed = 0
    for name in ("SPLINE1", "SPLINE2", "SPLINE4", "SPLINE5"):
        for card in cards[name]:
            spline = _spline(deck, card, lists)
            n_listed += len(spline.boxes) + len(spline.nodes)
            if n_listed > _MOST_LISTED:
                raise FileFormatError(
                    card.place, got=f"{n_listed} boxes and nodes of splines", allowed=f"≤ {_MOST_LISTED}"
                )
            put_once(deck.splines, spline.number, spline, card)
    for card in cards["AERO"]:
        if deck.reference is not None:
            raise FileFormatError(card.place, got="a second AERO", allowed="one")
        _require_whole_in_basic_flow(deck, card)
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
    ends = [frame.to_basic(card.reals(first, 3)) for first in (10, 14)]
    chords = card.real(13), card.real(17)
    if min(chords) < 0 or max(chords) == 0 or np.linalg.norm((ends[1] - ends[0])[1:]) == 0:
        raise FileFormatError(card.place, got="no span or no chord", allowed="a surface")
    first, second = ((float(e[0]), float(e[1]), float(e[2])) for e in ends)
    panel = Panel(
        card.identifier(2), first, second, chords[0], chords[1],
        _edges(card, 5, 7, factors), _edges(card, 6, 8, factors),
    )  # fmt: skip
    if panel.n_boxes > _MOST_BOXES:
        raise FileFormatError(card.place, got=f"{panel.n_boxes} boxes", allowed=f"≤ {_MOST_BOXES}")
    return panel


def _require_own_numbers(deck: Deck, cards: Sequence[Card]) -> None:
    """Boxes are numbered on from their panel, and no number stands for two of them."""
    if sum(panel.n_boxes for panel in deck.panels.values()) > _MOST_LISTED:
        raise FileFormatError(cards[-1].place, got="too many boxes", allowed=f"≤ {_MOST_LISTED} in all")
    after = 0
    for number, panel in sorted(deck.panels.items()):
        place = next(card.place for card in cards if card.identifier(2) == number)
        if number < after or number + panel.n_boxes > 2**31:
            raise FileFormatError(place, got=f"box {number} a second time", allowed="numbers of their own")
        after = number + panel.n_boxes


def _require_whole_in_basic_flow(deck: Deck, card: Card) -> None:
    """AERO: flow along basic x, and both halves of the aircraft as surfaces."""
    axes = deck.frame(card.integer(2, 0), card.place).axes
    if not np.allclose(axes[:, 0], [1.0, 0.0, 0.0], atol=1e-6):
        raise card.error(2, card.text(2), "a coordinate system whose x is that of the basic one")
    for field in (6, 7):
        if card.integer(field, 0) != 0:
            raise card.error(field, card.text(field), "0: all surfaces in the deck, none by symmetry")


def _spline(deck: Deck, card: Card, lists: Mapping[str, Mapping[int, Card]]) -> SurfaceSpline:
    """Any spline as boxes that follow nodes; the beams of SPLINE2 and 5 by their nodes alone."""
    panel = card.identifier(3)
    if panel not in deck.panels:
        raise card.error(3, str(panel), "the number of a CAERO1")
    if card.name in ("SPLINE1", "SPLINE2"):
        boxes = _boxes_between(deck, card)
    else:
        boxes = _listed_boxes(deck, card, lists["AELIST"])
    nodes = _nodes(deck, card, 6, lists)
    for field, text in enumerate(card.fields[6:], start=8):
        if text.upper() in ("FORCE", "DISP"):
            raise card.error(field, text, "BOTH: one spline for forces and displacements")
    method = "IPS"
    if card.name in ("SPLINE1", "SPLINE4"):
        method = card.text(8, "IPS").upper()
        if method not in ("IPS", "TPS"):
            raise card.error(8, method, "IPS or TPS")
    return SurfaceSpline(card.identifier(2), panel, boxes, nodes, method)


def _boxes_between(deck: Deck, card: Card) -> tuple[int, ...]:
    """The rectangle of boxes from its first to its last corner; boxes are numbered along the chord first."""
    panel = deck.panels[card.identifier(3)]
    first, last = card.identifier(4), card.identifier(5)
    along = len(panel.chordwise) - 1
    if not panel.number <= first <= last < panel.number + panel.n_boxes:
        raise card.error(4, f"{first} … {last}", f"boxes {panel.number} … {panel.number + panel.n_boxes - 1}")
    strips, chords = zip(*(divmod(box - panel.number, along) for box in (first, last)), strict=True)
    if chords[1] < chords[0]:
        raise card.error(5, str(last), "a box not ahead of the first one")
    return tuple(
        panel.number + along * strip + chord
        for strip in range(strips[0], strips[1] + 1)
        for chord in range(chords[0], chords[1] + 1)
    )


def _listed_boxes(deck: Deck, card: Card, lists: Mapping[int, Card]) -> tuple[int, ...]:
    number = card.identifier(4)
    if number not in lists:
        raise card.error(4, str(number), "the number of an AELIST")
    listed = lists[number].listed(3)
    known = sorted((p.number, p.number + p.n_boxes) for p in deck.panels.values())
    starts = [low for low, _ in known]
    for box in listed:
        at = bisect_right(starts, box) - 1
        if at < 0 or box >= known[at][1]:
            raise FileFormatError(lists[number].place, got=f"box {box}", allowed="boxes of the deck's CAERO1")
    return listed


def _nodes(deck: Deck, card: Card, field: int, lists: Mapping[str, Mapping[int, Card]]) -> tuple[int, ...]:
    number = card.identifier(field)
    if number in lists["SET2"]:
        raise FileFormatError(lists["SET2"][number].place, got="nodes by a volume", allowed="nodes by a SET1")
    if number not in lists["SET1"]:
        raise card.error(field, str(number), "the number of a SET1")
    nodes = tuple(dict.fromkeys(lists["SET1"][number].listed(3)))
    for node in nodes:
        deck.grid(node, lists["SET1"][number].place)
    return nodes
