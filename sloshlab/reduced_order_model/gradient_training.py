"""Training of networks that are too large for the normal equations: by gradients alone, with limited memory.

A matrix of p² sums over all samples is what `training.fit` needs; for the 9 381 parameters of Appendix C one of
them takes half an hour. The gradient costs three evaluations of the network, and quasi-Newton steps (L-BFGS, Liu &
Nocedal 1989) need nothing else. They take hundreds of steps where Levenberg–Marquardt takes tens. Single
precision is enough for a direction, and takes a third of the time; sums over samples are double.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.model import ReducedOrderModel, scaled_run
from sloshlab.reduced_order_model.network_list import network_of
from sloshlab.reduced_order_model.networks.network import Network
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks
from sloshlab.reduced_order_model.training import Epoch, TrainingRecord, TrainingSettings, fitted_scaling

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]

LARGEST_BATCH: Final = 500_000
"""Samples that are held at once; with 50 delays 100 MB."""
_AT_ONCE: Final = 1000
_CORRECTIONS: Final = 30
_LOOK_EVERY: Final = 5
"""Steps between two looks at the validation run, which cost as much as a step."""


@dataclass(frozen=True)
class GradientSettings:
    """How a network is trained by gradients.

    Attributes
    ----------
    n_steps : int
        Quasi-Newton steps, at most.
    every : int
        Of the samples one in so many is a target: at a high rate neighbours say nearly the same. All samples are
        regressors.
    patience : int
        Looks at the validation run without a better one, after which training stops; one in five steps.
    seed : int
    input_spread : float
        As in `TrainingSettings`.
    """

    n_steps: int = 1000
    every: int = 1
    patience: int = 30
    seed: int = 0
    input_spread: float = 2.0

    def __post_init__(self) -> None:
        for name in ("n_steps", "every", "patience"):
            if getattr(self, name) < 1:
                raise InputError(f"training by gradients: {name}", got=str(getattr(self, name)), allowed="≥ 1")


@dataclass(frozen=True)
class _Batch:
    """Regressors, shape (n_regressors, m), and targets, shape (m,), in single precision."""

    phi: SingleArray
    target: SingleArray

    @classmethod
    def of(cls, runs: Sequence[Run], delays: Delays, every: int) -> _Batch:
        parts = [(phi[:, ::every], target[::every]) for phi, target in blocks(runs, delays, _AT_ONCE * every)]
        n_samples = sum(target.size for _, target in parts)
        if n_samples > LARGEST_BATCH:
            got, remedy = str(n_samples), "take fewer samples, by `every`"
            raise InputError("samples of a training", got=got, allowed=f"≤ {LARGEST_BATCH}", remedy=remedy)
        return cls(
            np.concatenate([phi for phi, _ in parts], axis=1, dtype=np.float32),
            np.concatenate([target for _, target in parts], dtype=np.float32),
        )

    def pieces(self) -> Iterator[tuple[SingleArray, SingleArray]]:
        # pieces that stay in the processor's cache take half the time of the whole
        for first in range(0, self.target.size, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            yield self.phi[:, part], self.target[part]

    def mean_square(self, network: Network, theta: FloatArray) -> float:
        single = theta.astype(np.float32)
        squares = sum(
            float(np.sum((network.output(np, single, phi) - target) ** 2, dtype=np.float64))
            for phi, target in self.pieces()
        )
        return squares / self.target.size

    def descent(self, network: Network, theta: FloatArray) -> tuple[float, FloatArray]:
        """Mean square and its gradient."""
        single, squares, gradient = theta.astype(np.float32), 0.0, np.zeros(theta.size)
        for phi, target in self.pieces():
            own, slope = network.squares_and_gradient(np, single, phi, target)
            squares += own
            gradient += slope
        return squares / self.target.size, gradient / self.target.size


class _EndOfTrainingError(Exception):
    """Leaves the minimiser, whose callback has no other way out."""


def fit_by_gradients(
    kind: str,
    settings_of_network: dict[str, Any],
    delays: Delays,
    training: Sequence[Run],
    validation: Sequence[Run],
    *,
    sampling_rate_hz: float,
    settings: GradientSettings | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> tuple[ReducedOrderModel, TrainingRecord]:
    """Train a model without feedback.

    Parameters
    ----------
    kind, settings_of_network, training, validation, sampling_rate_hz
        As for `fit`.
    delays : Delays
        Of the input alone.
    settings : GradientSettings, optional
    on_epoch : callable, optional
        Takes every look at the validation run. A KeyboardInterrupt keeps the best model so far.

    Returns
    -------
    model : ReducedOrderModel
        The one with the smallest validation error.
    record : TrainingRecord
        Its epochs are looks at the validation run, numbered by steps.

    Raises
    ------
    InputError
        If there is nothing to train on or nothing to validate with, there are too many samples, or the delays
        have feedback.
    AnalysisError
        If input or output is constant.
    """
    chosen = settings or GradientSettings()
    if delays.outputs or delays.n_states:
        raise InputError("training by gradients", got="feedback or states", allowed="delays of the input alone")
    scaling = fitted_scaling(training, validation, delays, TrainingSettings(input_spread=chosen.input_spread))
    network = network_of(kind, {**settings_of_network, "n_inputs": delays.n_regressors})
    batches = [
        _Batch.of([scaled_run(run, scaling, None, sampling_rate_hz) for run in runs], delays, chosen.every)
        for runs in (training, validation)
    ]
    descent = _Descent(network, batches[0], batches[1], chosen, scaling.output_scale**2, on_epoch)
    ended = descent.run()
    model = ReducedOrderModel(network, descent.best_theta, delays, scaling, sampling_rate_hz)
    record = TrainingRecord(descent.epochs, descent.best, ended, ended == _INTERRUPTED)
    return model, record


_INTERRUPTED: Final = "interrupted"


class _Descent:
    """A training, and the best that it has seen."""

    def __init__(
        self,
        network: Network,
        training: _Batch,
        validation: _Batch,
        settings: GradientSettings,
        unit: float,
        on_epoch: Callable[[Epoch], None] | None,
    ) -> None:
        self._network, self._training, self._validation = network, training, validation
        self._settings, self._unit, self._told = settings, unit, on_epoch or (lambda epoch: None)
        self._started, self._n_steps, self._unimproved = time.monotonic(), 0, 0
        rng = np.random.default_rng(settings.seed)
        self._theta = network.initial(training.phi.astype(np.float64), training.target.astype(np.float64), rng)
        self.epochs: list[Epoch] = []
        self.best: Epoch
        self.best_theta: FloatArray
        self._look()

    def run(self) -> str:
        """Descend; return why it ended."""
        try:
            found = minimize(
                lambda theta: self._training.descent(self._network, theta),
                self._theta,
                jac=True,
                method="L-BFGS-B",
                callback=self._after_step,
                options={"maxiter": self._settings.n_steps, "maxfun": 10**9, "maxcor": _CORRECTIONS, "ftol": 0.0},
            )
        except _EndOfTrainingError as reason:
            return str(reason)
        except KeyboardInterrupt:
            return _INTERRUPTED
        self._theta = found.x
        self._look()
        return "steps used up" if self._n_steps >= self._settings.n_steps else "no further improvement"

    def _after_step(self, theta: FloatArray) -> None:
        self._n_steps += 1
        self._theta = theta
        if self._n_steps % _LOOK_EVERY:
            return
        self._look()
        if self._unimproved >= self._settings.patience:
            raise _EndOfTrainingError(f"no better validation error in {_LOOK_EVERY * self._unimproved} steps")

    def _look(self) -> None:
        # both by the same evaluation, so that they can be compared
        mse = [
            batch.mean_square(self._network, self._theta) * self._unit
            for batch in (self._training, self._validation)
        ]
        epoch = Epoch(0, self._n_steps, mse[0], mse[1], time.monotonic() - self._started)
        self.epochs.append(epoch)
        self._unimproved += 1
        if len(self.epochs) == 1 or epoch.validation_mse < self.best.validation_mse:
            self.best, self.best_theta, self._unimproved = epoch, self._theta.copy(), 0
        self._told(epoch)
