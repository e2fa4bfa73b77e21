"""mAEWing1 (University of Minnesota): own modes against those of its authors by Nastran."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sloshlab.aircraft.assembly import assembled
from sloshlab.aircraft.deck import Deck
from sloshlab.aircraft.deck_reader import read_deck
from sloshlab.aircraft.normal_modes import normal_modes

pytestmark = pytest.mark.external
INSTEAD = {f"{name}_mAEWing1_updated.dat": f"{name}_mAEWing1.dat" for name in ("CAERO", "Spline4")}


@pytest.fixture(scope="module")
def folder(external_data: Path) -> Path:
    if not (external_data / "maewing1" / "sol103_mAEWing1.bdf").is_file():
        pytest.skip("no maewing1 among the recordings of other laboratories")
    return external_data / "maewing1"


def read(folder: Path, name: str) -> Deck:
    return read_deck(folder / name, instead={name: folder / there for name, there in INSTEAD.items()})


def printed_frequencies(path: Path) -> np.ndarray:
    """Cycles of the first 20 rows of the table of eigenvalues."""
    rows = re.findall(
        r"^ +(\d+) +\d+ +(\S+) +(\S+) +(\S+) +1\.000000E\+00", path.read_text(encoding="latin-1"), re.MULTILINE
    )
    return np.array([float(cycles) for *_, cycles in rows[:20]])


@pytest.mark.parametrize(("deck", "printed"), [("sol103_mAEWing1.bdf", "sol103_maewing1.f06"),
                                               ("sol145_mAEWing1.bdf", "sol145_maewing1.f06")])  # fmt: skip
def test_twenty_modes_as_printed(folder: Path, deck: str, printed: str) -> None:
    """Masses at the nodes in one deck, along the beams in the other; printed to seven digits."""
    expected = printed_frequencies(folder / printed)
    assert expected.size == 20
    found = normal_modes(read(folder, deck)).frequencies_hz
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_weights_as_printed(folder: Path) -> None:
    deck = read(folder, "sol103_mAEWing1.bdf")
    weights = assembled(deck).rigid_mass(deck.grids[18888].place)
    assert weights[0, 0] == pytest.approx(14.73628, abs=5e-6)
    assert np.diag(weights)[3:] == pytest.approx([10816.17, 1845.372, 10826.71], abs=6e-3)
    assert weights[3, 4] == pytest.approx(-3.771428, abs=5e-6)


def test_all_boxes_are_there(folder: Path) -> None:
    deck = read(folder, "sol145_mAEWing1.bdf")
    assert sum(panel.n_boxes for panel in deck.panels.values()) == 2652
    assert len({box for spline in deck.splines.values() for box in spline.boxes}) == 2652
