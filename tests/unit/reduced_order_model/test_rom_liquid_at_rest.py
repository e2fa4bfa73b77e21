"""Sudden starts: velocity from rest, in spite of the offset of the accelerometer."""

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.liquid_at_rest import from_rest
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals

RATE_HZ, OMEGA = 512.0, 2 * np.pi * 10.87
TIME_S = np.arange(round(5.0 * RATE_HZ)) / RATE_HZ


def signals(acceleration):
    return LiquidSignals(np.full(TIME_S.size, 9.0), np.sin(TIME_S), acceleration, RATE_HZ, "run")


def cosine():
    """ü = a cos Ωt from rest: u̇ = a/Ω sin Ωt."""
    return 30.0 * np.cos(OMEGA * TIME_S), 30.0 / OMEGA * np.sin(OMEGA * TIME_S)


def decay():
    """u̇ = V e^(−δt) sin Ωt."""
    envelope = 0.9 * np.exp(-3.0 * TIME_S)
    return envelope * (OMEGA * np.cos(OMEGA * TIME_S) - 3.0 * np.sin(OMEGA * TIME_S)), envelope * np.sin(
        OMEGA * TIME_S
    )


@pytest.mark.parametrize("motion", [cosine, decay])
def test_velocity_from_rest(motion):
    acceleration, velocity = motion()
    found = from_rest(signals(acceleration + 0.4), rest_s=0.5)
    assert np.all(found.velocity_m_per_s[:256] == 0)
    np.testing.assert_allclose(found.velocity_m_per_s[256:], velocity, atol=1e-3 * np.abs(velocity).max())
    np.testing.assert_allclose(found.acceleration_m_per_s2[256:], acceleration, atol=1e-2)
    assert np.array_equal(found.dynamic_force_n[256:], np.sin(TIME_S))


def test_at_a_lower_rate_the_rest_is_known_from_the_beginning():
    acceleration, velocity = cosine()
    found = from_rest(signals(acceleration), 128.0, rest_s=1.0)
    assert found.sampling_rate_hz == 128.0
    assert np.isfinite(found.velocity_m_per_s[:600]).all()
    assert np.abs(found.velocity_m_per_s[:100]).max() < 1e-3
    np.testing.assert_allclose(found.velocity_m_per_s[160:600], velocity[4 * 32 : 4 * 472 : 4], atol=2e-3)


def test_a_gap_is_refused():
    acceleration, _ = cosine()
    acceleration[100] = np.nan
    with pytest.raises(AnalysisError, match="lost samples"):
        from_rest(signals(acceleration))
