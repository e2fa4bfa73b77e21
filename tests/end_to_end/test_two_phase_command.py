"""`sloshlab virtual --liquid two_phase`: what has no such liquid is refused in one line, nothing is made."""

from pathlib import Path
from typing import Any

import pytest
from short_runs import refusal

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, SDOF_RIG


def test_a_structure_carries_particles_only(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "rig.toml").write_text(RIG_TEXTS[SDOF_RIG], encoding="utf-8")
    command = ["virtual", "sdof_free", "--rig", str(tmp_path / "rig.toml"), "--liquid", "two_phase"]
    output = tmp_path / "run.nc"
    refusal(capsys, [*command, "-o", str(output)], output, "two_phase for sdof_free", "take numerical")


def test_a_campaign_on_structures_has_no_such_liquid(tmp_path: Path, capsys: Any) -> None:
    output = tmp_path / "folder"
    command = ["virtual", "campaign", "--liquid", "two_phase", "--only", "beam/*", "-o", str(output)]
    refusal(capsys, command, output, "--only: got 'beam/*'")


@pytest.mark.parametrize(("layers", "told"), [("5", "cells over the height"), ("9000", "cells: got")])
def test_grids_that_cannot_be_are_refused(tmp_path: Path, capsys: Any, layers: str, told: str) -> None:
    (tmp_path / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    command = ["virtual", "shaker_sweep", "--rig", str(tmp_path / "rig.toml"), "--liquid", "two_phase"]
    output = tmp_path / "run.nc"
    refusal(capsys, [*command, "--layers", layers, "--duration-s", "5", "-o", str(output)], output, told)
