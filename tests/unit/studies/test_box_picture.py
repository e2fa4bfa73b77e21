"""The picture of the box: which cuts it has, and that it is drawn from a checkpoint."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_box import checkpoint
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_box.simulation import TwoPhaseBox
from acquisition.two_phase_tank.setup import filled_two_phase_tank
from studies.two_phase_verification import box_picture


def test_cuts_go_through_the_middle_and_the_view_is_from_above() -> None:
    fraction = np.zeros((4, 6, 2))
    fraction[1, 3, 0] = fraction[2, 5, 1] = 1.0
    along, across, above = box_picture.cuts(fraction)
    assert np.argwhere(along).tolist() == [[1, 0]]
    assert np.argwhere(across).tolist() == [[5, 1]]
    assert {tuple(place): above[tuple(place)] for place in np.argwhere(above)} == {(1, 3): 0.5, (2, 5): 0.5}


def test_a_checkpoint_is_drawn(tmp_path: Path) -> None:
    run, picture = tmp_path / "run", tmp_path / "box.png"
    checkpoint.save(TwoPhaseBox(TwoPhaseBoxSetup(filled_two_phase_tank(Box(0.04, 0.03, 0.03), 0.5, 8))), run)
    assert box_picture.main([str(run), str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_what_is_no_checkpoint_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, picture = tmp_path / "run.checkpoint", tmp_path / "box.png"
    run.write_bytes(b"nothing of the kind")
    assert box_picture.main([str(run), str(picture)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not picture.exists()
