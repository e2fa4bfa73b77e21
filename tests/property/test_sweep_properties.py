"""What a sweep analysis must do to work, whatever the run: scale, shift, split, reverse, lose."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import example, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "analytic"))
from motions import sweep

from sloshlab.sweep.cycles import Cycles, evaluate_cycles
from sloshlab.sweep.law import LawKind, SweepLaw
from sloshlab.sweep.motion_phase import measured_phase
from sloshlab.sweep.windows import WindowSettings, evaluate_windows

FEW = settings(max_examples=12, deadline=None, derandomize=True)
MOTION = sweep("octave_up", duration_s=40.0, rate_hz=1000.0)
RATE_HZ = MOTION.sampling_rate_hz
FORCE = 0.7 * MOTION.acceleration + 6.0 * MOTION.velocity + 0.4 * np.cos(3 * MOTION.phase_rad + 0.2)
BOUNDARIES_S = measured_phase(MOTION.acceleration, None, RATE_HZ).cycle_boundaries_s()


def cycles_of(
    force: np.ndarray, acceleration: np.ndarray, boundaries_s: np.ndarray | None = None, **more: Any
) -> Cycles:
    if boundaries_s is None:
        boundaries_s = measured_phase(acceleration, None, RATE_HZ).cycle_boundaries_s()
    return evaluate_cycles(force, acceleration, boundaries_s, sampling_rate_hz=RATE_HZ, **more)


def windows_of(force: np.ndarray, acceleration: np.ndarray, **more: Any) -> xr.Dataset:
    cycles = cycles_of(force, acceleration)
    return evaluate_windows(cycles, run_id="run", law=None, settings=WindowSettings(6, 12), **more)


@FEW
@given(factor=st.floats(0.01, 100.0))
def test_work_of_a_linear_system_goes_with_the_square_of_the_amplitude(factor: float) -> None:
    reference, scaled = (
        windows_of(FORCE, MOTION.acceleration),
        windows_of(factor * FORCE, factor * MOTION.acceleration),
    )
    np.testing.assert_allclose(scaled.work_j, factor**2 * reference.work_j, rtol=1e-8)
    np.testing.assert_allclose(scaled.work_harmonic_j, factor**2 * reference.work_harmonic_j, rtol=1e-8)
    for name in ("gamma_kg_per_s", "apparent_mass_kg", "dissipated_mass_kg", "frequency_hz"):
        np.testing.assert_allclose(scaled[name], reference[name], rtol=1e-8)


@FEW
@given(force_factor=st.floats(-50.0, 50.0))
def test_work_is_linear_in_the_force(force_factor: float) -> None:
    other = 5.0 * np.sign(MOTION.velocity)
    both = cycles_of(FORCE + force_factor * other, MOTION.acceleration, BOUNDARIES_S).work_j
    apart = cycles_of(FORCE, MOTION.acceleration, BOUNDARIES_S).work_j
    apart = apart + force_factor * cycles_of(other, MOTION.acceleration, BOUNDARIES_S).work_j
    used = np.isfinite(both)
    assert used.sum() > 400
    np.testing.assert_allclose(both[used], apart[used], rtol=1e-9, atol=1e-12)


@FEW
@given(start_s=st.floats(-1e4, 1e4))
def test_the_start_time_changes_the_times_and_nothing_else(start_s: float) -> None:
    reference = windows_of(FORCE, MOTION.acceleration)
    shifted = windows_of(FORCE, MOTION.acceleration, start_time_s=start_s)
    np.testing.assert_allclose(shifted.time_s, reference.time_s + start_s, rtol=0, atol=1e-9)
    xr.testing.assert_identical(shifted.drop_vars("time_s"), reference.drop_vars("time_s"))


@pytest.mark.parametrize("start_s", [0.0, 17.25])
def test_the_law_is_compared_at_the_time_from_the_trigger(start_s: float) -> None:
    law = SweepLaw(LawKind.OCTAVE, 5.0 * 2 ** (-start_s / 20.0), 1 / 20.0, stated=True)
    cycles = cycles_of(FORCE, MOTION.acceleration, BOUNDARIES_S)
    windows = evaluate_windows(cycles, run_id="run", law=law, start_time_s=start_s)
    # both phases run alike; what stays is the constant that (1.13) leaves open
    assert np.ptp(windows.phase_error_rad.values) < 0.02
    wrong = evaluate_windows(cycles, run_id="run", law=law, start_time_s=start_s + 0.01)
    assert np.ptp(wrong.phase_error_rad.values) > 0.2


def test_a_run_in_two_files_gives_the_same_cycles() -> None:
    """Split at 22 s with an overlap of 4 s: every cycle that lies well inside one of the parts agrees."""
    whole = cycles_of(FORCE, MOTION.acceleration)
    for part, offset_s in ((slice(0, 24_000), 0.0), (slice(20_000, None), 20.0)):
        piece = cycles_of(FORCE[part], MOTION.acceleration[part])
        start_s = piece.start_s + offset_s
        inside = np.flatnonzero(piece.usable & (start_s > start_s[6]) & (start_s < start_s[-7]))
        partner = np.array([int(np.abs(whole.start_s - cycle_s).argmin()) for cycle_s in start_s[inside]])
        assert inside.size > 150
        np.testing.assert_allclose(start_s[inside], whole.start_s[partner], rtol=0, atol=2e-5)
        np.testing.assert_allclose(piece.work_j[inside], whole.work_j[partner], rtol=2e-3)
        np.testing.assert_allclose(piece.work_j[inside].mean(), whole.work_j[partner].mean(), rtol=2e-5)


def test_given_boundaries_a_split_changes_no_cycle() -> None:
    whole = cycles_of(FORCE, MOTION.acceleration, BOUNDARIES_S)
    second = BOUNDARIES_S[BOUNDARIES_S > 20.1]
    piece = cycles_of(FORCE[20_000:], MOTION.acceleration[20_000:], second - 20.0)
    np.testing.assert_allclose(piece.work_j[:-8], whole.work_j[-piece.work_j.size : -8], rtol=1e-9)


def test_reversing_force_and_motion_leaves_the_work_and_reversing_one_turns_it() -> None:
    reference = windows_of(FORCE, MOTION.acceleration)
    both = windows_of(-FORCE, -MOTION.acceleration)
    # the cycles of the reversed motion begin half a cycle elsewhere; W f³ of a damper at constant acceleration is
    # constant and may be interpolated
    inner = reference.isel(window=slice(1, -2))
    scaled = np.interp(inner.frequency_hz, both.frequency_hz, both.work_j * both.frequency_hz**3)
    np.testing.assert_allclose(scaled, inner.work_j * inner.frequency_hz**3, rtol=5e-4)
    assert (both.work_j > 0).all()
    turned = cycles_of(-FORCE, MOTION.acceleration, BOUNDARIES_S)
    straight = cycles_of(FORCE, MOTION.acceleration, BOUNDARIES_S)
    np.testing.assert_allclose(turned.work_j, -straight.work_j, rtol=1e-12)
    np.testing.assert_allclose(turned.harmonic_work_j, -straight.harmonic_work_j, rtol=1e-12)


NEAR = int(np.ceil(BOUNDARIES_S[200] * RATE_HZ))


@FEW
@example(first=NEAR - 3, n_lost=1, channel="flag")
@example(first=NEAR + 3, n_lost=1, channel="flag")
@example(first=NEAR - 5, n_lost=1, channel="force")
@given(
    first=st.integers(2_000, 37_000),
    n_lost=st.integers(1, 400),
    channel=st.sampled_from(["force", "motion", "flag"]),
)
def test_lost_samples_cost_the_cycles_that_they_touch_and_change_no_other(first, n_lost, channel) -> None:
    force, motion = FORCE.copy(), MOTION.acceleration.copy()
    unusable = np.zeros(force.size, bool)
    {"force": force, "motion": motion}.get(channel, np.zeros(force.size))[first : first + n_lost] = np.nan
    unusable[first : first + n_lost] = channel == "flag"
    whole = cycles_of(FORCE, MOTION.acceleration, BOUNDARIES_S)
    broken = cycles_of(force, motion, BOUNDARIES_S, unusable=unusable)
    from_s, to_s = (first - 6) / RATE_HZ, (first + n_lost + 6) / RATE_HZ
    touched = (whole.stop_s > from_s) & (whole.start_s < to_s)
    np.testing.assert_array_equal(broken.usable, whole.usable & ~touched)
    np.testing.assert_array_equal(broken.work_j[broken.usable], whole.work_j[broken.usable])
    np.testing.assert_array_equal(broken.force_phasor[broken.usable], whole.force_phasor[broken.usable])
