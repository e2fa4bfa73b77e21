"""Cases of the numerical tank: what is believed of the liquid is in the rig, recordings are copied."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from pipelines.tank_diagnosis import CASES, TankCase, make_case
from sloshlab.errors import InputError

RECORDINGS = "raw_data/numerical_tank"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_has_its_recordings_and_what_is_believed(case: TankCase, repository: Path, tmp_path: Path) -> None:
    folder = tmp_path / case.name
    make_case(repository / RECORDINGS, case, folder)
    believed = tomllib.loads((folder / "rig.toml").read_text())["twin"]["tank_model"]
    assert believed == ("viscous" if "viscous" in case.name else "frozen")
    assert len(list((folder / "recordings").glob("*.nc"))) >= 3
    assert sorted(path.name for path in folder.iterdir()) == ["recordings", "rig.toml"]


def test_recordings_that_are_not_there_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="numerical tank"):
        make_case(tmp_path, CASES[0], tmp_path / "case")
    assert not (tmp_path / "case").exists()
