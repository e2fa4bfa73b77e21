"""One mode from the density of a response alone: resonators with known poles in noise that is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal as signals

from sloshlab.errors import AnalysisError
from sloshlab.modal.output_only_fit import DensityFit, fit_density
from sloshlab.modal.spectra import random_spectra

RATE_HZ, FREQUENCY_HZ = 50.0, 10.87


def response(damping_ratio: float, n_samples: int, generator: np.random.Generator) -> np.ndarray:
    """White noise through the sampled poles e^{p/f_s} of a mode, with a little noise on top."""
    omega = 2 * np.pi * FREQUENCY_HZ
    pole = np.exp((-damping_ratio * omega + 1j * omega * np.sqrt(1 - damping_ratio**2)) / RATE_HZ)
    residue = 0.7j
    numerator = [2 * residue.real, -2 * (residue * np.conj(pole)).real]
    driven = signals.lfilter(numerator, [1.0, -2 * pole.real, abs(pole) ** 2], generator.normal(size=n_samples))
    return np.asarray(driven + generator.normal(0, 0.05, n_samples))


def fitted(motion: np.ndarray, segment_s: float) -> DensityFit:
    spectra = random_spectra(motion, motion, RATE_HZ, segment_length=round(segment_s * RATE_HZ))
    return fit_density(
        spectra.frequency_hz,
        spectra.output_psd[0],
        frequency_range_hz=(7.0, 15.0),
        n_effective_averages=spectra.normalisation.n_effective_averages,
    )


@pytest.mark.parametrize(("damping_ratio", "duration_s", "segment_s"), [(0.005, 300, 30), (0.025, 90, 15)])
def test_damping_and_its_interval_over_repeats(damping_ratio: float, duration_s: int, segment_s: float) -> None:
    """ζ = 0.5 % is three lines of 1/30 Hz wide and comes out without the broadening of the window."""
    generator = np.random.default_rng(12)
    fits = [fitted(response(damping_ratio, round(duration_s * RATE_HZ), generator), segment_s) for _ in range(100)]
    damping = np.array([fit.damping_ratio for fit in fits])
    claimed = np.array([fit.damping_ratio_std for fit in fits])
    # the mean of 100 repeats is known within a tenth of the scatter, 1 %; three of those
    assert damping.mean() == pytest.approx(damping_ratio, rel=0.03)
    assert np.mean([fit.frequency_hz for fit in fits]) == pytest.approx(FREQUENCY_HZ, rel=1e-3)
    # errors of neighbouring lines are taken as correlated as they can be: never too narrow, up to a third too wide
    assert 0.85 <= claimed.mean() / damping.std() <= 1.45
    held = [low <= damping_ratio <= high for low, high in (fit.damping_ratio_interval for fit in fits)]
    assert np.mean(held) >= 0.85
    assert np.mean([fit.misfit for fit in fits]) == pytest.approx(1.0, abs=0.15)


def test_a_sloping_background_moves_nothing() -> None:
    """Exact densities: noise that falls as 1 − x/3 over the band, seen through the window's line shape."""
    f = np.arange(1, 500) * 0.05
    y = (f / FREQUENCY_HZ) ** 2
    density = (1 - (f / FREQUENCY_HZ - 1) / 3) / ((1 - y) ** 2 + 4 * 0.03**2 * y)
    seen = np.convolve(density, [1 / 6, 2 / 3, 1 / 6], mode="same")  # |W|² of a Hann window at whole lines
    fit = fit_density(f, seen, frequency_range_hz=(7.0, 15.0), n_effective_averages=10)
    # at whole lines the line shape is only summed, not integrated
    assert fit.damping_ratio == pytest.approx(0.03, rel=0.01)
    assert fit.frequency_hz == pytest.approx(FREQUENCY_HZ, rel=1e-4)
    assert fit.half_power_width_in_lines == pytest.approx(2 * 0.03 * FREQUENCY_HZ / 0.05, rel=0.01)


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_units_do_not_matter(factor: float) -> None:
    motion = response(0.02, 3000, np.random.default_rng(1))
    plain, scaled = fitted(motion, 10.0), fitted(np.sqrt(factor) * motion, 10.0)
    assert scaled.damping_ratio == pytest.approx(plain.damping_ratio, rel=1e-4)
    assert scaled.density == pytest.approx(factor * plain.density, rel=1e-3)


@pytest.mark.parametrize(
    ("density", "match"),
    [
        (np.linspace(1, 2, 400), "no mode between"),
        (np.where(np.arange(400) == 200, np.nan, 1.0), "lines with power"),
        (np.zeros(400), "lines with power"),
    ],
)
def test_what_is_no_mode_is_refused(density: np.ndarray, match: str) -> None:
    with pytest.raises(AnalysisError, match=match) as error:
        fit_density(np.arange(1, 401) * 0.05, density, frequency_range_hz=(7.0, 15.0), n_effective_averages=10)
    assert "\n" not in str(error.value)


def test_too_few_lines_are_refused() -> None:
    with pytest.raises(AnalysisError, match="at least 12 lines"):
        fit_density(np.arange(1, 20.0), np.ones(19), frequency_range_hz=(7.0, 15.0), n_effective_averages=10)
