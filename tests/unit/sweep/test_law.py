"""The sweep law: closed forms of (1.11)–(1.14), and its identification."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.sweep.law import LawKind, SweepLaw, identify_law, stated_law

OCTAVE_UP = SweepLaw(LawKind.OCTAVE, 5.0, 1 / 120, stated=True)


def test_the_sweep_of_240_s_has_2596_cycles_from_866_to_3462():
    """(1.14): t_n = log2(2πn R ln2/Ω_i)/R; n(0) = 5·120/ln2 = 865.6, n(240) = 3462.5."""
    turns = OCTAVE_UP.phase_rad(np.array([0.0, 240.0])) / (2 * np.pi)
    assert turns[0] == pytest.approx(600 / np.log(2), rel=1e-12)
    assert np.diff(turns)[0] == pytest.approx(2596.85, abs=0.005)
    times = OCTAVE_UP.cycle_boundaries_s(0.0, 240.0)
    n = np.arange(866, 3463)
    assert times.size == n.size
    omega_i = 2 * np.pi * 5.0
    np.testing.assert_allclose(times, 120 * np.log2(2 * np.pi * n * np.log(2) / 120 / omega_i), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        OCTAVE_UP,
        SweepLaw(LawKind.OCTAVE, 20.0, -1 / 120, stated=True),
        SweepLaw(LawKind.LINEAR, 5.0, 1 / 16, stated=True),
        SweepLaw(LawKind.LINEAR, 20.0, -1 / 16, stated=True),
        SweepLaw(LawKind.OCTAVE, 7.0, 0.0, stated=True),
        SweepLaw(LawKind.LINEAR, 7.0, 0.0, stated=True),
    ],
    ids=["octave up", "octave down", "linear up", "linear down", "octave at rest", "linear at rest"],
)
def test_phase_is_the_integral_of_frequency_and_boundaries_are_its_whole_turns(law: SweepLaw):
    t = np.linspace(0.0, 200.0, 400_001)
    frequency = law.frequency_hz(t)
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1]) * np.diff(t))])
    phase = law.phase_rad(t) / (2 * np.pi)
    np.testing.assert_allclose(phase - phase[0], turns, rtol=0, atol=1e-6)
    boundaries = law.cycle_boundaries_s(10.0, 190.0)
    n = np.interp(boundaries, t, phase)
    np.testing.assert_allclose(n, np.round(n), atol=1e-6)
    assert boundaries.min() >= 10.0 - 1e-6
    assert boundaries.max() <= 190.0 + 1e-6
    assert (np.diff(boundaries) > 0).all()
    assert abs(boundaries.size - (np.interp(190.0, t, turns) - np.interp(10.0, t, turns))) <= 1


def test_frequencies_in_closed_form():
    """5 Hz, an octave in 120 s: 10 Hz at 120 s, 5√2 at 60 s."""
    np.testing.assert_allclose(OCTAVE_UP.frequency_hz(np.array([0, 60.0, 120.0])), [5.0, 5 * np.sqrt(2), 10.0])
    linear = SweepLaw(LawKind.LINEAR, 20.0, -0.05, stated=True)
    np.testing.assert_allclose(linear.frequency_hz(np.array([0, 100.0])), [20.0, 15.0])


def test_laws_without_a_phase_have_no_boundaries():
    free = SweepLaw(LawKind.FREE, 7.0, 0.0, stated=False)
    assert np.isnan(free.frequency_hz(np.zeros(3))).all()
    assert free.cycle_boundaries_s(0.0, 10.0).size == 0


T = np.linspace(0.0, 200.0, 801)


@pytest.mark.parametrize(
    ("frequency", "kind", "start", "rate"),
    [
        (5.0 * 2 ** (T / 100), LawKind.OCTAVE, 5.0, 0.01),
        (20.0 * 2 ** (-T / 100), LawKind.OCTAVE, 20.0, -0.01),
        (5.0 + 0.07 * T, LawKind.LINEAR, 5.0, 0.07),
        (20.0 - 0.07 * T, LawKind.LINEAR, 20.0, -0.07),
    ],
)
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_identified_law(frequency, kind, start, rate, noise):
    scatter = 1 + noise * np.random.default_rng(3).standard_normal(T.size)
    law = identify_law(T, frequency * scatter)
    assert law.kind is kind
    assert not law.stated
    assert law.start_hz == pytest.approx(start, rel=1e-9 + noise)
    assert law.rate == pytest.approx(rate, rel=1e-9 + noise)


def test_steps_and_free_runs_are_told_apart():
    assert identify_law(T, 5.0 + 2.0 * np.floor(T / 25)).kind is LawKind.STEPPED
    assert identify_law(T, 12.0 + 6.0 * np.sin(2 * np.pi * T / 67)).kind is LawKind.FREE
    assert identify_law(T[:3], T[:3] + 5).kind is LawKind.FREE


def test_stated_laws():
    assert stated_law(None, 0.1, None) is None
    assert stated_law(5.0, None, None) is None
    assert stated_law(5.0, 0.1, None) == SweepLaw(LawKind.OCTAVE, 5.0, 0.1, stated=True)
    assert stated_law(5.0, None, -0.1) == SweepLaw(LawKind.LINEAR, 5.0, -0.1, stated=True)
