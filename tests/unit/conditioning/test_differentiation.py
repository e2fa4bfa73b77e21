"""The central difference over seven samples against closed forms."""

import numpy as np
import pytest

from sloshlab.conditioning.differentiation import differentiated


def test_a_polynomial_of_degree_six_is_differentiated_exactly():
    time_s = np.arange(40) / 16.0
    found = differentiated(time_s**6 - 2.0 * time_s, 16.0)
    # rounding of values up to 200, over a step of 1/16
    assert found[3:-3] == pytest.approx(6 * time_s[3:-3] ** 5 - 2.0, abs=1e-10)
    assert np.isnan(found[[0, 2, -3, -1]]).all()


def test_a_sine_loses_the_stated_amplitude_and_no_phase():
    rate_hz, omega = 1000.0, 2 * np.pi * 60.0
    time_s = np.arange(3000) / rate_hz
    found = differentiated(np.sin(omega * time_s), rate_hz)[3:-3]
    gain, leading = np.linalg.lstsq(
        np.column_stack([np.cos(omega * time_s), np.sin(omega * time_s)])[3:-3], found / omega, rcond=None
    )[0]
    assert 1 - gain == pytest.approx((omega / rate_hz) ** 6 / 140, rel=0.1)  # the next order is (ω Δt)² of it
    assert leading == pytest.approx(0.0, abs=1e-12)


def test_a_lost_sample_costs_three_on_each_side():
    values = np.arange(20.0)
    values[10] = np.nan
    assert np.flatnonzero(np.isnan(differentiated(values, 1.0)[3:-3])).tolist() == list(range(4, 11))
