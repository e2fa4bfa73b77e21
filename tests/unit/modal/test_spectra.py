"""Welch spectra: scaling, coherence and intervals against what is known of white noise and of filters."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal as signals

from sloshlab.errors import AnalysisError
from sloshlab.modal.spectra import random_spectra

RATE_HZ = 200.0


def test_a_sine_has_its_mean_square_and_white_noise_its_density() -> None:
    time = np.arange(40_000) / RATE_HZ
    noise = np.random.default_rng(1).normal(0, 0.5, time.size)
    spectra = random_spectra(noise, 3.0 * np.sin(2 * np.pi * 20 * time), RATE_HZ, segment_length=400)
    near = np.abs(spectra.frequency_hz - 20) < 3
    spacing = spectra.normalisation.line_spacing_hz
    assert spectra.output_psd[0, near].sum() * spacing == pytest.approx(9 / 2, rel=1e-6)
    # one-sided density of white noise: σ²/(f_s/2); 200 lines with some 190 averages
    assert spectra.input_psd[:-1].mean() == pytest.approx(0.25 / 100, rel=0.02)


def test_densities_are_those_of_an_independent_implementation() -> None:
    generator = np.random.default_rng(2)
    x, y = generator.normal(size=(2, 5000))
    spectra = random_spectra(x, y, RATE_HZ, segment_length=256)
    _, reference = signals.csd(x, y, RATE_HZ, nperseg=256, detrend="constant")
    np.testing.assert_allclose(spectra.cross_psd[0], reference[1:], rtol=1e-9)
    _, reference = signals.coherence(x, y, RATE_HZ, nperseg=256, detrend="constant")
    np.testing.assert_allclose(spectra.coherence[0], reference[1:], rtol=1e-9)


def test_h1_is_free_of_output_noise_and_h2_of_input_noise() -> None:
    generator = np.random.default_rng(3)
    x = generator.normal(size=400_000)
    y = signals.lfilter([0.5, 0.3], [1, -0.4], x)
    _, true = signals.freqz([0.5, 0.3], [1, -0.4], worN=[2 * np.pi * 30 / RATE_HZ])
    noise = generator.normal(size=x.size)
    by_output = random_spectra(x, y + noise, RATE_HZ, segment_length=1000)
    by_input = random_spectra(x + noise, y, RATE_HZ, segment_length=1000)
    line = int(np.argmin(np.abs(by_output.frequency_hz - 30)))
    near = slice(line - 10, line + 11)
    assert by_output.h1[0, near].mean() == pytest.approx(true[0], rel=0.02)
    assert by_input.h2[0, near].mean() == pytest.approx(true[0], rel=0.02)
    # input noise of the input's own power halves H₁ and the coherence
    assert abs(by_input.h1[0, near].mean()) == pytest.approx(abs(true[0]) / 2, rel=0.03)
    assert by_input.coherence[0, near].mean() == pytest.approx(0.5, abs=0.03)


def test_intervals_hold_in_nine_of_ten_repeats() -> None:
    generator = np.random.default_rng(4)
    held_psd, held_h1, errors, claimed = [], [], [], []
    for _ in range(200):
        x, noise = generator.normal(size=(2, 4000))
        spectra = random_spectra(x, 2.0 * x + noise, RATE_HZ, segment_length=200)
        low, high = spectra.output_psd_interval
        # variance 4 + 1 over the band of 100 Hz; every fifth line is independent of the others
        held_psd.append(((low <= 0.05) & (high >= 0.05))[0, 5:-5:5].mean())
        held_h1.append((np.abs(spectra.h1 - 2.0) <= spectra.h1_radius)[0, 5:-5:5].mean())
        errors.append(spectra.h1[0, 5:-5:5] - 2.0)
        claimed.append(spectra.h1_std[0, 5:-5:5])
    assert np.mean(held_psd) == pytest.approx(0.90, abs=0.02)
    assert np.mean(held_h1) == pytest.approx(0.90, abs=0.02)
    # real and imaginary part alike; 3600 values give the scatter within 1.2 %
    assert np.std(np.real(errors)) == pytest.approx(np.sqrt(np.mean(np.square(claimed))), rel=0.05)
    assert np.std(np.imag(errors)) == pytest.approx(np.sqrt(np.mean(np.square(claimed))), rel=0.05)


@pytest.mark.parametrize("size", [0.0, 1e-120])
def test_an_output_that_hardly_moves_has_no_h2_or_a_right_one(size: float) -> None:
    x = np.random.default_rng(7).normal(size=2000)
    spectra = random_spectra(x, np.stack([size * x, x]), RATE_HZ, segment_length=200)
    assert spectra.h2[0] == pytest.approx(np.full(100, size or np.nan), rel=1e-9, abs=0, nan_ok=True)
    assert spectra.h2[1] == pytest.approx(np.ones(100), rel=1e-9)


def test_normalisation_goes_with_the_result() -> None:
    x = np.random.default_rng(5).normal(size=2000)
    spectra = random_spectra(x, np.stack([x, -x]), RATE_HZ, segment_length=200, output_names=("tip", "root"))
    dataset = spectra.to_dataset()
    assert dataset.attrs["spectrum_window"] == "hann"
    assert dataset.attrs["spectrum_n_segments"] == 19
    # Hann: 1.5 lines; 50 % overlap leaves 1/(1 + 2/36) of the averages
    assert dataset.attrs["spectrum_effective_bandwidth_hz"] == pytest.approx(1.5)
    assert dataset.attrs["spectrum_n_effective_averages"] == pytest.approx(19 / (1 + 2 / 36 * 18 / 19), rel=1e-3)
    assert dataset.frf_h1_real.sel(output="root").values == pytest.approx(-1.0)


def test_segments_with_gaps_are_left_out() -> None:
    x = np.random.default_rng(6).normal(size=2000)
    y = x.copy()
    y[300] = np.nan
    spectra = random_spectra(x, y, RATE_HZ, segment_length=200)
    assert spectra.normalisation.n_segments == 17
    assert np.isfinite(spectra.h1).all()


@pytest.mark.parametrize(
    ("n_samples", "options", "match"),
    [
        (250, {"segment_length": 200}, "at least 2"),
        (2000, {"segment_length": 200, "overlap": 0.95}, "overlap"),
        (2000, {"segment_length": 4}, "segments of at least 8"),
        # refused before a window of that length is made
        (2000, {"segment_length": 10**13}, "of which at least 2 fit"),
    ],
)
def test_runs_that_are_too_short_are_refused(n_samples: int, options: dict, match: str) -> None:
    with pytest.raises(AnalysisError, match=match):
        random_spectra(np.ones(n_samples), np.ones(n_samples), RATE_HZ, **options)
