"""Residual tests against closed forms: white noise, AR(1), a filter of the input, changing size, gaps."""

import numpy as np
import pytest

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.residual_tests import residual_tests

N, LAGS = 40_000, 20


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=N)


def ar1(seed: int, pole: float) -> np.ndarray:
    """z(k) = pole z(k−1) + white noise of the size that makes its variance one."""
    drive, z = np.sqrt(1 - pole**2) * noise(seed), np.zeros(N)
    for k in range(1, N):
        z[k] = pole * z[k - 1] + drive[k]
    return z


def test_white_noise_passes_and_its_band_is_196_over_root_n():
    for test in residual_tests(noise(0), noise(1), LAGS):
        assert test.is_passed, test.verdict
        assert test.n_outside <= 4
        if test.against in ("residual", "input"):
            # 64 blocks know a standard error to 1/√126
            np.testing.assert_allclose(np.median(test.band), 1.96 / np.sqrt(N), rtol=0.1)
        assert test.explained < 3 * LAGS / N + 1e-3
    assert "white" in residual_tests(noise(0), noise(1), LAGS)[0].verdict


def test_ar1_has_powers_of_its_pole_and_is_explained_by_its_square():
    own = residual_tests(ar1(2, 0.8), noise(3), LAGS)[0]
    np.testing.assert_allclose(own.correlation, 0.8 ** np.arange(1, LAGS + 1), atol=0.04)
    assert own.explained == pytest.approx(0.64, abs=0.02)
    assert not own.is_passed
    assert own.verdict.startswith("not white")


def test_the_band_of_two_coloured_signals_is_bartletts():
    """Variance of the correlation of independent AR(1): (1 + ab)/(1 − ab)/N."""
    test = residual_tests(ar1(4, 0.9), ar1(5, -0.5), LAGS)[1]
    wider = residual_tests(ar1(4, 0.9), ar1(6, 0.9), LAGS)[1]
    assert np.median(test.band) == pytest.approx(1.96 * np.sqrt((1 - 0.45) / (1 + 0.45) / N), rel=0.12)
    assert np.median(wider.band) == pytest.approx(1.96 * np.sqrt((1 + 0.81) / (1 - 0.81) / N), rel=0.12)
    assert wider.is_passed


def test_the_band_of_signals_that_grow_together():
    """a(t) = 2t/T on both: E[a⁴]/E[a²]² = (16/5)/(4/3)² = 1.8."""
    size = np.linspace(0, 2, N)
    test = residual_tests(size * noise(7), size * noise(8), LAGS)[1]
    assert np.median(test.band) == pytest.approx(1.96 * np.sqrt(1.8 / N), rel=0.12)
    assert test.is_passed


@pytest.mark.parametrize(("power", "variance", "share"), [(1, 1.0, 1.0), (2, 2.0, 1.0), (3, 15.0, 1.0)])
def test_a_delayed_power_of_the_input_is_found(power, variance, share):
    """e(k) = z(k − 7) + w(k) with z = xᵖ/√var(xᵖ) and w of variance 3: ρ = ½, explained ¼."""
    x = noise(9)
    z = np.zeros(N)
    z[7:] = (x**power)[:-7] / np.sqrt(variance)
    test = residual_tests(z + np.sqrt(3) * noise(10), x, LAGS)[power]
    assert test.correlation[7] == pytest.approx(0.5, abs=0.02)
    assert test.lags[7] == 7
    others = np.delete(test.correlation, 7)
    assert np.abs(others).max() < 0.03
    assert test.explained == pytest.approx(0.25, abs=0.02)


def test_lags_of_the_wrong_side_see_nothing():
    """A residual that comes before the input is not caused by it."""
    x = noise(11)
    e = np.zeros(N)
    e[:-3] = x[3:]
    assert np.abs(residual_tests(e, x, LAGS)[1].correlation).max() < 0.03


def test_gaps_are_left_out_and_shift_nothing():
    x = noise(12)
    e = np.roll(x, 5)
    e[1000:3000] = np.nan
    x[20_000:20_100] = np.nan
    test = residual_tests(e, x, LAGS)[1]
    assert test.correlation[5] == pytest.approx(1.0, abs=0.01)
    assert test.explained == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(
    ("e", "x", "n_lags", "match"),
    [
        (np.zeros(10), np.zeros(9), 1, "equal lengths"),
        (noise(0)[:300], noise(1)[:300], 20, "32 samples per lag"),
        (noise(0), noise(1), 0, "at least one lag"),
        (np.ones(N), noise(1), 5, "a constant"),
        (noise(0), np.full(N, 2.0), 5, "input: got a constant"),
    ],
)
def test_what_cannot_be_tested_is_refused(e, x, n_lags, match):
    with pytest.raises(InputError, match=match):
        residual_tests(e, x, n_lags)
