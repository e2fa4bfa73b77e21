"""Vector fitting on exact rational functions, and modal fits of noisy ones and of random runs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal as signals

from sloshlab.errors import AnalysisError
from sloshlab.modal.modal_fit import modal_fit, modal_fit_of_spectra
from sloshlab.modal.spectra import random_spectra
from sloshlab.modal.vector_fitting import FitStatus, vector_fit

FREQUENCIES_HZ = np.array([10.87, 79.06, 223.15])
DAMPING_RATIOS = np.array([0.0032, 0.0090, 0.0176])


def poles_of(frequencies_hz: np.ndarray, damping_ratios: np.ndarray) -> np.ndarray:
    omega = 2 * np.pi * frequencies_hz
    return -damping_ratios * omega + 1j * omega * np.sqrt(1 - damping_ratios**2)


def responses(lines_hz: np.ndarray, poles: np.ndarray, n_outputs: int, seed: int = 1) -> np.ndarray:
    """Sums of partial fractions with random residues and constants, shape (n_outputs, n_lines)."""
    generator = np.random.default_rng(seed)
    s = 2j * np.pi * lines_hz
    rows = []
    for _ in range(n_outputs):
        row = np.full(s.size, generator.normal(), dtype=complex)
        for pole in poles:
            residue = complex(*generator.normal(size=2)) * abs(pole)
            row += residue / (s - pole) + residue.conjugate() / (s - pole.conjugate())
        rows.append(row)
    return np.array(rows)


LINES_HZ = np.linspace(1, 300, 900)


@pytest.mark.parametrize("n_outputs", [1, 4])
@pytest.mark.parametrize("proportional", [False, True])
def test_poles_of_exact_data_are_recovered(n_outputs: int, proportional: bool) -> None:
    poles = poles_of(FREQUENCIES_HZ, DAMPING_RATIOS)
    data = responses(LINES_HZ, poles, n_outputs)
    fit = vector_fit(LINES_HZ, data, n_pole_pairs=3, proportional=proportional)
    assert fit.status is FitStatus.CONVERGED
    np.testing.assert_allclose(fit.poles, poles, rtol=1e-6)
    np.testing.assert_allclose(fit.response(LINES_HZ), data, rtol=1e-6, atol=1e-9)


def test_two_close_modes_and_a_real_pole() -> None:
    poles = poles_of(np.array([10.0, 10.2]), np.array([0.01, 0.012]))
    data = responses(np.linspace(2, 20, 800), poles, 3)
    np.testing.assert_allclose(vector_fit(np.linspace(2, 20, 800), data, n_pole_pairs=2).poles, poles, rtol=1e-6)
    lines = np.linspace(0.1, 20, 400)
    low_pass = 5.0 / (2j * np.pi * lines + 5.0) + responses(lines, poles[:1], 1)[0]
    found = vector_fit(lines, low_pass, n_pole_pairs=2).poles
    assert np.abs(found - poles[0]).min() < 1e-6 * abs(poles[0])
    assert np.abs(found + 5.0).min() < 1e-4


def test_spare_poles_do_not_disturb() -> None:
    poles = poles_of(FREQUENCIES_HZ, DAMPING_RATIOS)
    found = vector_fit(LINES_HZ, responses(LINES_HZ, poles, 2), n_pole_pairs=5, n_iterations=8).poles
    for pole in poles:
        assert np.abs(found - pole).min() < 1e-6 * abs(pole)


def test_an_unstable_response_is_fitted_as_it_is_or_made_stable_on_request() -> None:
    lines = np.linspace(5, 15, 300)
    data = responses(lines, poles_of(np.array([10.0]), np.array([-0.01])), 1)
    assert vector_fit(lines, data, n_pole_pairs=1, stable=False).poles[0].real == pytest.approx(
        0.01 * 2 * np.pi * 10, rel=1e-6
    )
    assert (vector_fit(lines, data, n_pole_pairs=1).poles.real < 0).all()


def test_modal_fit_intervals_hold_in_nine_of_ten_repeats() -> None:
    generator = np.random.default_rng(8)
    lines = np.linspace(8, 14, 120)
    clean = responses(lines, poles_of(np.array([10.87]), np.array([0.01])), 2)
    std = 0.05 * np.abs(clean).max()
    held, found, claimed = [], [], []
    for _ in range(200):
        noise = generator.normal(0, std, (2, *clean.shape))
        fit = modal_fit(lines, clean + noise[0] + 1j * noise[1], n_modes=1)
        low, high = fit.damping_ratio_interval[:, 0]
        first, last = fit.frequency_interval_hz[:, 0]
        held.append((low <= 0.01 <= high, first <= 10.87 <= last))
        found.append((fit.damping_ratio[0], fit.frequency_hz[0]))
        claimed.append((fit.damping_ratio_std[0], fit.frequency_hz_std[0]))
    assert np.mean(held, axis=0) == pytest.approx(0.90, abs=0.05)
    # 200 repeats give the scatter within 5 %; three of those
    assert np.mean(claimed, axis=0) == pytest.approx(np.std(found, axis=0), rel=0.15)
    # noise alike in real and imaginary part moves a pole alike along both axes: std(f)/f = std(ζ) for small ζ,
    # but for the real constant, which takes up some of it
    damping_std, frequency_std = np.mean(claimed, axis=0)
    assert frequency_std / 10.87 == pytest.approx(damping_std, rel=0.05)
    # 8 parameters take up 8 of 480 parts of the noise: so much nearer to the truth is the model
    left = np.sqrt(np.mean(np.abs(fit.modelled - clean) ** 2) / 2) / std
    assert left == pytest.approx(np.sqrt(8 / 480), rel=0.5)


def test_the_model_of_a_modal_fit_is_that_of_the_data() -> None:
    lines = np.linspace(8, 14, 120)
    data = responses(lines, poles_of(np.array([10.87]), np.array([0.01])), 2)
    fit = modal_fit(lines, data, n_modes=1)
    np.testing.assert_allclose(fit.modelled, data, rtol=1e-8)
    np.testing.assert_array_equal(fit.line_hz, lines)


def test_a_mode_seen_through_the_line_shape_of_the_window_is_modelled_through_it() -> None:
    """|W|² of a Hann window of 1500 samples by FFT; with it a mode a line wide loses a third of its peak."""
    n_segment, rate, finer = 1500, 50.0, 32
    power = np.abs(np.fft.fft(np.hanning(n_segment + 1)[:-1], finer * n_segment)) ** 2
    offsets = np.arange(-8 * finer, 8 * finer + 1)
    shares = power[offsets] / power[offsets].sum()
    spacing = rate / n_segment
    lines = np.arange(240, 420) * spacing
    pole = poles_of(np.array([10.87]), np.array([0.0016]))
    fine = responses((lines[:, None] + offsets / finer * spacing).ravel(), pole, 1)[0].reshape(lines.size, -1)
    seen, plain = fine @ shares, responses(lines, pole, 1)[0]
    fit = modal_fit(lines, seen, n_modes=1, hann_lines=True)
    assert np.abs(seen).max() < 0.8 * np.abs(plain).max()
    # the line shape is summed at quarters of a line, here at 32nds
    assert np.abs(fit.modelled[0] - seen).max() < 0.01 * np.abs(seen).max()
    assert fit.damping_ratio[0] == pytest.approx(0.0016, rel=0.01)
    assert fit.half_power_width_in_lines[0] == pytest.approx(2 * 0.0016 * 10.87 / spacing, rel=0.01)


def resonator(damping_ratio: float, rate_hz: float) -> tuple[list[float], list[float]]:
    """Digital filter with the sampled poles e^{p/f_s} of a mode at 10.87 Hz."""
    pole = np.exp(poles_of(np.array([10.87]), np.array([damping_ratio]))[0] / rate_hz)
    residue = 0.7j
    numerator = [2 * residue.real, -2 * (residue * np.conj(pole)).real]
    return numerator, [1.0, -2 * pole.real, abs(pole) ** 2]


@pytest.mark.parametrize("damping_ratio", [0.0032, 0.025])
def test_random_run_of_a_mode_narrower_than_the_window(damping_ratio: float) -> None:
    """Leakage of the window would make ζ of 0.32 % a tenth larger: the fit takes the line shape into account."""
    generator = np.random.default_rng(9)
    held, damping, claimed = [], [], []
    for _ in range(60):
        x = generator.normal(size=15_000)
        y = signals.lfilter(*resonator(damping_ratio, 50.0), x) + generator.normal(size=x.size)
        spectra = random_spectra(x, y, 50.0, segment_length=1500)
        fit = modal_fit_of_spectra(spectra, n_modes=1, frequency_range_hz=(8.0, 14.0))
        low, high = fit.damping_ratio_interval[:, 0]
        held.append(low <= damping_ratio <= high)
        damping.append(fit.damping_ratio[0])
        claimed.append(fit.damping_ratio_std[0])
    assert np.mean(damping) == pytest.approx(damping_ratio, rel=0.01)
    # at least 90 %: where leakage rules, coherence counts it as noise and intervals come out too wide
    assert np.mean(held) >= 0.83
    # 60 repeats give the scatter within 9 %; without the correlation of neighbouring lines it were a third less
    assert 0.95 <= np.mean(claimed) / np.std(damping) <= 1.7


def test_fewer_oscillating_modes_than_asked_for_are_refused() -> None:
    lines = np.linspace(0.1, 5, 50)
    with pytest.raises(AnalysisError, match="modal fit: got 0 oscillating modes"):
        modal_fit(lines, 1 / (2j * np.pi * lines + 1) + 1 / (2j * np.pi * lines + 9), n_modes=1)


@pytest.mark.parametrize(
    ("lines", "n_pairs", "match"), [(np.linspace(0, 5, 50), 1, "above 0 Hz"), (np.linspace(1, 5, 5), 2, "6 lines")]
)
def test_data_that_cannot_be_fitted_are_refused(lines: np.ndarray, n_pairs: int, match: str) -> None:
    with pytest.raises(AnalysisError, match=match):
        vector_fit(lines, np.ones(lines.size), n_pole_pairs=n_pairs)
    with pytest.raises(AnalysisError, match="missing values"):
        vector_fit(np.linspace(1, 5, 50), np.full(50, np.nan), n_pole_pairs=1)
