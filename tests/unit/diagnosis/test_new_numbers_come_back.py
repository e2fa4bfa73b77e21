"""Held readings, actuators, outside forces and play, fitted from what the recordings propose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import (
    DAMPING,
    MASS_KG,
    NOISE,
    RATE_HZ,
    STIFFNESS,
    base_motion,
    decays,
    fitted_from,
    motion,
    rig,
    run_of,
    surroundings,
)
from scipy.interpolate import make_interp_spline
from slow_cases import slow_but

from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, MissingForce, candidates
from sloshlab.missing_physics.update_rates import update_rates_hz

assert effects.__all__
FREQUENCY, LOSS = "frequency of mode 1", "damping of mode 1"
TIP = "acceleration_tip"
FITTED = tuple[FreeRunProblem, Candidate]


def problem_of(folder: Path, runs: Sequence[CaseRun], key: str, free: Sequence[str]) -> FITTED:
    """One candidate as the recordings offer it; of the baseline releases are free and what is named."""
    model = RigModel(rig(folder), folder, runs)
    rates = {TIP: update_rates_hz([runs[0].recording[TIP].values], RATE_HZ, 16.0)}
    at = replace(
        surroundings(model),
        runs=tuple(run.name for run in runs),
        update_rates_hz={name: found for name, found in rates.items() if found},
    )
    [candidate] = [candidate for candidate in candidates(at) if candidate.key == key]
    held = {name: value for name, value in model.believed.items() if name not in free and "release" not in name}
    observed = [observations(run, model.compared(run)) for run in runs]
    return FreeRunProblem(model, observed, [candidate], held), candidate


def assert_come_back(
    problem: FreeRunProblem,
    candidate: Candidate,
    starts: Sequence[Mapping[str, float]],
    truth: Mapping[str, float],
    known_to: Mapping[str, float],
) -> None:
    """Within 3.3 standard errors, these within what is stated, and nothing but noise left."""
    fit = fitted_from(problem, [{**problem.model.believed, **start} for start in starts], n_iterations=10)
    assert fit.trouble == ""
    assert fit.misfit < 1.25 * sum(observation.known.sum() for run in problem.runs for observation in run)
    for name, value in truth.items():
        label = f"{candidate.key}.{name}"
        width = fit.standard_error(label)
        assert abs(fit.values[label] - value) < 3.3 * width + 1e-4 * abs(value), (label, fit.values[label], width)
        assert width < known_to.get(name, 0.05 * abs(value)), (label, width)


def test_a_rate_of_updates_comes_back(tmp_path: Path) -> None:
    rate, phase = 47.3, 0.63

    def held(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        time = np.arange(channels[TIP].size) / RATE_HZ
        updates = (np.floor(time * rate - phase) + phase) / rate
        shown = make_interp_spline(time, channels[TIP], k=5)(np.maximum(updates, 0.0))
        return {**channels, TIP: np.where(updates < 0, channels[TIP], shown)}

    problem, candidate = problem_of(
        tmp_path, decays(changed=held), f"sensor.sample_and_hold.{TIP}", (FREQUENCY, LOSS)
    )
    # to a tenth of an update over a run of four seconds
    assert_come_back(problem, candidate, candidate.starts(), {"update_rate_hz": rate}, {"update_rate_hz": 0.025})


def test_a_limit_and_a_dead_zone_come_back(tmp_path: Path) -> None:
    limit, dead_zone = 0.9, 0.12

    def acting(t: float) -> float:
        command = base_motion(t)
        return float(np.clip(command - np.clip(command, -dead_zone, dead_zone), -limit, limit))

    time, _, _, a = motion(0.0, 6.0, base=acting)
    command, acts = (np.array([of(t) for t in time]) for of in (base_motion, acting))
    run = run_of("driven", {TIP: a + acts, "acceleration_root": command}, NOISE, 3, experiment="other")
    problem, candidate = problem_of(
        tmp_path, [run], "excitation.actuator_saturation.acceleration_root", (FREQUENCY, LOSS)
    )
    truth = {"limit": limit, "dead_zone": dead_zone}
    # corners of what acts lie between samples of the command
    assert_come_back(problem, candidate, candidate.starts(), truth, {"dead_zone": 0.02})


FORCE_N, PERIOD_S, WIDTH_S = 4.0, 0.45, 0.06


def blow(start_s: float) -> Callable[[float, float, float], float]:
    def force(t: float, x: float, v: float) -> float:
        within = (t - start_s) % PERIOD_S
        inside = t >= start_s and within < WIDTH_S
        return FORCE_N * np.sin(np.pi * within / WIDTH_S) ** 2 if inside else 0.0

    return force


def tone(phase: float) -> Callable[[float, float, float], float]:
    # the phase is that in the middle of four seconds
    return lambda t, x, v: 0.6 * np.sin(2 * np.pi * (9.4 * (t - 2.0) + phase))


def missing_force(run: CaseRun) -> MissingForce:
    """m a + c v + k x from the recording alone."""
    x, a = (run.recording[name].values for name in ("displacement_tank", TIP))
    return MissingForce(np.asarray(MASS_KG * a + DAMPING * np.gradient(x, 1 / RATE_HZ) + STIFFNESS * x))


def runs_with(forces: Sequence[Callable[[float, float, float], float]]) -> list[CaseRun]:
    return [
        replace(decays((start,), 4.0, force=force, seed=20 + k)[0], name=f"run_{k}")
        for k, (start, force) in enumerate(zip((0.006, 0.012), forces, strict=True))
    ]


def test_a_train_of_pulses_comes_back_with_its_instants_in_every_run(tmp_path: Path) -> None:
    runs = runs_with([blow(0.21), blow(0.37)])
    problem, candidate = problem_of(tmp_path, runs, "structure.external_force", (FREQUENCY, LOSS))
    starts = candidate.proposed({run.name: missing_force(run) for run in runs})
    truth = {"period_s": PERIOD_S, "start_s in run_0": 0.21, "start_s in run_1": 0.37, "width_s": WIDTH_S}
    # of short pulses the impulse is known, force and width less so
    known_to = {"width_s": 0.02, "start_s in run_0": 0.02, "start_s in run_1": 0.02}
    assert_come_back(problem, candidate, starts, truth | {"size_n": FORCE_N}, known_to | {"size_n": 0.3 * FORCE_N})


def test_the_line_of_a_machine_comes_back_with_its_phase_in_every_run(tmp_path: Path) -> None:
    runs = runs_with([tone(0.2), tone(0.7)])
    problem, candidate = problem_of(tmp_path, runs, "structure.harmonic_force", (FREQUENCY, LOSS))
    starts = candidate.proposed({run.name: missing_force(run) for run in runs})
    truth = {"size_n": 0.6, "frequency_hz": 9.4, "phase in run_0": 0.2, "phase in run_1": 0.7}
    assert_come_back(problem, candidate, starts, truth, {"phase in run_0": 0.02, "phase in run_1": 0.02})


@pytest.mark.parametrize("down_n", slow_but([0.5], [0.5, 0.9]))
def test_a_slider_behind_a_play_comes_back_by_direction(tmp_path: Path, down_n: float) -> None:
    up_n, play, stiffness = 0.5, 0.004, 600.0
    runs = [
        run_of(f"decay_{k}", channels, NOISE, 30 + k, initial_displacement_m=start)
        for k, start in enumerate((0.008, 0.018))
        for channels in [dragged(start, up_n, down_n, play, stiffness)]
    ]
    key = "structure.friction_behind_play" + ("_by_direction" if down_n != up_n else "")
    problem, candidate = problem_of(tmp_path, runs, key, (FREQUENCY, LOSS))
    forces = {"force_up_n": up_n, "force_down_n": down_n} if down_n != up_n else {"force_n": up_n}
    assert_come_back(
        problem, candidate, candidate.starts(), {**forces, "play_m": play, "stiffness_n_per_m": stiffness}, {}
    )


def dragged(start_m: float, up_n: float, down_n: float, play_m: float, stiffness: float) -> dict[str, np.ndarray]:
    """A decay by the trapezoidal rule at a hundred steps a sample, the slider moved after every step."""
    step, x, v, slider = 0.01 / RATE_HZ, start_m, 0.0, start_m
    n = round(4.0 * RATE_HZ)
    shown = np.empty((2, n))

    def rate(position: float, speed: float) -> float:
        stretch = position - slider
        beyond = stretch - min(max(stretch, -0.5 * play_m), 0.5 * play_m)
        pull = min(max(stiffness * beyond, -down_n), up_n)
        return -(STIFFNESS * position + DAMPING * speed + pull) / MASS_KG

    for i in range(n):
        shown[:, i] = x, rate(x, v)
        for _ in range(100):
            a = rate(x, v)
            x_new = x + step * v + 0.5 * step**2 * a
            v = v + 0.5 * step * (a + rate(x_new, v + step * a))
            x = x_new
            slider = min(max(slider, x - 0.5 * play_m - up_n / stiffness), x + 0.5 * play_m + down_n / stiffness)
    return {"displacement_tank": shown[0], TIP: shown[1]}
