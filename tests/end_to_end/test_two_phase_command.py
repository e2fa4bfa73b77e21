"""`sloshlab virtual --liquid two_phase`: on a structure, too; what cannot be is refused, and nothing is made."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_runs import refusal

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, SDOF_RIG
from pipelines.command_line import run as run_command
from sloshlab.recording import read_recording


def test_a_structure_carries_liquid_and_gas(tmp_path: Path) -> None:
    """At first the guided tank moves as if the liquid were frozen: −(K u₀ − F_c)/M cos ωt, M of all masses."""
    (tmp_path / "rig.toml").write_text(RIG_TEXTS[SDOF_RIG], encoding="utf-8")
    command = ["virtual", "sdof_free", "--rig", str(tmp_path / "rig.toml"), "--liquid", "two_phase"]
    output = tmp_path / "run.nc"
    assert run_command([*command, "--layers", "8", "--duration-s", "0.2", "-o", str(output)]) == 0
    run = read_recording(output)
    assert run.attrs["liquid"] == "two_phase_tank"
    assert run.sizes["time"] == 205
    mass_kg, used = 2.061 + 0.18, slice(5, 25)
    phase = math.sqrt(3808.8 / mass_kg) * run["time"].to_numpy()[used]
    expected = -(3808.8 * 0.064 - 0.37) / mass_kg * np.cos(phase)
    # viscous damping of 1.58 kg/s gives up to 1.6 m/s² here
    assert run["acceleration_tip"].to_numpy()[used] == pytest.approx(expected, abs=2.0)


@pytest.mark.parametrize(("layers", "told"), [("5", "cells over the height"), ("9000", "cells: got")])
def test_grids_that_cannot_be_are_refused(tmp_path: Path, capsys: Any, layers: str, told: str) -> None:
    (tmp_path / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    command = ["virtual", "shaker_sweep", "--rig", str(tmp_path / "rig.toml"), "--liquid", "two_phase"]
    output = tmp_path / "run.nc"
    refusal(capsys, [*command, "--layers", layers, "--duration-s", "5", "-o", str(output)], output, told)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--liquid", "two_phase", "--contact-angles", "50,80"], "receding ≤ advancing"),
        (["--liquid", "two_phase", "--contact-angles", "nan,nan"], "receding ≤ advancing"),
        (["--liquid", "two_phase", "--contact-angles", "80"], "advancing and receding angle"),
        (["--liquid", "numerical", "--contact-angles", "80,50"], "--liquid two_phase"),
    ],
)
def test_contact_angles_that_cannot_be_are_refused(
    tmp_path: Path, capsys: Any, more: list[str], told: str
) -> None:
    (tmp_path / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    output = tmp_path / "run.nc"
    command = ["virtual", "shaker_sweep", "--rig", str(tmp_path / "rig.toml"), "--duration-s", "5", *more]
    refusal(capsys, [*command, "-o", str(output)], output, told)


@pytest.mark.parametrize("experiment", ["campaign", "flight"])
def test_contact_angles_of_many_runs_are_refused(tmp_path: Path, capsys: Any, experiment: str) -> None:
    command = ["virtual", experiment, "--liquid", "two_phase", "--contact-angles", "80,50"]
    refusal(capsys, [*command, "-o", str(tmp_path / "made")], tmp_path / "made", "a single run")


def test_contact_angles_reach_the_computed_liquid(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG_TEXTS[SDOF_RIG], encoding="utf-8")
    command = ["virtual", "sdof_free", "--rig", str(tmp_path / "rig.toml"), "--liquid", "two_phase"]
    command += ["--layers", "8", "--duration-s", "0.2"]
    forces = []
    for name, more in (("free", []), ("sticks", ["--contact-angles", "80,50"])):
        assert run_command([*command, *more, "-o", str(tmp_path / f"{name}.nc")]) == 0
        run = read_recording(tmp_path / f"{name}.nc")
        angles = [run.attrs.get(f"{which}_angle_deg") for which in ("advancing", "receding")]
        assert angles == ([80.0, 50.0] if more else [None, None])
        forces.append(run["acceleration_tip"].to_numpy())
    assert np.abs(forces[1] - forces[0]).max() > 0
