"""From cards to a deck: which cards are understood, which say nothing about modes, and refusal of all others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from sloshlab.aircraft.aerodynamic_cards import AERODYNAMIC_CARDS, complete_aerodynamics
from sloshlab.aircraft.bulk_data import Card, cards_of
from sloshlab.aircraft.bulk_lines import read_lines
from sloshlab.aircraft.cards_passed_over import PASSED_OVER
from sloshlab.aircraft.case_control import CaseControl, case_control_of
from sloshlab.aircraft.constraint_cards import CONSTRAINT_CARDS
from sloshlab.aircraft.deck import Deck
from sloshlab.aircraft.element_cards import ELEMENT_CARDS, LINE_CARDS, complete_lines
from sloshlab.aircraft.frame_cards import FRAME_CARDS, complete_places
from sloshlab.aircraft.section_cards import SECTION_CARDS
from sloshlab.errors import FileFormatError

_ABOUT_MASS: Final = ("WTMASS", "COUPMASS")


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
    lines = read_lines(*(Path(path) for path in paths), instead=replaced)
    return deck_of(cards_of(lines.bulk), case_control_of(lines.control))


def deck_of(cards: Iterable[Card], case: CaseControl | None = None) -> Deck:
    """The deck that cards describe, with what the case control section selects."""
    case = case or CaseControl()
    deck = Deck(parameters=dict(case.parameters), selections=dict(case.selections))
    by_name: dict[str, list[Card]] = {}
    for card in cards:
        if card.name not in _KNOWN:
            raise FileFormatError(
                card.place,
                got="a card that is not known here",
                allowed="the cards that docs/aircraft.md lists",
                remedy="take it out of the deck if modes do not depend on it",
            )
        if card.name not in PASSED_OVER:
            by_name.setdefault(card.name, []).append(card)
    # places before what stands at them, properties before elements
    complete_places(deck, by_name)
    for name, read in _READERS.items():
        for card in by_name.get(name, []):
            read(deck, card)
    complete_lines(deck, by_name)
    complete_aerodynamics(deck, {name: by_name.get(name, []) for name in AERODYNAMIC_CARDS})
    return deck


def _parameter(deck: Deck, card: Card) -> None:
    """PARAM; where a name stands twice, the first counts, and masses must not be in doubt."""
    name, value = card.text(2).upper(), card.text(3, "")
    first = deck.parameters.setdefault(name, value)
    if name in _ABOUT_MASS and first != value:
        raise FileFormatError(card.place, got=f"{name} {value[:20]} after {first[:20]}", allowed="one value")


def _method(deck: Deck, card: Card) -> None:
    """EIGR and EIGRL; how modes are found, and within which range, is left to the solver here."""
    number = card.integer(5 if card.name == "EIGRL" else 7, 0)
    if number > 0:
        deck.method_modes[card.identifier(2)] = number


_READERS: Final[dict[str, Callable[[Deck, Card], None]]] = {
    "PARAM": _parameter,
    "EIGR": _method,
    "EIGRL": _method,
    **SECTION_CARDS,
    **ELEMENT_CARDS,
    **CONSTRAINT_CARDS,
}
_KNOWN: Final = frozenset((*_READERS, *FRAME_CARDS, *LINE_CARDS, *AERODYNAMIC_CARDS, *PASSED_OVER))
