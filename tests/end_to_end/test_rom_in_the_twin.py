"""A trained model as the tank of a twin: `sloshlab simulate` and `sloshlab beam --rom`, flags, bad files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_runs import DONE_BUT_FLAGGED, refusal

from acquisition.virtual_laboratory.numerical_runs import BEAM_RIG, RIG_TEXTS
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from acquisition.virtual_laboratory.structure_run import virtual_structure_run
from pipelines.command_line import run
from sloshlab.recording import read_recording, write_recording
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.tank_scaling import tank_facts
from sloshlab.reduced_order_model.validity_domain import MotionCycles, ValidityDomain
from sloshlab.rig import Rig

RIG_TEXT = RIG_TEXTS[BEAM_RIG]
FROZEN = '[twin]\ntank_model = "frozen"\n'
DAMPING_KG_PER_S, RATE_HZ, FREQUENCY_HZ = 3.0, 170.0, 10.87


def viscous_model(strongest_m_per_s: float) -> ReducedOrderModel:
    """A linear model that is a damper at the first mode: b₁ and b₂ of b₁ e^{−iωT} + b₂ e^{−2iωT} = −c."""
    turn = 2 * math.pi * FREQUENCY_HZ / RATE_HZ
    rows = [[math.cos(turn), math.cos(2 * turn)], [math.sin(turn), math.sin(2 * turn)]]
    weights = np.linalg.solve(rows, [-DAMPING_KG_PER_S, 0.0])
    small = 1e-5
    theta = np.concatenate([small * weights / 2, -small * weights / 2, [1 / small, -1 / small]])
    cycles = MotionCycles(np.zeros(60), np.linspace(8, 14, 60), np.tile([1e-9, strongest_m_per_s], 30))
    facts = {**tank_facts(Rig.from_toml_text(RIG_TEXT)), "domain": ValidityDomain.of([cycles]).facts()}
    return ReducedOrderModel(NormalisedRadialBasis(2, 2), theta, Delays.tapped(2), Scaling(), RATE_HZ, facts)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A frozen decay of the virtual laboratory, and a rig whose tank is a model."""
    made = tmp_path_factory.mktemp("rom")
    assert FROZEN in RIG_TEXT
    described = '[twin]\ntank_model = "rom"\nparameters = {rom = "ROM.nc"}\n'
    (made / "rig.toml").write_text(RIG_TEXT.replace(FROZEN, described), encoding="utf-8")
    recorded = virtual_structure_run(
        Rig.from_toml_text(RIG_TEXT), experiment="beam_free", configuration="frozen", duration_s=2.0,
        imperfect=False, rig_name="rig.toml",
    )  # fmt: skip
    write_virtual_run(recorded, made / "frozen.nc")
    save_model(viscous_model(10.0), made / "ROM.nc")
    save_model(viscous_model(0.2), made / "weak.nc")
    return made


def simulate(folder: Path, output: Path, *more: str) -> int:
    return run(
        [
            "simulate",
            "--rig",
            str(folder / "rig.toml"),
            "--input",
            str(folder / "frozen.nc"),
            "-o",
            str(output),
            *more,
        ]
    )


def damping(values: np.ndarray, n: int) -> float:
    peaks = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:]) & (values[1:-1] > 0)) + 1
    return float(np.log(values[peaks[0]] / values[peaks[n]]) / (2 * np.pi * n))


def test_a_model_that_is_a_damper_damps_as_one(folder: Path, tmp_path: Path, capsys: Any) -> None:
    """ζ = ζ₀ + c/(2 m ω); a zero-order hold of 1/170 s would turn the force by 11.5° and shift the frequency."""
    saved = tmp_path / "twin.toml"
    assert simulate(folder, tmp_path / "s.nc", "--save-twin", str(saved)) == 0
    said = capsys.readouterr().out
    assert "its own steps at 170 Hz" in said
    assert "scaled to this tank" not in said
    found = read_recording(tmp_path / "s.nc")
    assert "simulated_outside_domain" not in found.attrs
    expected = 0.0032 + DAMPING_KG_PER_S / (2 * 0.8956 * 2 * math.pi * FREQUENCY_HZ)
    assert damping(-found["displacement_tank"].values, 6) == pytest.approx(expected, rel=0.02)
    assert simulate(folder, tmp_path / "again.nc", "--twin", str(saved)) == 0
    again = read_recording(tmp_path / "again.nc")
    assert again["force_liquid"].values.tobytes() == found["force_liquid"].values.tobytes()


def test_leaving_the_domain_is_flagged_with_when_and_where(folder: Path, tmp_path: Path, capsys: Any) -> None:
    text = (folder / "rig.toml").read_text(encoding="utf-8").replace("ROM.nc", "weak.nc")
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    (tmp_path / "weak.nc").write_bytes((folder / "weak.nc").read_bytes())
    command = ["simulate", "--rig", str(tmp_path / "rig.toml"), "--input", str(folder / "frozen.nc")]
    assert run([*command, "-o", str(tmp_path / "s.nc"), "--json"]) == DONE_BUT_FLAGGED
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    (flag,) = [flag for flag in summary["flags"] if "domain" in flag]
    assert "stronger than any training at its frequency" in flag
    (left,) = summary["outside_domain"]
    # v = 1 m/s e^{−ζωt} falls to 0.22 m/s, a tenth above the strongest
    zeta = 0.0032 + DAMPING_KG_PER_S / (2 * 0.8956 * 2 * math.pi * FREQUENCY_HZ)
    speed = 0.0146 * 2 * math.pi * FREQUENCY_HZ
    end = math.log(speed / 0.22) / (zeta * 2 * math.pi * FREQUENCY_HZ)
    assert left["stop_s"][-1] == pytest.approx(end, abs=0.15)
    # the second mode moves the zero crossings of the first cycle
    assert left["omega_bar"] == pytest.approx(2 * math.pi * FREQUENCY_HZ / math.sqrt(9.81 / 0.0272), rel=0.04)
    assert read_recording(tmp_path / "s.nc").attrs["simulated_outside_domain"] in flag


def test_another_tank_and_liquid_are_scaled_and_said(folder: Path, tmp_path: Path, capsys: Any) -> None:
    text = (folder / "rig.toml").read_text(encoding="utf-8")
    assert "density_kg_per_m3 = 1000.0" in text
    (tmp_path / "rig.toml").write_text(
        text.replace("density_kg_per_m3 = 1000.0", "density_kg_per_m3 = 800.0"), encoding="utf-8"
    )
    (tmp_path / "ROM.nc").write_bytes((folder / "ROM.nc").read_bytes())
    assert simulate(folder, tmp_path / "water.nc") == 0
    command = ["simulate", "--rig", str(tmp_path / "rig.toml"), "--input", str(folder / "frozen.nc")]
    assert run([*command, "-o", str(tmp_path / "kerosene.nc")]) == 0
    said = capsys.readouterr().out
    assert "times × 1, velocities × 1, forces × 0.8; supposing that" in said
    found = read_recording(tmp_path / "kerosene.nc")
    expected = 0.0032 + 0.8 * DAMPING_KG_PER_S / (2 * 0.8956 * 2 * math.pi * FREQUENCY_HZ)
    assert damping(-found["displacement_tank"].values, 6) == pytest.approx(expected, rel=0.02)


def test_a_corrupted_model_writes_nothing(folder: Path, tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "rig.toml").write_text((folder / "rig.toml").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "ROM.nc").write_bytes((folder / "ROM.nc").read_bytes()[:300])
    command = ["simulate", "--rig", str(tmp_path / "rig.toml"), "--input", str(folder / "frozen.nc")]
    refusal(
        capsys, [*command, "-o", str(tmp_path / "s.nc")], tmp_path / "s.nc", "twin.parameters: model", "ROM.nc"
    )


@pytest.mark.slow
def test_the_beam_takes_models_beside_the_dampers(folder: Path, tmp_path: Path, capsys: Any) -> None:
    """The recording is the twin with the same damper, so that the model meets it and the dampers do not."""
    assert simulate(folder, tmp_path / "as_measured.nc") == 0
    recording = read_recording(tmp_path / "as_measured.nc").drop_vars("force_liquid")
    for name in [name for name in recording.attrs if name.startswith("simulated")]:
        del recording.attrs[name]
    recording.attrs["run_id"], recording.attrs["configuration"] = "decay", "sloshing"
    write_recording(recording, tmp_path / "decay.nc")
    (tmp_path / "rig.toml").write_text(RIG_TEXT, encoding="utf-8")
    ball = (
        '[twin]\ntank_model = "bouncing_ball"\n[twin.parameters]\nradius_m = 0.009\nstiffness_n_per_m = 3000.0\n'
    )
    ball += "damping_kg_per_s = 9.0\nhardening_per_m = 500.0\nbeta = 0.002\n"
    (tmp_path / "light_ball.toml").write_text(ball, encoding="utf-8")
    command = ["beam", str(tmp_path / "decay.nc"), "--rig", str(tmp_path / "rig.toml"), "--no-report", "--json"]
    options = ["--rom", str(folder / "ROM.nc"), "--rom", str(folder / "weak.nc")]
    options += ["--ball", str(tmp_path / "light_ball.toml"), "-o", str(tmp_path / "out")]
    assert run([*command, *options]) == DONE_BUT_FLAGGED
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert len([flag for flag in summary["flags"] if "outside its domain" in flag]) == 1
    found = summary["mean_damping_ratio"]
    damped = {name.split("twin ")[1].rstrip(")"): value for name, value in found.items() if "twin" in name}
    assert set(damped) == {
        "frozen", "c1: viscous damping", "c2: viscous damping", "c3: viscous damping", "ROM",
        "weak: ROM", "light_ball: bouncing ball",
    }  # fmt: skip
    assert damped["ROM"] == pytest.approx(found["decay"], rel=1e-6)
    assert damped["c1: viscous damping"] == pytest.approx(
        found["decay"] + 0.4 / (2 * 0.8956 * 2 * math.pi * FREQUENCY_HZ), rel=0.02
    )
    for option, bad in (("--rom", tmp_path / "rig.toml"), ("--ball", tmp_path / "rig.toml")):
        refusal(capsys, [*command, option, str(bad), "-o", str(tmp_path / "bad")], tmp_path / "bad", str(bad))
