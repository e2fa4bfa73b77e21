"""A burst of noise is nothing that a simulation lacks, nor is what repeats do not share; what lasts is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import pytest

from sloshlab.diagnosis.free_run_problem import repeatable_mean_squares, rms_without_bursts


@dataclass
class Run:
    """A run with a name."""

    name: str


@dataclass
class Spectra:
    """As much of an observation as has times and bands."""

    spectra: np.ndarray
    informative: np.ndarray
    run: Run = field(default_factory=lambda: Run("run_1"))
    channel: str = "force"
    is_rough: bool = False


def observed(n_times: int, n_bands: int = 30) -> Spectra:
    return Spectra(np.zeros((n_times, n_bands)), np.ones((n_times, n_bands), bool))


def test_loud_times_up_to_a_quarter_do_not_count() -> None:
    residual = np.ones((16, 30))
    residual[[2, 7, 8, 9]] = 50.0
    assert rms_without_bursts(cast(Any, [observed(16)]), residual.ravel()) == pytest.approx(1.0)


def test_what_lasts_longer_counts_with_its_size() -> None:
    residual = np.ones((16, 30))
    residual[4:] = 3.0
    # four quiet times and eight of the twelve loud ones
    expected = np.sqrt((4 * 1.0 + 8 * 9.0) / 12)
    assert rms_without_bursts(cast(Any, [observed(16)]), residual.ravel()) == pytest.approx(expected)


def test_channels_have_their_own_quiet_times_and_bands_without_information_do_not_count() -> None:
    first, second = observed(8), observed(8)
    second.informative[:, 10:] = False
    first_residual, other = np.full((8, 30), 2.0), np.full((8, 30), 1.0)
    first_residual[0], other[5], other[:, 10:] = 9.0, 9.0, 9.0
    found = rms_without_bursts(cast(Any, [first, second]), np.concatenate([first_residual.ravel(), other.ravel()]))
    assert found == pytest.approx(np.sqrt((6 * 30 * 4.0 + 6 * 10 * 1.0) / (6 * 40)))


def of_run(name: str, shape: tuple[int, int], channel: str = "force") -> Spectra:
    return Spectra(np.zeros(shape), np.ones(shape, bool), Run(name), channel)


def test_a_repeatable_residual_is_separated_from_noise() -> None:
    """A common part of mean square 0.5 under noise of one in each run; lengths and bands differ."""
    generator = np.random.default_rng(3)
    common = np.sqrt(0.5) * generator.standard_normal((60, 40))
    observed = [of_run("a", (60, 40)), of_run("b", (55, 37)), of_run("c", (60, 40))]
    residual = np.concatenate(
        [(common[:n, :m] + generator.standard_normal((n, m))).ravel() for n, m in ((60, 40), (55, 37))]
        + [generator.standard_normal(60 * 40)]
    )
    shared = repeatable_mean_squares([["a", "b"]], cast(Any, observed), residual)
    assert shared == {("a", "force"): pytest.approx(0.5, abs=0.1)}
    shared = repeatable_mean_squares([["c", "a"], ["b"]], cast(Any, observed), residual)
    assert shared == {("c", "force"): pytest.approx(0.0, abs=0.1)}
    assert repeatable_mean_squares([["a"], ["b"]], cast(Any, observed), residual) == {}


def test_only_the_same_channel_and_what_is_informative_is_shared() -> None:
    first, other, second = (of_run(run, (8, 30), name) for run, name in (("a", "x"), ("a", "y"), ("b", "x")))
    first.informative[:, 20:], second.informative[:, :5] = False, False
    residual = np.concatenate([np.full(240, 2.0), np.full(240, 3.0), np.full(240, 2.0)])
    residual[:240].reshape(8, 30)[:, 20:] = -3.0
    residual[480:].reshape(8, 30)[:, :5] = -3.0
    shared = repeatable_mean_squares([["a", "b"]], cast(Any, [first, other, second]), residual)
    assert shared == {("a", "x"): pytest.approx(4.0)}


def test_a_channel_that_need_not_be_described_is_not_asked() -> None:
    observed = [of_run("a", (10, 10)), of_run("b", (10, 10))]
    assert repeatable_mean_squares([["a", "b"]], cast(Any, observed), np.ones(200)) != {}
    for observation in observed:
        observation.is_rough = True
    assert repeatable_mean_squares([["a", "b"]], cast(Any, observed), np.ones(200)) == {}


def test_few_coefficients_give_no_repeatable_mean_square() -> None:
    observed = [of_run("a", (7, 7)), of_run("b", (7, 7))]
    assert repeatable_mean_squares([["a", "b"]], cast(Any, observed), np.ones(98)) == {}


def test_a_burst_is_cut_off_before_it_is_compared() -> None:
    observed = [of_run("a", (10, 10)), of_run("b", (10, 10))]
    residual = np.zeros(200)
    residual[[0, 100]] = 50.0
    shared = repeatable_mean_squares([["a", "b"]], cast(Any, observed), residual)
    assert shared == {("a", "force"): pytest.approx(16.0 / 100)}
