"""One mode among others: its decay in a band of its own, and its pole in a random run."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal as signals

from sloshlab.errors import AnalysisError
from sloshlab.modal.mode_band import band_of_mode, decay_in_band
from sloshlab.modal.single_mode_fit import _refuse_what_is_no_mode, fit_single_mode
from sloshlab.modal.spectra import Spectra, random_spectra

FREQUENCIES_HZ, RATE_HZ = (10.87, 78.31, 226.5), 1024.0


def test_a_mode_decays_as_its_own_pole_beside_what_leaks_from_others() -> None:
    """Decaying sines from a release at 0.5 s: a tenth of mode 1 and half of mode 3 leak into mode 2."""
    time_s = np.arange(round(4.5 * RATE_HZ)) / RATE_HZ - 0.5
    signal = np.zeros(time_s.size)
    for frequency, damping, size in zip(FREQUENCIES_HZ, (0.003, 0.009, 0.018), (0.1, 1.0, 0.5), strict=True):
        omega = 2 * np.pi * frequency
        decay = np.exp(-damping * omega * time_s) * np.sin(omega * np.sqrt(1 - damping**2) * time_s)
        signal += np.where(time_s >= 0, size * decay, 0.0)
    signal += 1e-4 * np.random.default_rng(1).standard_normal(time_s.size)
    reading = decay_in_band(signal, FREQUENCIES_HZ, 1, RATE_HZ, name="mode 2").local_sine_fit
    assert reading.used.sum() > 5
    # a band-pass rings on for a cycle or two of its lower end, which the first stretches see
    assert np.median(reading.damping_ratio[reading.used]) == pytest.approx(0.009, rel=0.03)
    damped = 78.31 * np.sqrt(1 - 0.009**2)
    assert np.median(reading.frequency_hz[reading.used]) == pytest.approx(damped, rel=1e-3)


def test_the_band_ends_below_half_the_rate_and_a_low_rate_is_refused() -> None:
    low, high = band_of_mode(FREQUENCIES_HZ, 1, 1000.0)
    assert (low, high) == pytest.approx((np.sqrt(10.87 * 78.31), np.sqrt(78.31 * 226.5)))
    low, high = band_of_mode(FREQUENCIES_HZ, 2, 600.0)
    assert low == pytest.approx(np.sqrt(78.31 * 226.5))
    assert high == pytest.approx(0.48 * 600.0)
    with pytest.raises(AnalysisError, match=r"sampling rate: got 500 Hz; allowed: > 566\.2 Hz for mode 3"):
        decay_in_band(np.zeros(2000), FREQUENCIES_HZ, 2, 500.0, name="mode 3")


@pytest.fixture(scope="module")
def spectra() -> Spectra:
    """20 minutes of an oscillator of 10.87 Hz, ζ = 1.5 %, as a sampled pole, and of unrelated noise."""
    rng = np.random.default_rng(5)
    excitation = rng.standard_normal(60_000)
    omega = 2 * np.pi * 10.87
    pole = np.exp((-0.015 * omega + 1j * omega * np.sqrt(1 - 0.015**2)) / 50.0)
    response = signals.lfilter(
        [0.0, -2 * (0.7j * np.conj(pole)).real], [1.0, -2 * pole.real, abs(pole) ** 2], excitation
    )
    both = np.stack([response + 0.02 * response.std() * rng.standard_normal(60_000), rng.standard_normal(60_000)])
    return random_spectra(excitation, both, 50.0, segment_length=1500)


def test_a_pole_is_found_within_its_error(spectra: Spectra) -> None:
    fit = fit_single_mode(spectra, 0, (0.65 * 10.87, 1.5 * 10.87))
    assert abs(fit.frequency_hz[0] - 10.87) < 4 * fit.frequency_hz_std[0]
    assert abs(fit.damping_ratio[0] - 0.015) < 4 * fit.damping_ratio_std[0]
    assert fit.damping_ratio_std[0] < 0.002


@pytest.mark.parametrize(
    ("output", "band", "match"),
    [
        (1, (8.0, 16.0), "the root does not excite it: coherence at most"),
        (0, (10.001, 10.002), "no line between 10 and 10 Hz"),
        (0, (15.0, 22.0), "is no mode in this range|stands out of|not told"),
    ],
)
def test_what_is_no_mode_is_refused_with_the_reason(
    spectra: Spectra, output: int, band: tuple[float, float], match: str
) -> None:
    with pytest.raises(AnalysisError, match=match):
        fit_single_mode(spectra, output, band)


@pytest.mark.parametrize(
    ("constant", "error", "match"),
    [
        (0.79, 0.009, None),
        (0.80, 0.009, "no peak near 10 Hz stands out of what other modes leave there"),
        (0.79, 0.011, "ζ = 0.02 with a standard error of 0.011: not told"),
    ],
)
def test_a_peak_stands_out_of_what_other_modes_leave(constant: float, error: float, match: str | None) -> None:
    """|R/(jω − p)| at ω = |p| is |R|/(ζ|p|): 1/(0.02 · 2π · 10) = 0.796 for R = j."""
    fit = SimpleNamespace(
        frequency_hz=[10.0], damping_ratio=[0.02], damping_ratio_std=[error], residues=np.array([[1j]]),
        fit=SimpleNamespace(constant=[constant]),
    )  # fmt: skip
    if match is None:
        _refuse_what_is_no_mode(fit, 8.0, 12.0)
    else:
        with pytest.raises(AnalysisError, match=match):
            _refuse_what_is_no_mode(fit, 8.0, 12.0)
