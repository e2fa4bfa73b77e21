"""Frequency, damping and limit cycle against the oscillations that they were made of."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sloshlab.aircraft.oscillation_measures import oscillation_amplitudes, oscillation_measures

TIME = np.arange(0.0, 40.0, 1e-3)


@pytest.mark.parametrize(("ratio", "fate"), [(0.03, "decays"), (-0.004, "grows"), (0.0, "limit cycle")])
def test_an_exponential_has_its_frequency_damping_and_fate(ratio: float, fate: str) -> None:
    """e^{−ζω₀t} cos ωt on a slow drift: δ over a period is 2πζ/√(1 − ζ²), whatever the phase."""
    natural = 2 * math.pi * 4.7
    omega = natural * math.sqrt(1 - ratio**2)
    values = 0.02 * np.exp(-ratio * natural * TIME) * np.cos(omega * TIME - 0.4) + 1e-4 * TIME
    found = oscillation_measures(TIME, values, start_s=0.3)
    assert found.frequency_hz == pytest.approx(omega / (2 * math.pi), rel=1e-5)
    assert found.damping_ratio == pytest.approx(ratio, abs=3e-4)
    assert found.fate == fate
    if fate != "decays":
        assert found.late_frequency_hz == pytest.approx(omega / (2 * math.pi), rel=1e-3)
        assert found.late_growth_per_s == pytest.approx(-ratio * natural, abs=2e-3)
    assert math.isfinite(found.limit_cycle) == (fate == "limit cycle")


def test_the_amplitude_of_a_limit_cycle_is_that_of_van_der_pol() -> None:
    """ẍ − µ(1 − x²)ẋ + x = 0 ends on amplitude 2 for small µ, from below and from above."""
    for start in (0.1, 4.0):
        # averaged: a' = µ a/2 (1 − a²/4), so that a² = 4/(1 + (4/a₀² − 1) e^{−µt})
        mu, omega = 1.0, 2 * math.pi * 3
        amplitude = 2 / np.sqrt(1 + (4 / start**2 - 1) * np.exp(-mu * TIME))
        found = oscillation_measures(TIME, amplitude * np.sin(omega * TIME))
        assert found.fate == "limit cycle"
        assert found.limit_cycle == pytest.approx(2.0, rel=1e-3)


def test_amplitudes_do_not_see_a_drift_and_need_a_trough_on_both_sides() -> None:
    time = np.arange(0.0, 3.0, 1e-3)
    peak_s, amplitude = oscillation_amplitudes(time, 0.5 * np.sin(2 * math.pi * 2 * time) + 0.2 * time)
    # peaks of the sine lie at 1/8 + n/2 s, the first without a trough before it
    # a slope of 0.2/s moves them by asin(0.2/(0.5·4π))/4π s
    late_s = math.asin(0.2 / (0.5 * 4 * math.pi)) / (4 * math.pi)
    np.testing.assert_allclose(peak_s, 0.125 + 0.5 * np.arange(1, 6) + late_s, atol=1e-6)
    np.testing.assert_allclose(amplitude, 0.5, rtol=5e-3)


def test_what_does_not_move_is_at_rest() -> None:
    assert oscillation_measures(TIME, np.zeros_like(TIME)).fate == "at rest"
    assert oscillation_measures(TIME[:2], np.array([0.0, 1.0])).fate == "at rest"
