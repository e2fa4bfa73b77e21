"""`sloshlab ball` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import xarray as xr
from progress_lines import without_progress

from pipelines.ball import decay_stages
from pipelines.command_line import run
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import simulated_decay
from sloshlab.recording import write_recording
from sloshlab.rig import Rig

RATE_HZ = 800.0
RIG = """
[tank]
height_m = 0.06
length_m = 0.10
width_m = 0.06
dry_mass_kg = 2.061
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
coulomb_force_n = 0.37
damping_kg_per_s = 1.58
"""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(RIG, encoding="utf-8")
    return path


def write_decay(
    path: Path,
    acceleration: npt.NDArray[np.float64],
    force: npt.NDArray[np.float64] | None = None,
    **attributes: object,
) -> Path:
    signals = {"acceleration_tip": (acceleration, "m s-2", "acceleration")}
    if force is not None:
        signals["force_interface"] = (force, "N", "force")
    variables = {
        name: ("time", values, {"units": units, "quantity": quantity})
        for name, (values, units, quantity) in signals.items()
    }
    time = ("time", np.arange(acceleration.size) / RATE_HZ, {"units": "s"})
    attrs = {
        "sloshlab_format": "1", "run_id": path.stem, "experiment": "sdof_free", "configuration": "sloshing",
        "rig": "rig.toml", "sampling_rate_hz": RATE_HZ, "start_time_utc": "2026-01-31T12:00:00Z",
        "initial_displacement_m": 0.03, **attributes,
    }  # fmt: skip
    write_recording(xr.Dataset(variables, coords={"time": time}, attrs=attrs), path)
    return path


def ball_decay(duration_s: float = 2.5) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The ball of Table 2.2, released from 30 mm."""
    ball = BouncingBall(0.0244, 1103.0, 13.04, 74.04, 0.0017)
    decay = simulated_decay(ball, Rig.from_toml_text(RIG), 0.03, duration_s, sampling_rate_hz=RATE_HZ)
    return decay.acceleration_m_per_s2, decay.interface_force_n


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert run([str(argument) for argument in arguments]) == 1
    [line] = without_progress(capsys.readouterr().err).strip().splitlines()
    return line


def test_files_of_a_decay(
    tmp_path: Path, rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = decay_stages._response  # half of the time, and no file of the results is about it alone
    monkeypatch.setattr(decay_stages, "_response", lambda ball, rig, n_map: whole(ball, rig, n_map // 5))
    recording = write_decay(tmp_path / "decay.nc", *ball_decay(1.0))
    out = tmp_path / "out"
    code = run(
        ["ball", str(recording), "--rig", str(rig), "-o", str(out), "--generations", "2", "--no-report", "--json"]
    )
    assert code in (0, 3)
    summary = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    written = Rig.from_toml_text(RIG + (out / "ball.toml").read_text(encoding="utf-8"))
    assert BouncingBall.from_rig(written).radius_m == summary["radius_m"]
    with xr.open_dataset(out / "ball.nc") as result:
        assert [str(name) for name in result["ball_parameter"].values] == [
            "radius_m", "stiffness_n_per_m", "damping_kg_per_s", "hardening_per_m", "beta",
        ]  # fmt: skip
        error = result["ball_damping_ratio"].values - result["damping_ratio"].values
        assert 100 * np.sqrt((error**2).mean()) == pytest.approx(summary["rms"], rel=1e-6)
        assert result["loss_factor"].attrs["long_name"]


def network_arguments(tmp_path: Path, rig: Path) -> list[str]:
    """A small network of the ball of `ball_decay`, beside a decay with that very ball."""
    ball = tmp_path / "ball.toml"
    ball.write_text(BouncingBall(0.0244, 1103.0, 13.04, 74.04, 0.0017).twin_table(), encoding="utf-8")
    recording = write_decay(tmp_path / "decay.nc", *ball_decay())
    return ["ball-network", str(recording), "--rig", str(rig), "--ball", str(ball), "-o", str(tmp_path / "out")]


@pytest.mark.slow
def test_a_network_learns_from_a_ball(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The recorded decay is one of the ball: what the network misses of it, it misses of the ball."""
    given = network_arguments(tmp_path, rig)
    small = ["--duration-s", "20", "--layers", "2", "--neurons", "12", "--steps", "200", "--rate-hz", "500"]
    assert run([*given, *small, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    out = tmp_path / "out"
    with xr.open_dataset(out / "network.nc") as result:
        # the ball in the loop decays as the recording that it made
        ball, recorded = result["ball_damping_ratio"].values, result["damping_ratio"].values
        assert ball == pytest.approx(recorded, abs=2e-4)
        error = 100 * np.sqrt(((result["network_damping_ratio"].values - ball) ** 2).mean())
        assert error == pytest.approx(summary["damping_error_to_ball_percent"], rel=1e-6)
        assert error < 2.0
        assert result["network_loss_factor"].shape == result["loss_factor"].shape
    assert summary["fit_percent"] > 40
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Printed and reached" in page
    for name in ("scheme", "training_path", "training_errors", "open_loop", "decays", "loss_factors"):
        assert (out / "figures" / f"{name}.png").is_file()
    # the network is a model like any other
    rom_rig = tmp_path / "rom.toml"
    rom_rig.write_text(
        RIG + f'[twin]\ntank_model = "rom"\nparameters = {{rom = "{out / "ROM.nc"}"}}\n', encoding="utf-8"
    )
    simulated = ["simulate", "--rig", str(rom_rig), "--input", given[1], "-o", str(tmp_path / "sim.nc")]
    assert run(simulated) in (0, 3)


def test_a_network_of_another_file_than_a_ball(
    tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = network_arguments(tmp_path, rig)
    (tmp_path / "ball.toml").write_text("[tank]\n", encoding="utf-8")
    line = refused(capsys, *given)
    assert "allowed: a ball.toml of `sloshlab ball`" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_frozen_decay_gives_the_guide(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The true guide has 0.30 N and 1.20 kg/s; the rig file says 0.37 and 1.58."""
    true_rig = Rig.from_toml_text(RIG.replace("0.37", "0.30").replace("1.58", "1.20"))
    ball = BouncingBall(0.0244, 1103.0, 13.04, 74.04, 0.0017)
    runs = []
    for name, inside in (("frozen", None), ("sloshing", ball)):
        decay = simulated_decay(inside, true_rig, 0.03, 2.5, sampling_rate_hz=RATE_HZ)
        runs.append(str(write_decay(tmp_path / f"{name}.nc", decay.acceleration_m_per_s2,
                                    decay.interface_force_n, configuration=name)))  # fmt: skip
    out = tmp_path / "out"
    assert run(["ball", *runs, "--rig", str(rig), "-o", str(out), "--generations", "1", "--json"]) == 3
    flags = json.loads(capsys.readouterr().out.strip().splitlines()[-1])["flags"]
    assert any("structure.coulomb_force_n is stated as 0.37; frozen decay: 0.3" in flag for flag in flags)
    assert any("structure.damping_kg_per_s is stated as 1.58; frozen decay: 1." in flag for flag in flags)
    assert not any("stiffness_n_per_m is stated" in flag for flag in flags)
    assert (out / "figures" / "guide.png").is_file()
    assert "The guide" in (out / "report.html").read_text(encoding="utf-8")


def test_a_decay_that_never_decays(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(2400) / RATE_HZ
    recording = write_decay(tmp_path / "steady.nc", 20 * np.cos(2 * np.pi * 6.5 * time))
    line = refused(capsys, "ball", recording, "--rig", rig, "-o", tmp_path / "out")
    assert "steady.nc" in line
    assert "allowed: an amplitude that falls" in line
    assert not (tmp_path / "out").exists()


def test_a_decay_without_usable_damping(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(2400) / RATE_HZ
    recording = write_decay(tmp_path / "faint.nc", 2.0 * np.exp(-time) * np.cos(2 * np.pi * 6.5 * time))
    line = refused(capsys, "ball", recording, "--rig", rig, "-o", tmp_path / "out")
    assert "ζ(a) of the decay: got 0 values above 0.3 g" in line


def test_decays_of_different_releases(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    acceleration, _ = ball_decay()
    first = write_decay(tmp_path / "one.nc", acceleration)
    two = write_decay(tmp_path / "two.nc", acceleration, initial_displacement_m=0.05)
    line = refused(capsys, "ball", first, two, "--rig", rig, "-o", tmp_path / "out")
    assert "initial_displacement_m of the decays: got 0.03, 0.05" in line


def test_runs_of_different_experiments(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    acceleration, _ = ball_decay()
    first = write_decay(tmp_path / "one.nc", acceleration)
    two = write_decay(tmp_path / "two.nc", acceleration, experiment="beam_free")
    line = refused(capsys, "ball", first, two, "--rig", rig, "-o", tmp_path / "out")
    assert "runs for a ball: got beam_free, sdof_free" in line


def test_frozen_decays_only(tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = write_decay(tmp_path / "frozen.nc", ball_decay()[0], configuration="frozen")
    assert "no sloshing decay" in refused(capsys, "ball", recording, "--rig", rig, "-o", tmp_path / "out")


@pytest.mark.parametrize(("option", "value", "code"), [("--omega-bar", "-1", 1), ("--damper", "never", 2)])
def test_bad_options(
    tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str], option: str, value: str, code: int
) -> None:
    (tmp_path / "run.nc").touch()
    arguments = ["ball", str(tmp_path / "run.nc"), "--rig", str(rig), "-o", str(tmp_path / "out"), option, value]
    assert run(arguments) == code
    assert option in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("damper", ["contact", "always"])
def test_a_ball_comes_back_from_its_own_decay(
    tmp_path: Path, rig: Path, capsys: pytest.CaptureFixture[str], damper: str
) -> None:
    """ζ(a) within 3 % at every amplitude; the report has every figure."""
    truth = BouncingBall(0.0244, 1103.0, 13.04, 74.04, 0.0017, float(damper == "always"))
    decay = simulated_decay(truth, Rig.from_toml_text(RIG), 0.064, 4.0, sampling_rate_hz=RATE_HZ)
    recording = write_decay(
        tmp_path / "decay.nc", decay.acceleration_m_per_s2, decay.interface_force_n, initial_displacement_m=0.064
    )
    out = tmp_path / "out"
    assert run(["ball", str(recording), "--rig", str(rig), "-o", str(out), "--damper", damper]) in (0, 3)
    with xr.open_dataset(out / "ball.nc") as result:
        assert result["ball_damping_ratio"].values == pytest.approx(result["damping_ratio"].values, rel=0.03)
        if damper == "always":  # in contact only the search ends in a neighbouring valley
            assert result["ball_value"].values == pytest.approx([0.0244, 1103.0, 13.04, 74.04, 0.0017], rel=1e-3)
    names = {path.stem for path in (out / "figures").glob("*.png")}
    assert names == {"decay", "sloshing_force", "damping_shares", "loss_factors", "hysteresis", "maps", "lines"}
    assert "Not drawn" not in (out / "report.html").read_text(encoding="utf-8")
