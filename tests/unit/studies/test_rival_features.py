"""Features of signals whose spectra, growth and phases are known."""

from __future__ import annotations

import numpy as np
import pytest

from studies.rivals.signal_features import band_shares, growth, phase_shares

RATE_HZ = 500.0
TIME = np.arange(5000) / RATE_HZ
OMEGA = 2 * np.pi * 7.0


def test_powers_of_harmonics_are_the_squares_of_their_amplitudes() -> None:
    """1² + ½² + ¼²: shares of 16, 4 and 1 of 21."""
    signal = np.sin(OMEGA * TIME) + 0.5 * np.sin(2 * OMEGA * TIME) + 0.25 * np.sin(3 * OMEGA * TIME)
    shares = band_shares(signal, RATE_HZ, 7.0)
    # Lines leak a millionth of their power out of a Hann window's main lobe.
    assert shares["first"] == pytest.approx(16 / 21, abs=1e-4)
    assert shares["second"] == pytest.approx(4 / 21, abs=1e-4)
    assert shares["third"] == pytest.approx(1 / 21, abs=1e-4)
    assert sum(shares.values()) == pytest.approx(1.0)


def test_a_wave_at_half_the_frequency_is_in_the_band_of_halves() -> None:
    assert band_shares(np.cos(0.5 * OMEGA * TIME), RATE_HZ, 7.0)["half"] == pytest.approx(1.0, abs=1e-4)


def test_a_silent_channel_has_no_shares() -> None:
    assert band_shares(np.zeros(100), RATE_HZ, 7.0) == {}


def test_growth_is_the_rate_of_an_exponential() -> None:
    assert growth(3.0 * np.exp(-1.5 * np.linspace(0, 1, 4))) == pytest.approx(-1.5)
    assert growth(np.array([2.0])) == 0.0


@pytest.mark.parametrize(("order", "sign"), [(0, -1.0), (1, -1.0), (2, 1.0)])
def test_a_force_along_one_of_the_motion_has_the_sign_of_its_coefficient(order: int, sign: float) -> None:
    """Whole periods: displacement and velocity are orthogonal, displacement and acceleration opposite."""
    x, v, a = np.sin(OMEGA * TIME), OMEGA * np.cos(OMEGA * TIME), -(OMEGA**2) * np.sin(OMEGA * TIME)
    motion = np.stack([x, v, a], axis=1)
    shares = phase_shares(sign * 4.0 * motion[:, order], motion)
    expected = {"x": -1.0, "v": 0.0, "a": 1.0} if order != 1 else {"x": 0.0, "v": -1.0, "a": 0.0}
    assert shares == pytest.approx(expected, abs=1e-9)
