"""Two force cells of a shaker share an amplifier: what is wrong with both is one fault, found on them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DRY_KG, LIQUID_KG, RATE_HZ, RIG, effect, fitted_from, run_of

from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, Surroundings, channels_of, joined_channels
from sloshlab.rig import Rig

assert effects.__all__
CELLS = ("force_cell_1", "force_cell_2")
BOTH = "force_cell_1+force_cell_2"
SHARES = (0.55, 0.45)
NOISE = {"acceleration_control": 0.003, "force_cell_1": 0.03, "force_cell_2": 0.03}
DURATION_S = 4.0


def acceleration(time: np.ndarray) -> np.ndarray:
    """Two sines that begin and end smoothly [m/s²]."""
    window = np.where(time > 0, np.sin(np.pi * np.clip(time / DURATION_S, 0, 1)) ** 2, 0.0)
    return window * (9.0 * np.sin(2 * np.pi * 6.3 * time) + 5.0 * np.sin(2 * np.pi * 13.7 * time + 1.0))


def model_of(folder: Path, late_s: Mapping[str, float], gains: Mapping[str, float]) -> RigModel:
    """A frozen tank on a shaker, its force F = m a in two cells, each with its delay and gain."""
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    channels = {"acceleration_control": acceleration(time)}
    for name, share in zip(CELLS, SHARES, strict=True):
        force = (DRY_KG + LIQUID_KG) * share * acceleration(time - late_s.get(name, 0.0))
        channels[name] = gains.get(name, 1.0) * force
    run = run_of("shaken", channels, NOISE, 5, experiment="other")
    for name in CELLS:
        run.recording[name].attrs |= {"block_from": "shaker", "block_to": "tank"}
    file = folder / "rig.toml"
    before, _, after = RIG.partition("[structure]")
    file.write_text(before + after[after.index("[twin]") :].replace("TANK_MODEL", "frozen"), encoding="utf-8")
    return RigModel(Rig.from_toml(file), folder, [run])


def surroundings(model: RigModel) -> Surroundings:
    """Sizes of the motion, by hand."""
    [run] = model.runs
    return Surroundings(
        rig=model.rig,
        twin=model.twin,
        displacement_m=9.0 / (2 * np.pi * 6.3) ** 2,
        velocity_m_per_s=9.0 / (2 * np.pi * 6.3),
        acceleration_m_per_s2=14.0,
        frequency_hz=8.0,
        force_n=14.0 * (DRY_KG + LIQUID_KG),
        channels={name: float(np.std(run.recording[name].values)) for name in NOISE},
        driving=("acceleration_control",),
        sampling_rate_hz=RATE_HZ,
        longest_run_s=DURATION_S,
    )


def fit_of(model: RigModel, name: str, place: str) -> tuple[FreeRunFit, float]:
    """The fit of a fault, the shares of the cells free as well, and its misfit per sample."""
    at = surroundings(model)
    candidate = Candidate(effect(f"sensor.{name}"), at, place)
    held = {name: value for name, value in model.believed.items() if not name.startswith("share")}
    [run] = model.runs
    problem = FreeRunProblem(model, [observations(run, CELLS)], [candidate], held)
    fit = fitted_from(problem, [{**model.believed, **start} for start in candidate.starts()])
    return fit, fit.misfit / sum(observation.known.sum() for observation in problem.runs[0])


def check(fit: FreeRunFit, label: str, truth: float) -> None:
    assert abs(fit.values[label] - truth) < 3.3 * fit.standard_error(label)
    assert fit.standard_error(label) < 0.03 * truth
    assert fit.values["share of force_cell_1"] == pytest.approx(SHARES[0], abs=0.002)


def test_a_delay_of_both_cells_is_found_on_both_and_not_on_one(tmp_path: Path) -> None:
    model = model_of(tmp_path, dict.fromkeys(CELLS, 0.003), {})
    fit, misfit = fit_of(model, "sensor_delay", BOTH)
    check(fit, f"sensor.sensor_delay.{BOTH}.delay_s", 0.003)
    assert misfit < 1.2
    for cell in CELLS:
        assert fit_of(model, "sensor_delay", cell)[1] > 2.0


def test_a_gain_of_both_cells_is_found_on_both(tmp_path: Path) -> None:
    """On one of them it would fit as well, with another share: 1.06 × 0.55 = (1 + ε) s, 1.06 × 0.45 = 1 − s."""
    model = model_of(tmp_path, {}, dict.fromkeys(CELLS, 1.06))
    fit, misfit = fit_of(model, "sensor_gain", BOTH)
    check(fit, f"sensor.sensor_gain.{BOTH}.ratio", 0.06)
    assert misfit < 1.2


def test_a_fault_of_one_cell_is_found_on_one(tmp_path: Path) -> None:
    model = model_of(tmp_path, {"force_cell_2": 0.004}, {})
    fit, misfit = fit_of(model, "sensor_delay", "force_cell_2")
    label = "sensor.sensor_delay.force_cell_2.delay_s"
    assert abs(fit.values[label] - 0.004) < 3.3 * fit.standard_error(label)
    assert misfit < 1.2
    assert fit_of(model, "sensor_delay", BOTH)[1] > 2.0


@pytest.mark.parametrize("name", ["sensor_gain", "sensor_delay", "sensor_high_pass", "clock_skew"])
def test_what_an_amplifier_or_a_clock_does_is_sought_on_both_cells(tmp_path: Path, name: str) -> None:
    of_two = surroundings(model_of(tmp_path, {}, {}))
    of_one = replace(of_two, channels={"acceleration_control": 1.0, "force_cell_1": 1.0})
    assert BOTH in effect(f"sensor.{name}").places(of_two)
    assert not any("+" in place for place in effect(f"sensor.{name}").places(of_one))
    assert channels_of(joined_channels(CELLS)) == CELLS
