"""Cases of other laboratories: physics by closed forms and by scipy's integrators, and how answers are judged."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sloshlab.identification.case import read_case
from sloshlab.user_twin import UserTwinModel, load_user_twin
from studies.other_laboratories.answers import RECORD, is_right, table
from studies.other_laboratories.case_files import LaboratoryCase, RightAnswer, Run, write_case
from studies.other_laboratories.driven_structures import PULSE_N, RIGS_HZ, not_repeats, pulses
from studies.other_laboratories.hysteresis import NOISE_M, bouc_wen_displacement
from studies.other_laboratories.integration import Sampling, integrated, multisine
from studies.other_laboratories.late_recorder import (
    CORNER_OVER_RATE,
    N_BETWEEN,
    RATE_HZ,
    Modes,
    filtered,
    motion,
    recorded_decay,
)
from studies.other_laboratories.waves import SAMPLING as WAVE_SAMPLING
from studies.other_laboratories.waves import WAVE_HZ, waves


def test_the_integrator_is_of_fourth_order() -> None:
    """x″ = −x + sin 2t from rest has x = (2/3) sin t − (1/3) sin 2t."""
    errors = []
    for n_steps in (2, 4):
        sampling = Sampling(4.0, 41, n_steps)
        drive = np.sin(2 * sampling.half_steps_s)[None]
        state = integrated(lambda y, f: np.stack([y[1], f - y[0]]), np.zeros((2, 1)), drive, sampling)
        time = np.arange(41) / 4.0
        errors.append(np.abs(state[:, 0, 0] - (2 / 3 * np.sin(time) - 1 / 3 * np.sin(2 * time))).max())
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)


def test_bouc_wen_by_an_integrator_of_scipy() -> None:
    """LSODA at a tolerance of 1e-10, with the published numbers written out; a thousandth of the noise is left."""
    sampling = Sampling(750.0, 200, 12)
    force = multisine(sampling, (5.0, 150.0), 50.0, seed=3)
    at = sampling.half_steps_s

    def rates(t: float, state: np.ndarray) -> list[float]:
        y, v, z = state
        u = np.interp(t, at, force)
        return [v, (u - 5e4 * y - 10.0 * v - z) / 2.0, 5e4 * v - 1e3 * (0.8 * abs(v) * z - 1.1 * v * abs(z))]

    found = solve_ivp(
        rates, (0, at[-1]), np.zeros(3), method="LSODA", rtol=1e-10, atol=1e-13, t_eval=np.arange(200) / 750.0
    )
    assert np.abs(found.y[0]).max() > 1e-3
    # The force between half steps is a straight line here and three values of a step there.
    np.testing.assert_allclose(bouc_wen_displacement(force[None], sampling)[0], found.y[0], atol=0.05 * NOISE_M)


def test_friction_takes_four_f_over_k_per_cycle() -> None:
    """Without a damper the amplitude falls by 4F/k in every cycle, and the mass stops within F/k."""
    stiffness, friction = 3800.0, 2.0
    modes = Modes(np.array([2.0]), np.array([stiffness]), np.zeros(1), 2.0, friction_n=friction)
    period_s = 2 * np.pi * np.sqrt(2.0 / stiffness)
    q, acceleration = motion(modes, np.array([0.0102]), np.arange(2000) * period_s / 100)
    np.testing.assert_allclose(
        q[0, [0, 100, 200, 300, 400]], 0.0102 - 4 * friction / stiffness * np.arange(5), atol=1e-9
    )
    # 0.0102 m is 4.84 × 4F/k: after nine halves of 2F/k each 1.38 F/k is left, and a tenth half leaves 0.62 F/k.
    assert q[0, -1] == pytest.approx(0.0102 - 20 * friction / stiffness, abs=1e-9)
    assert acceleration[0, -1] == 0.0


def test_the_filter_is_late_by_its_published_delay() -> None:
    """A Bessel filter of fourth order has 2.114 of delay times angular corner frequency (−3 dB)."""
    time = np.arange(4000) / (N_BETWEEN * RATE_HZ)
    delay = time[-1] - filtered(time)[-1]
    assert delay == pytest.approx(2.1139 / (2 * np.pi * CORNER_OVER_RATE * RATE_HZ), rel=1e-3)


def test_a_release_lies_between_two_samples() -> None:
    """The deflection before, and a smooth start after it; without the filter the acceleration would jump."""
    modes = Modes(np.array([2.0]), np.array([3800.0]), np.array([1.5]), 2.0)
    channels = recorded_decay(modes, 0.03, 0.35)
    assert channels["displacement_tank"][0] == pytest.approx(0.03)
    assert channels["acceleration_tip"][0] == pytest.approx(0.0, abs=1e-9)
    later = np.arange(50, 60)
    omega, decay = np.sqrt(3800.0 / 2.0 - (1.5 / 4.0) ** 2), 1.5 / 4.0
    # 2.114/ω_c late, and released 0.35 samples after the first one.
    time = (later - 0.35) / RATE_HZ - 2.1139 / (2 * np.pi * CORNER_OVER_RATE * RATE_HZ)
    expected = 0.03 * np.exp(-decay * time) * (np.cos(omega * time) + decay / omega * np.sin(omega * time))
    # The filter also takes (ω/ω_c)² of the amplitude, some 1e-4.
    np.testing.assert_allclose(channels["displacement_tank"][later], expected, atol=2e-5)


def test_pulses_alternate() -> None:
    """One in 0.45 s, ±180 N, nothing between."""
    time = np.arange(0, 2, 1e-3)
    force = pulses(time, 0.2)
    assert not force[time < 0.2].any()
    assert force.max() == pytest.approx(PULSE_N, rel=1e-3)
    assert force.min() == pytest.approx(-PULSE_N, rel=1e-3)
    assert force[np.isclose(time, 0.206)] > 170 > -170 > force[np.isclose(time, 0.656)]


@pytest.mark.slow
def test_the_wave_has_half_the_frequency_and_either_sign() -> None:
    """Above its threshold; runs that differ in their ripples have the same power, and some the opposite sign."""
    time = WAVE_SAMPLING.half_steps_s
    shaken = np.stack([9.81 * level * np.sin(2 * np.pi * 10.6 * time) for level in (0.3, 1.8, 1.8, 1.8, 1.8)])
    found = waves(shaken, seed=1)[:, -2560:]
    lines = np.fft.rfftfreq(found.shape[1], 1 / WAVE_SAMPLING.rate_hz)
    assert lines[np.abs(np.fft.rfft(found[1])).argmax()] == pytest.approx(10.6 / 2, abs=0.1)
    assert abs(lines[np.abs(np.fft.rfft(found[1])).argmax()] - WAVE_HZ) < 0.5
    assert found[0].std() < 0.02 * found[1].std()
    np.testing.assert_allclose(found[1:].std(axis=1), found[1].std(), rtol=0.01)
    assert set(np.sign(found[1:] @ found[1])) == {-1.0, 1.0}


def test_runs_that_are_no_repeats_have_the_frequencies_they_are_said_to_have() -> None:
    """By the crossings of zero; the damping of c/2m shifts them by less than 1e-4."""
    case = next(case for case in not_repeats() if case.name == "not_repeats_decays")
    for run, frequency in zip(case.runs, RIGS_HZ, strict=True):
        x = run.channels["displacement_mass"]
        before = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))
        crossings = (before + x[before] / (x[before] - x[before + 1])) / case.sampling_rate_hz
        assert (len(crossings) - 1) / (crossings[-1] - crossings[0]) == pytest.approx(frequency, rel=2e-4)


def test_a_case_is_a_case_folder_and_its_truth_lies_outside(tmp_path: Path) -> None:
    """Read back as a user's case with its twin; noise is as large as it is stated."""
    case = next(case for case in not_repeats() if case.name == "not_repeats_driven")
    home = write_case(case, tmp_path)
    assert sorted(path.name for path in home.iterdir()) == ["case", "truth.json", "twin.py"]
    assert sorted(path.name for path in (home / "case").iterdir()) == ["recordings"]
    read = read_case(home / "case", with_rig=False)
    assert UserTwinModel(load_user_twin(home / "twin.py"), read.runs).compared(read.runs[0])
    noise = read.runs[0].recording["acceleration_mass"].values - case.runs[0].channels["acceleration_mass"]
    assert noise.std() == pytest.approx(0.02, rel=0.1)
    assert json.loads((home / "truth.json").read_text())["right"][0]["verdict"] == "refused"


def _record(verdict: str, *effects: tuple[str, str], **facts: object) -> dict[str, object]:
    found = [{"name": name, "block": block} for block, name in effects]
    return {"exit_code": 0, "line": "", "verdict": {"verdict": verdict, "effects": found, **facts}}


@pytest.mark.parametrize(
    ("right", "record", "good"),
    [
        (RightAnswer("named", ("a", "b")), _record("named", ("x", "b"), ("x", "a")), True),
        (RightAnswer("named", ("a",)), _record("named", ("x", "b"), ("x", "a")), False),
        (RightAnswer("named", ("a",)), _record("unknown", ("x", "a")), False),
        (
            RightAnswer("indistinguishable", ("a",)),
            _record("indistinguishable", ("x", "b"), alternatives=[["a"]]),
            True,
        ),
        (
            RightAnswer("indistinguishable", ("a",)),
            _record("indistinguishable", ("x", "b"), alternatives=[["c"]]),
            False,
        ),
        (RightAnswer("unknown", block="tank"), _record("unknown", ("tank", "b")), True),
        (RightAnswer("unknown", block="tank"), _record("unknown", ("sensor", "b")), False),
        (RightAnswer("nothing_missing"), _record("nothing_missing"), True),
        (RightAnswer("unknown", says="refuted"), _record("unknown", statement="k is refuted"), True),
        (RightAnswer("unknown", says="refuted"), _record("unknown", statement="no name"), False),
        (RightAnswer("refused", says="repeats"), {"exit_code": 1, "line": "no repeats", "verdict": {}}, True),
        (RightAnswer("refused", says="repeats"), {"exit_code": 1, "line": "no case", "verdict": {}}, False),
        (RightAnswer("refused", says="repeats"), {"exit_code": 0, "line": "repeats", "verdict": {}}, False),
    ],
)
def test_answers_are_judged(right: RightAnswer, record: dict[str, object], good: bool) -> None:
    """All effects and no other; the block of what is unknown; the words of a refusal."""
    assert is_right(right, record) is good


def test_the_table_counts_what_is_right(tmp_path: Path) -> None:
    """A case that was not diagnosed counts as wrong."""
    run = Run("run", {"force_drive": np.zeros(64), "displacement_mass": np.zeros(64)})
    for name in ("first", "second"):
        case = LaboratoryCase(name, "a case", 100.0, [run], {}, [RightAnswer("nothing_missing")])
        write_case(case, tmp_path)
    (tmp_path / "first" / RECORD).write_text(json.dumps({**_record("nothing_missing"), "seconds": 3.2}))
    lines = table(tmp_path)
    assert lines[-1] == "right: 1 of 2"
    assert "| first | nothing_missing | nothing_missing | yes | 3 |" in lines
