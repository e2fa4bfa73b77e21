"""The gain of a score test is that of least squares, and start frequencies are where the residual peaks."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ, run_of
from scipy.optimize import lsq_linear

from sloshlab.diagnosis import surroundings
from sloshlab.diagnosis.score_test import ScoreTest
from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_problem import FreeRunProblem

N, N_NUMBERS = 60, 4


@dataclass
class Linear:
    """A problem whose channels are known as well as they are, with two numbers of the baseline."""

    fixed: np.ndarray
    soft: float = 1.0
    n_baseline: int = 2

    def prior_weights(self, theta: np.ndarray, inflation: float) -> np.ndarray:
        return np.array([1.0] * self.n_baseline + [0.0] * (self.fixed.size - self.n_baseline))

    def comparison_weights(self, share: float) -> np.ndarray:
        return np.full(N, self.soft)

    def at_bounds(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.fixed, self.fixed


def least(columns: np.ndarray, residual: np.ndarray, prior: np.ndarray, theta: np.ndarray) -> float:
    """Smallest |r + Jδ|² + Σ (θ + δ)² over the numbers that belief holds."""
    matrix = np.vstack([columns, np.diag(np.sqrt(prior))])
    right = -np.concatenate([residual, np.sqrt(prior) * theta])
    step = np.linalg.lstsq(matrix, right, rcond=None)[0]
    return float(((matrix @ step - right) ** 2).sum())


def test_the_gain_does_not_depend_on_the_size_of_a_change_however_large() -> None:
    """No change predicts no gain, and neither does a diverging simulation."""
    generator = np.random.default_rng(3)
    jacobian, residual, change = (generator.standard_normal(shape) for shape in ((2, N), (N,), (N,)))
    problem = cast(FreeRunProblem, cast(Any, Linear(np.zeros(2, bool))))
    look = ScoreTest(problem, np.zeros(2), 1e4 * residual, BlockJacobian.of_columns(list(jacobian), [N]), 0.1)
    gain, factor = look.gains([change])[0]
    large, small = look.gains([1e153 * change])[0]
    assert large == pytest.approx(gain, rel=1e-9)
    assert small * 1e153 == pytest.approx(factor, rel=1e-9)
    with np.errstate(over="ignore", invalid="ignore"):
        for size in (0.0, 1e200):
            assert look.gains([size * change])[0][0] == 0.0


@pytest.mark.parametrize("soft", [1.0, 0.3])
@pytest.mark.parametrize("fixed", [[False] * 4, [True, False, False, True]])
def test_the_gain_is_that_of_least_squares_with_the_numbers_that_can_follow(
    fixed: list[bool], soft: float
) -> None:
    generator = np.random.default_rng(3)
    jacobian, residual, change = (generator.standard_normal(shape) for shape in ((N, N_NUMBERS), (N,), (N,)))
    theta = np.array([0.4, -0.7, 0.2, 0.1])
    problem = cast(FreeRunProblem, cast(Any, Linear(np.array(fixed), soft)))
    known = BlockJacobian.of_columns(list(jacobian.T), [25, N - 25])
    gain, size = ScoreTest(problem, theta, residual, known, 0.1).gains([change])[0]
    free = ~np.array(fixed)
    prior, place = np.array([1.0, 1.0, 0.0, 0.0])[free], theta[free]
    without = least(soft * jacobian[:, free], soft * residual, prior, place)
    beside = np.column_stack([soft * jacobian[:, free], soft * change])
    with_it = least(beside, soft * residual, np.append(prior, 0.0), np.append(place, 0.0))
    assert gain == pytest.approx(without - with_it, rel=1e-9)
    moved = least(soft * jacobian[:, free], soft * (residual + size * change), prior, place)
    assert moved == pytest.approx(with_it, rel=1e-9)


@dataclass
class AtBounds(Linear):
    """One whose numbers that are fixed are at their lower bounds."""

    def at_bounds(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.fixed, np.zeros(self.fixed.size, bool)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_number_at_its_bound_follows_an_effect_inwards_alone(seed: int, way: float) -> None:
    """Bounded least squares of SciPy, with the effect and without."""
    generator = np.random.default_rng(seed)
    jacobian, residual = generator.standard_normal((N, N_NUMBERS)), generator.standard_normal(N)
    # What the effect does, the first number does too: the one comes inwards, or goes outwards, with the other.
    change = way * jacobian[:, 0] + 0.3 * generator.standard_normal(N)
    residual -= change
    fixed = np.array([True, False, True, False])
    problem = cast(FreeRunProblem, cast(Any, AtBounds(fixed, n_baseline=0)))
    known = BlockJacobian.of_columns(list(jacobian.T), [N])
    gain, _ = ScoreTest(problem, np.zeros(N_NUMBERS), residual, known, 0.1).gains([change])[0]
    low = np.where(fixed, 0.0, -np.inf)
    alone = lsq_linear(jacobian, -residual, (low, np.inf))
    both = lsq_linear(np.column_stack([jacobian, change]), -residual, (np.append(low, -np.inf), np.inf))
    assert gain == pytest.approx(2 * (alone.cost - both.cost), rel=1e-6)


def test_a_change_that_the_baseline_can_follow_predicts_no_gain() -> None:
    generator = np.random.default_rng(4)
    jacobian, residual = generator.standard_normal((N, N_NUMBERS)), generator.standard_normal(N)
    problem = cast(FreeRunProblem, cast(Any, Linear(np.zeros(N_NUMBERS, bool), n_baseline=0)))
    look = ScoreTest(problem, np.zeros(N_NUMBERS), residual, BlockJacobian.of_columns(list(jacobian.T), [N]), 0.1)
    assert look.gains([jacobian @ [1.0, -2.0, 0.5, 3.0]])[0][0] < 1e-9


@dataclass
class Spectra:
    """As much of an observation as has frequencies."""

    spectra: np.ndarray
    frequencies_hz: np.ndarray


@pytest.mark.parametrize(
    ("loud", "is_unlike"),
    [
        pytest.param((0.0, 0.0), False, id="one frequency"),
        pytest.param((0.6, -0.6), True, id="two, at one the other way"),
        pytest.param((0.1, -0.1), False, id="two, little at one"),
    ],
)
def test_a_channel_is_unlike_the_base_where_no_complex_number_turns_one_into_the_other(
    loud: tuple[float, float], is_unlike: bool
) -> None:
    """Of (1, l) and (2, 2 m) at two frequencies one number explains (1 + lm)²/((1 + l²)(1 + m²)): 0.22, 0.96."""
    time = np.arange(1000) / RATE_HZ
    base, other = (np.sin(2 * np.pi * 5 * time), np.sin(2 * np.pi * 11 * time))
    turned, other_turned = (-np.cos(2 * np.pi * 5 * time), -np.cos(2 * np.pi * 11 * time))
    signals = {
        "acceleration_root": base + loud[0] * other,
        "acceleration_tip": 2 * turned + 2 * loud[1] * other_turned,
        "acceleration_beam_1": np.full(time.size, np.nan),  # a sensor that did not work
    }
    run = run_of("run", signals, {}, 0, experiment="other")
    found = surroundings._incoherent_with_base([[cast(Any, SimpleNamespace(run=run))]])
    assert ("acceleration_tip" in found) == is_unlike
    assert not found & {"acceleration_root", "acceleration_beam_1"}


def test_modes_are_sought_at_the_highest_peaks_of_all_channels_together() -> None:
    frequencies = np.arange(40) * 0.5
    quiet, loud = np.full((6, 40), 0.1), np.full((3, 40), 0.1)
    quiet[:, 7] = 2.0
    loud[:, [20, 30]] = 5.0, 4.0
    loud[:, 21] = 4.5  # a shoulder, no peak of its own
    runs = [[Spectra(quiet, frequencies)], [Spectra(loud, frequencies)]]
    residual = np.concatenate([quiet.ravel(), loud.ravel()])
    found = surroundings.residual_peaks_hz(cast(Any, runs), residual)
    assert found == (10.0, 15.0, 3.5)
    across = surroundings.residual_peaks_hz(cast(Any, runs), residual, (0.0, -0.8, 0.8))
    assert across == pytest.approx((10.0, 9.8, 10.2, 15.0, 14.8, 15.2, 3.5, 3.3, 3.7))
