"""Decks with ties, curved axes, tapers and case control, and slips of the keyboard: one line, or a structure."""

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
        "SOL 103", "CEND", "SPC = 9", "MPC = 7", "METHOD=3", "SUBCASE 1", "BEGIN BULK",
        *beam_cards(3, kind="CBEAM", section=(2e-4, 7e-9, 2e-9, None, 5e-9, None, "NO", 1.0, 1e-4)),
        fields("CORD2C", 5, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
        fields("CORD1S", 6, 1, 2, 9), fields("GRDSET", None, None, None, None, None, 5),
        fields("GRID", 9, 5, 0.5, 30.0, 0.2, 6), fields("GRID", 10, 6, 0.5, 30.0, 40.0),
        fields("GRID", 11, None, 0.3, 0.4, 0.1, 5), fields("GRID", 12, None, -0.3, 0.4, 0.1, 5),
        fields("RBE3", 40, None, 9, 123456, 1.0, 123, 1, 3, 4, 2.0, 123456, 2),
        fields("RBAR", 41, 4, 10, 123456), fields("RBE1", 43, 2, 123456, *[None] * 5, "UM", 12, 123456),
        *(fields("MPC", 7, 11, c, 1.0, 3, c, -1.0, None, None, 2, c, 0.2) for c in (1, 2, 3, 4, 5, 6)),
        *(fields("CONM2", n, n, 5, 0.4, 0.1, 0.0, 0.05, None, 0.02, 0.001, 0.03, 0.0, 0.0, 0.02) for n in (9, 10)),
        fields("CONM1", 91, 11, 0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0),
        fields("PBARL", 8, 1, None, "BOX", *[None] * 4, 0.04, 0.03, 0.001, 0.002),
        fields("CBAR", 80, 8, 2, 9, 0.0, 1.0, 3.0, "GOG", 4, 56, 0.1), fields("CONROD", 81, 3, 12, 1, 1e-4, 1e-9),
        fields("CAERO1", 100, 1, 5, 2, 3, None, None, 1, 0.1, 0.0, 0.0, 0.3, 2.1, 70.0, 0.0, 0.2),
        fields("SPLINE1", 3, 100, 100, 105, 5), fields("SPLINE2", 4, 100, 101, 104, 5),
        fields("SET1", 5, 1, "THRU", 4),
        fields("SPC1", 9, 123456, 1), fields("EIGRL", 3, None, None, 4), fields("ASET1", 123, 2, "THRU", 4),
    ]
).split("\n")  # fmt: skip
SLIPS = st.tuples(
    st.integers(0, len(LINES) - 1),
    st.integers(0, 9),
    st.sampled_from(
        [
            "",
            "0",
            "0.",
            "1",
            "5",
            "9",
            "1.+30",
            "-1.+30",
            "1.-30",
            "99999999",
            "123456",
            "1.2.3",
            "THRU",
            "UM",
            "+",
            "*",
        ]
    ),
)


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(SLIPS, min_size=0, max_size=3), st.sets(st.integers(0, len(LINES) - 1), max_size=1))
def test_a_slip_is_refused_in_one_line_or_harmless(slips: list[tuple[int, int, str]], lost: set[int]) -> None:
    lines = list(LINES)
    for line, field, text in slips:
        padded = lines[line].ljust(80)
        lines[line] = (padded[: 8 * field] + text.ljust(8) + padded[8 * field + 8 :]).rstrip()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "deck.bdf"
        path.write_text("\n".join(text for n, text in enumerate(lines) if n not in lost))
        try:
            structure = structure_of_deck(read_deck(path), length_m=1.0, mass_kg=1.0, n_modes=6)
        except SloshlabError as error:
            n_lines = str(error).count("\n") + 1
        else:
            n_lines = 1
            assert structure.frequencies_hz.min() > 0
        assert n_lines == 1


def test_the_deck_without_slips_is_read() -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "deck.bdf"
        path.write_text("\n".join(LINES))
        structure = structure_of_deck(read_deck(path), length_m=1.0, mass_kg=1.0, n_modes=6)
    assert structure.n_modes == 6
