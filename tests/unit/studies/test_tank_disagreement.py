"""The way up and down: the same tank all the way, each level's work at its level."""

import pytest

from studies.numerical_tank_verification.convergence import ConvergenceCase, harmonic_result
from studies.numerical_tank_verification.disagreement import up_and_down


def test_way_up_begins_quietly_and_the_top_is_the_same_on_both_ways() -> None:
    results = up_and_down(0, levels_g=(0.1, 3.0), n_cycles=10, layers=8)
    assert [result.acceleration_g for result in results] == [0.1, 3.0]
    quiet, violent = results
    assert quiet.up == pytest.approx(0.0, abs=0.1)
    assert violent.up == violent.down
    assert 0.3 < violent.up < 3
    assert quiet.down != quiet.up  # the liquid is still in motion from before


@pytest.mark.slow
def test_thick_liquid_resists_the_subharmonic_wave() -> None:
    """Waves of a liquid ten thousand times as thick as water die faster than 0.5 g can feed them."""
    water, thick = (
        harmonic_result(
            ConvergenceCase("wave", 0.5, layers_per_height=8, viscosity_m2_per_s=viscosity, n_cycles=60), 0
        )
        for viscosity in (1e-6, 1e-2)
    )
    assert water.w_bar > 0.2
    assert thick.w_bar == pytest.approx(0.0, abs=0.01)
