"""From which level on a force is there: closed forms of a force that sets in at a level."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.missing_force.force_levels import onset
from sloshlab.missing_force.force_regression import Stretch

OMEGA = 2 * np.pi * 5.0
NOISE_N = 0.1


def of_level(number: int, level_g: float, force_n: float) -> Stretch:
    """Two seconds at one level, at which a force follows the velocity."""
    time = np.arange(400) / 200.0
    a = 9.80665 * level_g * np.sin(OMEGA * time)
    x, v = -a / OMEGA**2, -9.80665 * level_g / OMEGA * np.cos(OMEGA * time)
    noise = NOISE_N * np.random.default_rng(number).standard_normal(time.size)
    force = force_n * np.sign(v) + noise
    level = np.full(time.size, level_g)
    return Stretch(
        number,
        time,
        force,
        x,
        v,
        a,
        x,
        level,
        np.full(time.size, OMEGA),
        np.zeros((time.size, 0)),
        np.ones(time.size),
    )


def test_a_force_that_sets_in_is_placed_between_levels_though_draws_lack_some() -> None:
    """Of six stretches, drawn with replacement, most draws have no sample of some level."""
    levels = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2)
    parts = [of_level(k, level, 2.0 if level > 0.5 else 0.0) for k, level in enumerate(levels)]
    found = onset(parts, np.zeros(3), NOISE_N, np.random.default_rng(1))
    assert found is not None
    value, low, high, at_lowest = found
    assert not at_lowest
    assert 0.1 <= low <= value <= high
    assert value == pytest.approx(0.6, abs=0.25)
