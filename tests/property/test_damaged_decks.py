"""Decks with slips of the keyboard: read as a structure, or refused in one line, and nothing else."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from hand_made_decks import beam_cards, fields
from hypothesis import given, settings
from hypothesis import strategies as st
from number_of_examples import examples

from sloshlab.aircraft.deck_reader import read_deck
from sloshlab.aircraft.structure import structure_of_deck
from sloshlab.errors import SloshlabError

LINES = "\n".join(
    [
        *beam_cards(3, kind="CBEAM"),
        fields("CORD2R", 5, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
        fields("CONM2", 90, 3, 5, 0.4, 0.1, 0.0, 0.05, None, 0.02, 0.001, 0.03, 0.0, 0.0, 0.02),
        fields("GRID", 9, 5, 0.1, 2.0, 0.05),
        fields("RBE2", 40, 4, 123456, 9),
        fields("CAERO1", 100, 1, None, 2, 3, None, None, 1, -0.1, 0.0, 0.0, 0.3, -0.1, 2.0, 0.0, 0.2),
        fields("SPLINE4", 3, 100, 4, None, 5),
        fields("AELIST", 4, 100, "THRU", 105),
        fields("SET1", 5, 1, 3, 4),
        fields("SUPORT", 1, 123456),
    ]
).split("\n")
SLIPS = st.tuples(
    st.integers(0, len(LINES) - 1),
    st.integers(0, 9),
    st.sampled_from(
        ["", "0", "0.", "1.+30", "-1.+30", "1.-30", "99999999", "1.2.3", "THRU", "+", "*", "$", ",", "1 2"]
    ),
)


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(SLIPS, min_size=1, max_size=3), st.sets(st.integers(0, len(LINES) - 1), max_size=1))
def test_a_slip_is_refused_in_one_line_or_harmless(slips: list[tuple[int, int, str]], lost: set[int]) -> None:
    lines = list(LINES)
    for line, field, text in slips:
        padded = lines[line].ljust(80)
        lines[line] = (padded[: 8 * field] + text.ljust(8) + padded[8 * field + 8 :]).rstrip()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "deck.bdf"
        path.write_text("\n".join(text for n, text in enumerate(lines) if n not in lost))
        try:
            structure = structure_of_deck(read_deck(path), length_m=1.0, mass_kg=1.0, n_modes=8)
        except SloshlabError as error:
            n_lines = str(error).count("\n") + 1
        else:
            n_lines = 1
            assert structure.frequencies_hz.min() > 0
        assert n_lines == 1
