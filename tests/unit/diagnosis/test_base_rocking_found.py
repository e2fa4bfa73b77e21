"""A base that gives way is found as such in a run that a coupled beam of scipy made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import effect, fitted_from, run_of, surroundings
from scipy.signal import lsim

from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, candidates
from sloshlab.modal.cantilever import Cantilever, cantilever_modes
from sloshlab.rig import Rig

assert effects.__all__
RATE_HZ, DURATION_S = 500.0, 4.0
BEAM = Cantilever(0.74, 0.1, 0.01, 70e9, 2700.0, 0.45)
MODES = cantilever_modes(BEAM, n_modes=2)
OMEGA = 2 * np.pi * MODES.frequency_hz
STIFFNESS = float(1 / np.sum(1 / (MODES.modal_mass_kg * OMEGA**2)))
COMPLIANCE = 0.06 / (STIFFNESS * BEAM.length_m**2)
RIG = f"""
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.33
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.1
thickness_m = 0.01
frequencies_hz = {MODES.frequency_hz.tolist()}
damping_ratios = [0.01, 0.01]
modal_masses_kg = {MODES.modal_mass_kg.tolist()}
tip_mode_shape = [1.0, 1.0]
[twin]
tank_model = "frozen"
"""


def base_of(time: np.ndarray) -> np.ndarray:
    """Acceleration of the base: four sines that begin and end smoothly."""
    window = np.sin(np.pi * time / DURATION_S) ** 2
    return window * sum(np.sin(2 * np.pi * f * time + f) for f in (7.0, 10.3, 13.1, 19.0))


def coupled(time: np.ndarray) -> dict[str, np.ndarray]:
    """Accelerations at tip and mid-span: two clamped modes and a rotation with the inertia of the beam."""
    length, tip, line = BEAM.length_m, BEAM.tip_mass_kg, BEAM.mass_per_length_kg_per_m
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x, w = 0.5 * length * (nodes + 1), 0.5 * length * line * weights
    functions = np.column_stack([cantilever_modes(BEAM, n_modes=2, x_m=x).mode_shape, x])
    at_tip = np.array([1.0, 1.0, length])
    mass = functions.T @ (w[:, None] * functions) + tip * np.outer(at_tip, at_tip)
    inverse = np.linalg.inv(mass)
    stiffness = np.diag([*(MODES.modal_mass_kg * OMEGA**2), 1 / COMPLIANCE])
    damping = np.diag([*(0.02 * MODES.modal_mass_kg * OMEGA), 0.3])
    pushed = np.hstack([-inverse @ stiffness, -inverse @ damping])
    forced = -inverse @ (w @ functions + tip * at_tip)
    system = (
        np.vstack([np.eye(3, 6, 3), pushed]),
        np.append(np.zeros(3), forced)[:, None],
        pushed,
        forced[:, None],
    )
    fine = np.linspace(0, time[-1], 8 * (time.size - 1) + 1)
    _, accelerations, _ = lsim(system, base_of(fine), fine)
    middle = np.append(cantilever_modes(BEAM, n_modes=2, x_m=np.array([0.4])).mode_shape[0], 0.4)
    return {
        "acceleration_tip": base_of(time) + accelerations[::8] @ at_tip,
        "acceleration_beam_1": base_of(time) + accelerations[::8] @ middle,
        "acceleration_root": base_of(time),
    }


def model_of(folder: Path) -> RigModel:
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    noise = {"acceleration_tip": 0.05, "acceleration_beam_1": 0.05}
    described = {"experiment": "beam_random", "sampling_rate_hz": RATE_HZ}
    run = run_of("random", coupled(time), noise, 5, **described)
    recording = run.recording.assign_coords(time=("time", time, {"units": "s"}))
    recording["acceleration_beam_1"].attrs["x_m"] = 0.4
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    return RigModel(Rig.from_toml(folder / "rig.toml"), folder, [replace(run, recording=recording)])


def test_the_compliance_of_the_base_comes_back(tmp_path: Path) -> None:
    model = model_of(tmp_path)
    at = replace(surroundings(model), frequency_hz=10.0)
    candidate = Candidate(effect("excitation.base_rocking"), at)
    assert candidate.key in [candidate.key for candidate in candidates(at)]
    free = ("damping of mode 1", "damping of mode 2")
    held = {name: value for name, value in model.believed.items() if name not in free}
    [run] = model.runs
    observed = [observations(run, model.compared(run))]
    problem = FreeRunProblem(model, observed, [candidate], held)
    fit = fitted_from(problem, [{**model.believed, **start} for start in candidate.starts()])
    label = "excitation.base_rocking.compliance_rad_per_n_m"
    # two Ritz modes against two modes and a rotation of its own inertia: 0.1 % is what they leave, not the noise
    assert fit.values[label] == pytest.approx(COMPLIANCE, rel=0.005)
    assert fit.standard_error(label) < 1e-3 * COMPLIANCE
    rigid = FreeRunProblem(model, observed, (), held)
    without = fitted_from(rigid, [model.believed])
    assert without.misfit > 20 * fit.misfit
