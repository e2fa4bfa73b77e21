"""Stretches of runs."""

import numpy as np

from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from studies.beyond_the_source.recordings import part

RATE_HZ = 128.0


def test_a_part_is_a_stretch_of_all_signals():
    values = np.arange(600.0)
    found = part(LiquidSignals(values, values + 1, values + 2, RATE_HZ, "run"), 1.0, 2.0)
    assert found.velocity_m_per_s.tolist() == values[128:256].tolist()
    assert found.dynamic_force_n[0] == 129
    assert found.acceleration_m_per_s2[-1] == 257
