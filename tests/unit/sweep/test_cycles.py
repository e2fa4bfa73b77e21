"""Cycles of a recording: what they do not depend on."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.sweep import cycles as cycles_module
from sloshlab.sweep.cycles import Cycles, evaluate_cycles

RATE_HZ = 500.0
TIME_S = np.arange(5_000) / RATE_HZ
ACCELERATION = 4.0 * np.cos(2.0 * np.pi * 8.0 * TIME_S)
FORCE = 1.5 * ACCELERATION + 0.3 * np.sin(2.0 * np.pi * 8.0 * TIME_S)
BOUNDARIES_S = np.arange(5, 70) / 8.0


def cycles_of(force: np.ndarray, acceleration: np.ndarray) -> Cycles:
    return evaluate_cycles(force, acceleration, BOUNDARIES_S, sampling_rate_hz=RATE_HZ)


def not_writable(array: np.ndarray) -> np.ndarray:
    copy = array.copy()
    copy.flags.writeable = False
    return copy


@pytest.mark.parametrize("force_is_writable", [True, False])
@pytest.mark.parametrize("acceleration_is_writable", [True, False])
def test_samples_that_may_not_be_written_to_are_read_by_the_same_loop(
    force_is_writable: bool, acceleration_is_writable: bool
) -> None:
    """Two loops compiled from one source may round differently: a mapped file would have other last digits."""
    whole = cycles_of(FORCE, ACCELERATION)
    loops = set(cycles_module._kernel.signatures)
    other = cycles_of(
        FORCE if force_is_writable else not_writable(FORCE),
        ACCELERATION if acceleration_is_writable else not_writable(ACCELERATION),
    )
    assert set(cycles_module._kernel.signatures) == loops
    np.testing.assert_array_equal(other.force_phasor, whole.force_phasor)
    np.testing.assert_array_equal(other.work_j, whole.work_j)


def test_the_arrays_of_the_caller_stay_writable() -> None:
    force, acceleration = FORCE.copy(), ACCELERATION.copy()
    cycles_of(force, acceleration)
    assert force.flags.writeable
    assert acceleration.flags.writeable
