"""Integration steps between two samples: closed forms of how fast a loop forgets."""

from __future__ import annotations

import pytest

from sloshlab.errors import AnalysisError
from sloshlab.identification import integration_steps
from sloshlab.twin.rate_independent_forces import HYSTERESIS


def test_steps_follow_how_fast_a_loop_yields() -> None:
    """v ν/x_y: of 0.2 m/s and 0.1 mm 2000 a second, of exponent 2 twice as many.

    A step lasts two of these times at most, and a power of two of them makes a sample.
    """
    linear = HYSTERESIS(stiffness_n_per_m=1e6, beta_gamma=9e3, beta_delta=1e3)
    squared = HYSTERESIS(stiffness_n_per_m=1e6, beta_gamma=50.0, beta_delta=50.0, exponent=2.0)
    assert linear.memory_rate(0.2) == pytest.approx(2000.0)
    assert squared.memory_rate(0.2) == pytest.approx(4000.0)
    assert integration_steps.steps_of_memory([linear], 100.0, 0.2) == 16
    assert integration_steps.steps_of_memory([linear, squared], 100.0, 0.2) == 32
    # a thousand steps
    with pytest.raises(AnalysisError, match="1000 steps between two samples"):
        integration_steps.steps_of_memory([linear], 1.0, 0.2)
    assert (
        integration_steps.steps_of_memory([linear], 1e4, 0.2)
        == integration_steps.steps_of_memory([], 100.0, 0.2)
        == 1
    )
    # neither a spring nor a loop that opens forever yields
    assert HYSTERESIS(stiffness_n_per_m=0.0, beta_gamma=1.0, beta_delta=0.0).memory_rate(1.0) == 0.0
    assert HYSTERESIS(stiffness_n_per_m=5e4, beta_gamma=800.0, beta_delta=-1100.0).memory_rate(1.0) == 0.0
