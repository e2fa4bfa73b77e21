"""The table of what W̄ and β depend on: its work against the energy account, its rows by hand."""

import pytest

from studies.numerical_tank_verification.convergence import ConvergenceCase, HarmonicResult, harmonic_result, row


def test_work_is_what_the_account_of_energy_says() -> None:
    """Force × velocity of the tank, and inertial force × velocity of the particles, are the same work."""
    case = ConvergenceCase("coarse", 3.0, layers_per_height=8, n_cycles=24)
    result = harmonic_result(case, 0)
    assert 0.3 < result.w_bar < 3
    assert result.w_bar == pytest.approx(result.account_w_bar, abs=0.03)
    assert abs(result.residual_share) < 0.05


def test_a_quiet_liquid_moves_as_a_solid() -> None:
    result = harmonic_result(ConvergenceCase("quiet", 0.2, layers_per_height=8, n_cycles=8), 0)
    assert result.w_bar == pytest.approx(0.0, abs=0.02)
    assert result.beta == pytest.approx(0.0, abs=0.05)


def test_row_shows_mean_and_standard_error() -> None:
    results = [HarmonicResult(1.0, -0.1, 1.0, -0.2, 0.01), HarmonicResult(2.0, -0.3, 2.0, -0.2, 0.03)]
    assert (
        row(ConvergenceCase("h/8", 2.5), results)
        == "| 2.5 g | h/8 | 1.50 ± 0.50 | −0.200 ± 0.100 | −20 % | 2.0 % |"
    )
