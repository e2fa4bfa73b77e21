"""Decks made line by line in the tests."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from sloshlab.aircraft.deck import Deck
from sloshlab.aircraft.deck_reader import read_deck


def _text(value: object) -> str:
    """At most eight characters, exponents without e."""
    if value is None:
        return ""
    if isinstance(value, float):
        value = f"{value:.3e}" if value and not 1e-3 <= abs(value) < 1e5 else f"{value:.6g}"
        value = re.sub(r"e([+-])0*(\d)", r"\1\2", value) if "e" in value else value
        value = value if "." in value else f"{value}."
    assert len(str(value)) <= 8, value
    return str(value)


def fields(name: str, *values: object) -> str:
    """A card in fields of eight columns, continued as long as needed."""
    texts = [_text(value) for value in values]
    lines = []
    for first in range(0, max(len(texts), 1), 8):
        head = name if first == 0 else "+"
        lines.append("".join(text.ljust(8) for text in (head, *texts[first : first + 8])).rstrip())
    return "\n".join(lines)


def deck_of_text(folder: Path, *cards: str) -> Deck:
    path = folder / "deck.dat"
    path.write_text("\n".join(cards) + "\n")
    return read_deck(path)


E, G, RHO = 7.0e10, 2.7e10, 2700.0


def beam_cards(
    n_elements: int = 10, length: float = 2.0, *, kind: str = "CBAR", section: Sequence[object] = ()
) -> list[str]:
    """A straight beam along y of a 20 × 10 mm section with its stiff plane upright, node 1 at the root."""
    cards = [fields("MAT1", 1, E, G, None, RHO)]
    if kind == "CBAR":
        cards.append(fields("PBAR", 1, 1, *(section or (2e-4, 6.667e-9, 1.667e-9, 5e-9))))
    else:
        cards.append(fields("PBEAM", 1, 1, *(section or (2e-4, 6.667e-9, 1.667e-9, None, 5e-9))))
    for node in range(n_elements + 1):
        place = length * node / n_elements
        cards.append(fields("GRID", node + 1, None, 0.0, f"{place:.5f}", 0.0))
    for number in range(n_elements):
        cards.append(fields(kind, number + 1, 1, number + 1, number + 2, 0.0, 0.0, 1.0))
    return cards
