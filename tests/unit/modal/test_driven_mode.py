"""A driven mode by least squares: its numbers on responses that scipy integrated, and when there is none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from sloshlab.modal.driven_mode import driven_mode, resonance_hz, transfer_of

RATE_HZ, N = 200.0, 1600
TIME = np.arange(N) / RATE_HZ


def _drive(seed: int) -> np.ndarray:
    """Multisine between 2 and 20 Hz with random phases."""
    lines = np.arange(16, 161) / 8.0
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, lines.size)
    return np.cos(2 * np.pi * lines[:, None] * TIME + phases[:, None]).sum(axis=0)


def _acceleration(drive: np.ndarray, frequency_hz: float, ratio: float, start: float = 0.01) -> np.ndarray:
    """Of ẍ + 2ζω ẋ + ω² x = u, let go from a deflection while it is driven."""
    omega, force = 2 * np.pi * frequency_hz, CubicSpline(TIME, drive)

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], float(force(t)) - 2 * ratio * omega * y[1] - omega**2 * y[0]]

    found = solve_ivp(rates, (0, TIME[-1]), [start, 0.0], t_eval=TIME, rtol=1e-8, atol=1e-10, max_step=0.005)
    return drive - 2 * ratio * omega * found.y[1] - omega**2 * found.y[0]


@pytest.mark.parametrize(("frequency_hz", "ratio"), [(6.42, 0.0068), (9.0, 0.03)])
def test_frequency_and_damping_of_one_mode(frequency_hz: float, ratio: float) -> None:
    """From rest or not; a record shorter than the decay, so that lines do not resolve the mode."""
    drive = _drive(1)
    response = _acceleration(drive, frequency_hz, ratio)
    found = driven_mode(drive, response, RATE_HZ, near_hz=1.04 * frequency_hz)
    assert found is not None
    # A straight line between 6 samples a cycle misses 5 % of the drive, in amplitude alone.
    assert found.frequency_hz == pytest.approx(frequency_hz, rel=1e-3)
    assert found.damping_ratio == pytest.approx(ratio, rel=0.03)
    np.testing.assert_allclose(found.influence.sum(axis=0), 0.0, atol=1e-5)


@pytest.mark.slow
def test_errors_are_as_large_as_the_scatter() -> None:
    """Over forty draws of noise a quarter as large as the response, by clusters of twelve blocks."""
    drive = _drive(2)
    response = _acceleration(drive, 7.0, 0.02)
    generator = np.random.default_rng(3)
    found = [
        driven_mode(drive, response + 0.25 * response.std() * generator.standard_normal(N), RATE_HZ, near_hz=7.1)
        for _ in range(40)
    ]
    frequencies = np.array([mode.frequency_hz for mode in found if mode])
    errors = np.sqrt([(mode.influence**2).sum(axis=0)[0] * 12 / 10 for mode in found if mode])
    assert frequencies.size == 40
    assert frequencies.std() / 7.0 == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.35)
    assert abs(frequencies.mean() / 7.0 - 1) < 3 * frequencies.std() / 7.0 / np.sqrt(40)


def test_no_mode_in_a_stiff_response() -> None:
    """A response that follows the drive has none, and neither has noise."""
    drive, generator = _drive(4), np.random.default_rng(5)
    stiff = 3.0 * drive + 0.1 * generator.standard_normal(N)
    assert driven_mode(drive, stiff, RATE_HZ, near_hz=7.0) is None
    assert driven_mode(drive, generator.standard_normal(N), RATE_HZ, near_hz=7.0) is None
    transfer = transfer_of(np.stack([drive, stiff]), RATE_HZ)
    assert resonance_hz(transfer, transfer) is None


def test_transfer_and_its_variance() -> None:
    """A gain of 3 under white noise; the squared errors of driven lines over their variances have the mean one."""
    drive, generator = _drive(6), np.random.default_rng(7)
    ratios = []
    for _ in range(60):
        found = transfer_of(np.stack([drive, 3.0 * drive + 2.0 * generator.standard_normal(N)]), RATE_HZ)
        ratios.append(np.abs(found.value - 3.0)[found.is_driven] ** 2 / found.variance[found.is_driven])
    # Five segments that overlap: their scatter is a rough estimate, and its inverse larger on average.
    assert 0.5 < np.median(np.concatenate(ratios)) < 1.2


def test_resonance_is_found_between_driven_lines() -> None:
    """Within a line of 1/2.67 s of the mode."""
    drive = _drive(8)
    transfer = transfer_of(np.stack([drive, _acceleration(drive, 9.0, 0.03)]), RATE_HZ)
    assert resonance_hz(transfer, transfer) == pytest.approx(9.0, abs=0.5)
