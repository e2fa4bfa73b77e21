"""Cards that tie components: RBE1, RBE2, RBE3, RBAR, RROD, MPC, SPC, SUPORT, ASET, OMIT."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from sloshlab.aircraft.bulk_data import Card, components, one_component, put_once, real_number
from sloshlab.aircraft.deck import Deck
from sloshlab.aircraft.deck_constraints import Component, Equation, RigidElement, RigidRod, WeightedMean


def _all_of(node: int, which: Sequence[int]) -> tuple[Component, ...]:
    return tuple((node, component) for component in which)


def _pairs(card: Card, fields: Sequence[int]) -> tuple[Component, ...]:
    """Components of nodes that stand in pairs of fields; blank pairs are left out."""
    found: list[Component] = []
    for field in fields:
        if card.text(field, ""):
            which = components(card, field + 1)
            if not which:
                raise card.error(field + 1, card.text(field + 1, ""), "digits of 123456")
            found.extend(_all_of(card.identifier(field), which))
    return tuple(found)


def _one_leader(deck: Deck, card: Card) -> None:
    fields = list(card.fields)
    # a thermal expansion may stand last, told from a node by its point
    if len(fields) > 4 and "." in fields[-1]:
        fields.pop()
    nodes = Card(card.name, tuple(fields), card.file, card.line).listed(5)
    moved = components(card, 4)
    if not nodes or not moved:
        raise card.error(5, "no dependent node or component", "at least one")
    leader = _all_of(card.identifier(3), range(6))
    followers = tuple(follower for node in nodes for follower in _all_of(node, moved))
    put_once(deck.rigid, card.identifier(2), RigidElement(card.place, leader, followers), card)


def _bar(deck: Deck, card: Card) -> None:
    ends = (card.identifier(3), card.identifier(4))
    independent = [_all_of(end, components(card, field)) for end, field in zip(ends, (5, 6), strict=True)]
    leaders = independent[0] + independent[1]
    if len(leaders) != 6:
        raise card.error(5, f"{len(leaders)} independent components", "6 at both ends together")
    followers = tuple(
        follower
        for end, field in zip(ends, (7, 8), strict=True)
        for follower in _all_of(end, components(card, field))
    )
    if not followers:
        followers = tuple(c for end in ends for c in _all_of(end, range(6)) if c not in leaders)
    put_once(deck.rigid, card.identifier(2), RigidElement(card.place, leaders, followers), card)


def _marked(card: Card, word: str) -> int | None:
    """Field of a word that begins a list, None where there is none."""
    at = [n + 2 for n, text in enumerate(card.fields) if text.upper() == word]
    return at[0] if at else None


def _with_list(deck: Deck, card: Card) -> None:
    """RBE1: six independent components, then UM and the dependent ones."""
    mark = _marked(card, "UM")
    if mark is None:
        raise card.error(2, "no UM", "UM and the dependent components")
    last = len(card.fields) + 1
    if last > mark and "." in card.text(last, ""):
        last -= 1  # a thermal expansion
    independent = _pairs(card, _pair_fields(3, mark - 1))
    if len(independent) != 6:
        raise card.error(3, f"{len(independent)} independent components", "6")
    dependent = _pairs(card, _pair_fields(mark + 1, last))
    put_once(deck.rigid, card.identifier(2), RigidElement(card.place, independent, dependent), card)


def _pair_fields(first: int, last: int) -> list[int]:
    """Fields where pairs begin: three to a line after its first field, which is blank in continuations."""
    fields, field = [], first
    while field <= last:
        column = (field - 2) % 8  # from 0 to 7 within the line
        if column in (0, 7):
            field += 1
            continue
        fields.append(field)
        field += 2
    return fields


def _rigid_rod(deck: Deck, card: Card) -> None:
    ends = (card.identifier(3), card.identifier(4))
    dependent = [_all_of(end, components(card, field)) for end, field in zip(ends, (5, 6), strict=True)]
    found = dependent[0] + dependent[1]
    if len(found) != 1 or found[0][1] > 2:
        raise card.error(5, f"{len(found)} dependent components", "one displacement")
    put_once(deck.rigid, card.identifier(2), RigidRod(card.place, ends, found[0]), card)


def _mean(deck: Deck, card: Card) -> None:
    ends = [mark for mark in (_marked(card, "UM"), _marked(card, "ALPHA")) if mark is not None]
    last = min(ends, default=len(card.fields) + 2) - 1
    reference = _all_of(card.identifier(4), components(card, 5))
    if not reference:
        raise card.error(5, card.text(5, ""), "digits of 123456")
    dependent = reference
    mark = _marked(card, "UM")
    if mark is not None:
        alpha = _marked(card, "ALPHA")
        dependent = _pairs(card, _pair_fields(mark + 1, (alpha or len(card.fields) + 2) - 1))
        if len(set(dependent)) != len(reference):
            raise card.error(mark, f"{len(dependent)} components after UM", f"{len(reference)}, as in field 5")
    mean = WeightedMean(card.place, reference, _weights(card, 6, last), dependent)
    put_once(deck.rigid, card.identifier(2), mean, card)


def _weights(card: Card, first: int, last: int) -> tuple[tuple[Component, float], ...]:
    """Groups of a weight, components and nodes; a weight is told from a node by its point."""
    weights: list[tuple[Component, float]] = []
    weight: float | None = None
    which: tuple[int, ...] = ()
    fields = [field for field in range(first, last + 1) if card.text(field, "")]
    at = 0
    while at < len(fields):
        field = fields[at]
        text = card.text(field)
        if not text.lstrip("+").isdigit():
            weight = real_number(text)
            if weight is None or weight <= 0:
                raise card.error(field, text, "a weight > 0, or a node")
            if at + 1 >= len(fields):
                raise card.error(field + 1, "", "components and nodes")
            which, at = components(card, fields[at + 1]), at + 2
            continue
        if weight is None or not which:
            raise card.error(field, text, "a weight with its point, and components, before nodes")
        weights.extend((component, weight) for component in _all_of(card.identifier(field), which))
        at += 1
    if not weights:
        raise card.error(first, "no node", "weights, components and nodes")
    return tuple(weights)


def _equation(deck: Deck, card: Card) -> None:
    # two terms to a line: node, component, coefficient
    fields = [8 * line + column for line in range(len(card.fields) // 8 + 1) for column in (3, 6)]
    terms = tuple(
        ((card.identifier(field), one_component(card, field + 1)), card.real(field + 2, 0.0))
        for field in fields
        if card.text(field, "")
    )
    if not terms or terms[0][1] == 0:
        raise card.error(5, "0", "a coefficient of the first component, which is eliminated")
    deck.equations.setdefault(card.identifier(2), []).append(Equation(card.place, terms))


def _sum_of_equations(deck: Deck, card: Card) -> None:
    put_once(deck.equation_sums, card.identifier(2), card.listed(3), card)


def _sum_of_constraints(deck: Deck, card: Card) -> None:
    put_once(deck.constraint_sums, card.identifier(2), card.listed(3), card)


def _nodes(deck: Deck, card: Card, first: int) -> list[int]:
    """Nodes of a list; those between the ends of a range need not exist."""
    found: list[int] = []
    for numbers in card.ranges(first):
        if len(numbers) == 1:
            deck.grid(numbers[0], card.place)
            found.append(numbers[0])
        elif len(numbers) < len(deck.grids):
            found.extend(number for number in numbers if number in deck.grids)
        else:
            found.extend(number for number in deck.grids if number in numbers)
    return found


def _constraint(deck: Deck, card: Card) -> None:
    held = deck.constraints.setdefault(card.identifier(2), [])
    if card.name == "SPC1":
        held.extend((node, components(card, 3)) for node in _nodes(deck, card, 4))
        return
    for first in (3, 6):
        if card.text(first, ""):
            if card.real(first + 2, 0.0) != 0:
                raise card.error(first + 2, card.text(first + 2), "0: a node that is held")
            held.append((card.identifier(first), components(card, first + 1)))


def _support(deck: Deck, card: Card) -> None:
    deck.supported.extend(_pairs(card, range(2, len(card.fields) + 2, 2)))


def _selected_support(deck: Deck, card: Card) -> None:
    deck.supports.setdefault(card.identifier(2), []).extend(_pairs(card, range(3, len(card.fields) + 2, 2)))


def _kept(deck: Deck, card: Card) -> None:
    """ASET, BSET, CSET, QSET and OMIT, and their second forms with one list of nodes."""
    into = deck.omitted if card.name.startswith("OMIT") else deck.kept
    if card.name.endswith("1"):
        which = components(card, 2)
        into.update(component for node in _nodes(deck, card, 3) for component in _all_of(node, which))
    else:
        into.update(_pairs(card, range(2, len(card.fields) + 2, 2)))


CONSTRAINT_CARDS: Final[dict[str, Callable[[Deck, Card], None]]] = {
    "RBE1": _with_list,
    "RBE2": _one_leader,
    "RBE3": _mean,
    "RBAR": _bar,
    "RROD": _rigid_rod,
    "MPC": _equation,
    "MPCADD": _sum_of_equations,
    "SPC": _constraint,
    "SPC1": _constraint,
    "SPCADD": _sum_of_constraints,
    "SUPORT": _support,
    "SUPORT1": _selected_support,
    **dict.fromkeys(("ASET", "ASET1", "BSET", "BSET1", "CSET", "CSET1", "QSET", "QSET1", "OMIT", "OMIT1"), _kept),
}
