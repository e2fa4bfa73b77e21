"""A network whose inputs and output are scaled by their local amplitude: relative errors are what it learns from.

Δf/s is a function of (v − mean)/s and ln s, where s is the RMS of the past velocities without their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.reduced_order_model.array_backend import array_backend
from sloshlab.reduced_order_model.early_stop import EarlyStop
from sloshlab.reduced_order_model.least_squares import OneStepProblem, Step, next_step
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks

FloatArray = NDArray[np.float64]

SMALLEST_M_PER_S: Final = 0.01
"""RMS velocity below which the scale goes no further down: where hardly anything moves ratios are noise."""
_SPREAD: Final = 2.0
"""Standard deviation of all regressors together, as `TrainingSettings.input_spread`."""
_BLOCK: Final = 8192


@dataclass(frozen=True)
class ScaledNetwork:
    """A network of velocities over their local amplitude.

    Attributes
    ----------
    network : NormalisedRadialBasis
    theta : ndarray
    n_delays : int
    numbers : ndarray, shape (3,)
        Mean and standard deviation of ln s, and scale of Δf/s [N s/m].
    """

    network: NormalisedRadialBasis
    theta: FloatArray
    n_delays: int
    numbers: FloatArray

    def simulate(self, x: FloatArray) -> FloatArray:
        """Return Δf [N] for velocities [m/s], NaN where past ones are not known.

        Parameters
        ----------
        x : ndarray, shape (n,)
        """
        found = np.full(x.size, np.nan)
        past = np.lib.stride_tricks.sliding_window_view(x, self.n_delays)[:-1, ::-1].T
        known = np.isfinite(past).all(axis=0)
        scale, regressors = scaled_regressors(past[:, known], self.numbers)
        said = self.network.output(np, self.theta, regressors) * self.numbers[2] * scale
        found[self.n_delays :][known] = said
        return found


def scaled_regressors(past: FloatArray, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Scale s [m/s], shape (m,), and what the network sees, shape (n_delays + 1, m).

    Parameters
    ----------
    past : ndarray, shape (n_delays, m)
        Past velocities, one column per sample.
    numbers : ndarray, shape (3,)
        As of `ScaledNetwork`.
    """
    centred = past - past.mean(axis=0)
    scale = np.sqrt(np.mean(centred**2, axis=0) + SMALLEST_M_PER_S**2)
    level = (np.log(scale) - numbers[0]) / numbers[1]
    return scale, np.concatenate([centred / scale * (_SPREAD / np.sqrt(past.shape[0])), level[None, :]])


def fit_scaled(
    training: Sequence[Run], validation: Sequence[Run], *, n_delays: int, n_neurons: int, n_epochs: int, seed: int
) -> ScaledNetwork:
    """Train by Levenberg–Marquardt, stopped by the validation runs, as `fit` does.

    Parameters
    ----------
    training, validation : sequence of Run
    n_delays, n_neurons, n_epochs, seed : int
    """
    delays = Delays.tapped(n_delays)
    past, force = _samples(training, delays)
    spread = np.sqrt(np.mean((past - past.mean(axis=0)) ** 2, axis=0) + SMALLEST_M_PER_S**2)
    numbers = np.array([np.log(spread).mean(), np.log(spread).std(), np.std(force / spread)])
    network = NormalisedRadialBasis(n_delays + 1, n_neurons)
    learnt, judged = (_scaled(*_samples(runs, delays), numbers) for runs in (training, validation))
    backend = array_backend()
    parts = [(learnt[0][:, k : k + _BLOCK], learnt[1][k : k + _BLOCK]) for k in range(0, force.size, _BLOCK)]
    problem = OneStepProblem(backend, network, lambda: iter(parts))
    start: Any = network.initial(*learnt, np.random.default_rng([seed, 0]))
    step: Step | None = Step(*problem.improved(start))
    stop, best, lowest = EarlyStop(6, 0.01), start, np.inf
    for _ in range(n_epochs + 1):
        if step is None:
            break
        error = float(np.mean((judged[1] - network.output(np, step.theta, judged[0])) ** 2))
        if error < lowest:
            best, lowest = step.theta, error
        if stop.reason(error):
            break
        step = next_step(problem, step, backend.xp)
    return ScaledNetwork(network, np.asarray(best), n_delays, numbers)


def _samples(runs: Sequence[Run], delays: Delays) -> tuple[FloatArray, FloatArray]:
    """Past velocities, shape (n_delays, m), and forces of all runs."""
    found = list(blocks(runs, delays, _BLOCK))
    return np.concatenate([phi for phi, _ in found], axis=1), np.concatenate([force for _, force in found])


def _scaled(past: FloatArray, force: FloatArray, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    scale, regressors = scaled_regressors(past, numbers)
    return regressors, force / scale / numbers[2]


def save_scaled(model: ScaledNetwork, path: Path) -> None:
    """Keep a network in a file of arrays."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez(file, theta=model.theta, numbers=model.numbers, n_delays=np.array(model.n_delays))


def load_scaled(path: Path) -> ScaledNetwork:
    """Return what `save_scaled` kept."""
    with np.load(path, allow_pickle=False) as kept:
        n_delays, theta = int(kept["n_delays"]), kept["theta"]
        n_neurons = theta.size // (n_delays + 2)
        return ScaledNetwork(NormalisedRadialBasis(n_delays + 1, n_neurons), theta, n_delays, kept["numbers"])
