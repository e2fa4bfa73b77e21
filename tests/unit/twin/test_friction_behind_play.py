"""What a slider behind a play takes from a cycle, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.twin.excitation import free
from sloshlab.twin.rate_independent_forces import FRICTION_BEHIND_PLAY, FRICTION_BEHIND_PLAY_BY_DIRECTION
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.twin import Twin

PLAY_M, STIFFNESS, AMPLITUDE_M = 0.004, 2000.0, 0.02


@pytest.mark.parametrize(("up_n", "down_n"), [(3.0, 3.0), (3.0, 1.0), (0.5, 2.5)])
def test_a_cycle_loses_both_forces_over_what_the_slider_is_moved(up_n: float, down_n: float) -> None:
    """(F₊ + F₋)(2A − p − (F₊ + F₋)/k): after each reversal it is left behind by p and both deflections."""
    term = FRICTION_BEHIND_PLAY_BY_DIRECTION(
        force_up_n=up_n, force_down_n=down_n, play_m=PLAY_M, stiffness_n_per_m=STIFFNESS
    )
    # a thousand tonnes at 1 Hz, whose motion the slider does not change
    heavy = single_degree_of_freedom(1e6, 1e6 * (2 * np.pi) ** 2)
    work = -Twin(heavy).with_term(term).simulate(free(3.0, 1000.0), initial_displacement_m=AMPLITUDE_M).works_j
    both = up_n + down_n
    expected = both * (2 * AMPLITUDE_M - PLAY_M - both / STIFFNESS)
    assert work[2000, 0] - work[1000, 0] == pytest.approx(expected, rel=1e-4)


def test_equal_forces_are_the_form_without_a_direction() -> None:
    light = single_degree_of_freedom(2.0, 3200.0)
    terms = (
        FRICTION_BEHIND_PLAY(force_n=1.5, play_m=PLAY_M, stiffness_n_per_m=STIFFNESS),
        FRICTION_BEHIND_PLAY_BY_DIRECTION(
            force_up_n=1.5, force_down_n=1.5, play_m=PLAY_M, stiffness_n_per_m=STIFFNESS
        ),
    )
    x = [
        Twin(light).with_term(term).simulate(free(2.0, 500.0), initial_displacement_m=0.01).displacement_m
        for term in terms
    ]
    np.testing.assert_allclose(x[0], x[1], atol=1e-12)
