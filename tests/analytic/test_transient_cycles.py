"""Works per cycle of a known damper whose motion starts from rest."""

import numpy as np
import pytest

from sloshlab.sweep.transient_cycles import cycle_works_j, upward_crossings_s

RATE_HZ, START_S, OMEGA = 128.0, 1.0, 2 * np.pi * 10.87


def decay(damping: float = 0.0):
    """From rest upward at 1 s: v = e^(−δt) sin Ωt."""
    time_s = np.arange(600) / RATE_HZ - START_S
    return np.where(time_s > 0, np.exp(-damping * time_s) * np.sin(OMEGA * time_s), 0.0)


def test_work_of_a_damper_is_pi_c_v_squared_over_omega():
    works = cycle_works_j(decay(), -2.5 * decay(), RATE_HZ, START_S)
    assert works[:20] == pytest.approx(2.5 * np.pi / OMEGA, rel=0.02)
    assert cycle_works_j(decay(), 2.5 * decay(), RATE_HZ, START_S)[0] < 0  # the liquid gives


def test_cycles_of_a_decay_last_a_period_and_what_is_unknown_does_no_work():
    velocity = decay(3.0)
    ends = upward_crossings_s(velocity, RATE_HZ, START_S)
    assert ends[0] == START_S
    assert np.diff(ends)[:15] == pytest.approx(2 * np.pi / OMEGA, rel=0.01)
    works = cycle_works_j(velocity, -velocity, RATE_HZ, START_S)
    assert works[1:6] / works[:5] == pytest.approx(np.exp(-2 * 3.0 * 2 * np.pi / OMEGA), rel=0.02)
    assert cycle_works_j(velocity, np.full(600, np.nan), RATE_HZ, START_S)[:5] == pytest.approx(0.0)
