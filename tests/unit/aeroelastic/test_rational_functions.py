"""Rational functions: known ones are found again, fits are as good as they say, time and frequency agree."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_minimum_state import minimum_state_fit
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.section_forces import Section
from sloshlab.errors import AnalysisError

K = np.linspace(0.0, 1.3, 16)


def theodorsen_table() -> np.ndarray:
    section = Section(0.9, -0.34)
    return np.array([section.forces(1j * k) for k in K])


def random_table(n_lags: int = 2, full: bool = True) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    random = np.random.default_rng(3)
    a = [random.standard_normal((3, 3)) for _ in range(3)]
    beta = np.array([0.1, 0.7])[:n_lags]
    if full:
        lagged = [random.standard_normal((3, 3)) for _ in beta]
    else:
        lagged = [np.outer(random.standard_normal(3), random.standard_normal(3)) for _ in beta]
    table = np.array(
        [
            a[0]
            + 1j * k * a[1]
            - k**2 * a[2]
            + sum(1j * k / (1j * k + b) * part for b, part in zip(beta, lagged, strict=True))
            for k in K
        ]
    )
    return table, [*a, *lagged], beta


def test_roger_finds_a_rational_function_again() -> None:
    table, parts, beta = random_table()
    form = roger_fit(K, table, semi_chord_m=0.4, lags=beta)
    for found, true in zip((form.a0, form.a1, form.a2), parts, strict=False):
        np.testing.assert_allclose(found, true, atol=1e-9)
    np.testing.assert_allclose(form.lag_output, np.hstack(parts[3:]), atol=1e-9)
    assert form.quality is not None
    assert form.quality.rms < 1e-12


def test_roger_moves_its_lags_to_the_true_ones() -> None:
    table, _, beta = random_table()
    form = roger_fit(K, table, semi_chord_m=0.4, lags=np.array([0.05, 1.0]), optimise_lags=True)
    # local search to 1e-3 in ln β
    np.testing.assert_allclose(np.unique(form.lags), beta, rtol=5e-3)


def test_minimum_state_finds_lags_of_rank_one_again() -> None:
    table, parts, beta = random_table(full=False)
    form = minimum_state_fit(K, table, semi_chord_m=0.4, lags=beta, n_turns=2000)
    assert form.lags.size == 2
    np.testing.assert_allclose(np.outer(form.lag_output[:, 0], form.lag_input[0]), parts[3], atol=1e-3)
    assert form.quality is not None
    assert form.quality.rms < 1e-4


def test_steady_forces_are_exact_and_the_fit_of_theodorsen_is_good() -> None:
    table = theodorsen_table()
    roger = roger_fit(K, table, semi_chord_m=0.9, lags=np.array([0.05, 0.15, 0.4, 1.0]))
    minimum = minimum_state_fit(K, table, semi_chord_m=0.9, lags=np.array([0.05, 0.15, 0.4, 1.0]))
    for form in (roger, minimum):
        np.testing.assert_array_equal(form.a0, table[0].real)
        assert form.quality is not None
        # C(k) is no rational function: k ln k near 0
        assert form.quality.rms < 2e-3
        error = np.linalg.norm([form.at(1j * k) for k in K] - table) / np.linalg.norm(table)
        assert form.quality.rms == pytest.approx(error)
    # circulation has rank one: few states do as well as many
    assert (roger.lags.size, minimum.lags.size) == (8, 4)


def test_mass_can_be_left_out() -> None:
    table, _, beta = random_table()
    form = roger_fit(K, table, semi_chord_m=0.4, lags=beta, with_mass=False)
    np.testing.assert_array_equal(form.a2, 0.0)


@pytest.mark.parametrize(
    ("k", "lags", "message"),
    [
        (K + 0.1, [0.1], "ascending from 0"),
        (K, [0.1, 0.1], "different numbers > 0"),
        (K, [-0.1], "different numbers > 0"),
    ],
)
def test_bad_fits_are_refused(k: np.ndarray, lags: list[float], message: str) -> None:
    for fit in (roger_fit, minimum_state_fit):
        with pytest.raises(AnalysisError, match=message):
            fit(k, theodorsen_table(), semi_chord_m=1.0, lags=np.array(lags))


def test_lags_that_grow_are_refused() -> None:
    one = np.eye(1)
    with pytest.raises(AnalysisError, match="lags: got -1; allowed: > 0"):
        RationalForces(one, one, one, one, np.array([-1.0]), one, 1.0)
