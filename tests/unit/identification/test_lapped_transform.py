"""The lapped transform is orthonormal, lets tones land in their bands, and forgets nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sloshlab.identification.lapped_transform import band_frequencies_hz, block_times_s, lapped_spectra


def basis(n_bands: int, n_samples: int) -> np.ndarray:
    """√(2/N) sin(π (i + ½)/(2N)) cos(π/N (i + ½ + N/2)(k + ½)), block after block (Princen and Bradley)."""
    i, k = np.arange(2 * n_bands)[:, None], np.arange(n_bands)[None, :]
    window = np.sin(np.pi * (i + 0.5) / (2 * n_bands))
    block = np.sqrt(2 / n_bands) * window * np.cos(np.pi / n_bands * (i + 0.5 + n_bands / 2) * (k + 0.5))
    n_blocks = -(-n_samples // n_bands) + 1
    whole = np.zeros(((n_blocks + 1) * n_bands, n_blocks * n_bands))
    for b in range(n_blocks):
        whole[b * n_bands : (b + 2) * n_bands, b * n_bands : (b + 1) * n_bands] = block
    return whole[n_bands : n_bands + n_samples]


@pytest.mark.parametrize(("n_bands", "n_samples"), [(8, 50), (16, 16), (10, 7), (32, 200)])
def test_coefficients_are_those_of_the_published_basis(n_bands: int, n_samples: int) -> None:
    signal = np.random.default_rng(3).normal(size=n_samples)
    expected = (signal @ basis(n_bands, n_samples)).reshape(-1, n_bands)
    np.testing.assert_allclose(lapped_spectra(signal, n_bands), expected, atol=1e-12)


@pytest.mark.parametrize(("n_bands", "n_samples"), [(8, 50), (16, 16), (10, 7), (32, 200)])
def test_the_basis_gives_the_signal_back(n_bands: int, n_samples: int) -> None:
    signal = np.random.default_rng(4).normal(size=n_samples)
    back = basis(n_bands, n_samples) @ lapped_spectra(signal, n_bands).ravel()
    np.testing.assert_allclose(back, signal, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    n_bands=st.sampled_from([2, 8, 30, 64]),
    n_samples=st.integers(1, 400),
    scale=st.floats(1e-6, 1e6),
    seed=st.integers(0, 99),
)
def test_energy_is_kept(n_bands: int, n_samples: int, scale: float, seed: int) -> None:
    signal = scale * np.random.default_rng(seed).normal(size=n_samples)
    assert np.sum(lapped_spectra(signal, n_bands) ** 2) == pytest.approx(np.sum(signal**2), rel=1e-10)


@pytest.mark.parametrize("frequency_hz", [3.1, 17.0, 40.3, 118.2])
def test_a_tone_lands_in_its_band_and_its_blocks(frequency_hz: float) -> None:
    rate, n_bands = 250.0, 100
    time = np.arange(1000) / rate
    tone = np.where((time > 1.5) & (time < 2.5), np.cos(2 * np.pi * frequency_hz * time), 0.0)
    power = lapped_spectra(tone, n_bands) ** 2
    frequencies, times = band_frequencies_hz(n_bands, rate), block_times_s(power.shape[0], n_bands, rate)
    near = np.abs(frequencies - frequency_hz) < 4 * 0.5 * rate / n_bands
    assert power[:, near].sum() > 0.97 * power.sum()
    around = (times > 1.5 - 0.4) & (times < 2.5 + 0.4)
    assert power[around].sum() > (1 - 1e-9) * power.sum()
    assert abs(np.average(times, weights=power.sum(axis=1)) - 2.0) < 0.1


def test_white_noise_has_one_level_in_every_band() -> None:
    noise = 0.3 * np.random.default_rng(5).normal(size=200_000)
    level = (lapped_spectra(noise, 50) ** 2).mean(axis=0)
    # 4000 blocks: a mean square is known to √(2/4000) = 2.2 %
    assert np.abs(level / 0.09 - 1).max() < 0.09
