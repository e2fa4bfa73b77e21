"""Fitting a model to recordings: scaling, starts, epochs, early stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model import free_run
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.array_backend import Array, ArrayBackend, array_backend
from sloshlab.reduced_order_model.early_stop import EarlyStop
from sloshlab.reduced_order_model.fill_input import FillInput
from sloshlab.reduced_order_model.least_squares import LeastSquaresProblem, OneStepProblem, Step, next_step
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling, feedback_model, scaled_run
from sloshlab.reduced_order_model.network_list import network_of
from sloshlab.reduced_order_model.networks.network import Network, NormalSums
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.principal_regressors import NetworkOfDistances, along, principal_directions
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks, n_samples, segments

FloatArray = NDArray[np.float64]
BLOCK: Final = 1024
_LINE_BLOCK: Final = 8192
"""Samples at once where sums are correlations: enough stretches for quick products."""
_LARGEST_INITIAL: Final = 20_000
_SAMPLES_PER_PARAMETER: Final = 100
"""The curvature of so many samples differs from that of very many by about a fifth in any direction (eigenvalues
(1 ± √(p/n))² of a covariance of p numbers in n samples, Marchenko & Pastur 1967), while the damping that is added
to it changes by factors of 4. Gradient and error are always those of all samples (Byrd et al. 2011)."""


@dataclass(frozen=True)
class TrainingSettings:
    """How a model is trained.

    Attributes
    ----------
    n_epochs : int
        At most.
    patience : int
        Rises of the validation error one after another after which training stops (`EarlyStop`).
    least_gain : float
        Share by which the mean square of the validation error must fall within twice as many epochs, or training
        stops.
    n_starts : int
        Trainings from different random starts; the best by validation error is kept.
    seed : int
    input_spread : float
        Standard deviation of the regressors in the network's values, all of them together: √Σ var. With Σ⁻¹ = I
        it says how many neurons a sample feels.
    fill_spread : float
        Standard deviation of the fill level over the training runs in the network's values, where it is an input.
    galilean : bool
        Whether the network shall see its past inputs without their mean. The force of a liquid does not depend on
        a constant velocity (Galileo), but runs of a shaker, whose velocity has no mean, do not tell that. Only for
        a normalised radial basis network without feedback.
    """

    n_epochs: int = 100
    patience: int = 6
    least_gain: float = 0.01
    n_starts: int = 1
    seed: int = 0
    input_spread: float = 2.0
    fill_spread: float = 1.0
    galilean: bool = False


@dataclass(frozen=True)
class Epoch:
    """Where a training stands after an epoch.

    Attributes
    ----------
    start, number : int
        Which start, and epoch within it; 0 is before the first step.
    training_mse, validation_mse : float
        Mean squares of the errors, in the square of the output's unit.
    elapsed_s : float
        Since the beginning of training.
    """

    start: int
    number: int
    training_mse: float
    validation_mse: float
    elapsed_s: float


@dataclass(frozen=True)
class TrainingRecord:
    """How a training went.

    Attributes
    ----------
    epochs : list of Epoch
        Of all starts.
    best : Epoch
        The one whose model was kept.
    ended : str
        Why the start with the best model ended.
    interrupted : bool
        Whether a person stopped it.
    """

    epochs: list[Epoch]
    best: Epoch
    ended: str
    interrupted: bool = False


@dataclass
class _Best:
    """The best parameters so far, and all epochs."""

    epochs: list[Epoch] = field(default_factory=list)
    theta: FloatArray | None = None
    epoch: Epoch | None = None
    ended: str = ""

    def take(self, epoch: Epoch, theta: FloatArray) -> None:
        self.epochs.append(epoch)
        # by the validation run: the training error falls with every epoch
        better = self.epoch is None or epoch.validation_mse < self.epoch.validation_mse
        if np.isfinite(epoch.validation_mse) and better:
            self.epoch, self.theta = epoch, theta


@dataclass(frozen=True)
class _Task:
    """Scaled runs and what is trained on them."""

    network: Network
    delays: Delays
    training: list[Run]
    validation: list[Run]
    output_scale: float
    backend: ArrayBackend
    galilean: bool = False


def fit(
    kind: str,
    settings_of_network: dict[str, Any],
    delays: Delays,
    training: Sequence[Run],
    validation: Sequence[Run],
    *,
    sampling_rate_hz: float,
    settings: TrainingSettings | None = None,
    agitation: Agitation | None = None,
    with_fill: bool = False,
    backend: ArrayBackend | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> tuple[ReducedOrderModel, TrainingRecord]:
    """Train a model; with output delays first one step ahead (NARX), then running free (NOE).

    Parameters
    ----------
    kind : str
        One of `NETWORKS`.
    settings_of_network : dict
        Such as ``{"n_neurons": 35}``.
    delays : Delays
    training, validation : sequence of Run
        Each run stays apart from the others.
    sampling_rate_hz : float
    settings : TrainingSettings, optional
    agitation : Agitation, optional
        Memory of the liquid's state; its scales are those of the training runs.
    with_fill : bool
        Whether the network sees the fill level, which every run must then tell.
    backend : ArrayBackend, optional
        NumPy by default.
    on_epoch : callable, optional
        Takes every epoch as it ends. A KeyboardInterrupt within training keeps the best model so far.

    Returns
    -------
    model : ReducedOrderModel
    record : TrainingRecord

    Raises
    ------
    InputError
        If there is nothing to train on or nothing to validate with, or the model cannot do without the mean of its
        inputs.
    AnalysisError
        If input or output is constant, or no start gave a stable model.
    """
    chosen = settings or TrainingSettings()
    # of the training runs only: the validation run decides when to stop and between starts, nothing else
    scaling = fitted_scaling(training, validation, delays, chosen)
    if agitation is not None:
        agitation = agitation.fitted([run.x for run in training], sampling_rate_hz)
        delays = replace(delays, n_states=agitation.n_states)
    fill = None
    if with_fill:
        fill = FillInput.fitted([run.fill_level for run in training], chosen.fill_spread)
        delays = replace(delays, n_states=delays.n_states + 1)
    network = network_of(kind, {**settings_of_network, "n_inputs": delays.n_regressors})
    if chosen.galilean:
        require_galilean(network, delays, agitation)
    task = _Task(
        network,
        delays,
        [scaled_run(run, scaling, agitation, sampling_rate_hz, fill) for run in training],
        [scaled_run(run, scaling, agitation, sampling_rate_hz, fill) for run in validation],
        scaling.output_scale,
        backend or array_backend(),
        chosen.galilean,
    )
    task, basis = _with_fewer_regressors(task)
    best, started, interrupted = _Best(), time.monotonic(), False
    try:
        for start in range(chosen.n_starts):
            _train_once(task, chosen, start, best, started=started, on_epoch=on_epoch or (lambda epoch: None))
    except KeyboardInterrupt:
        interrupted = True
        # interrupted before anything was trained: nothing could be given back
        if best.theta is None:
            raise
    if best.theta is None or best.epoch is None:
        raise AnalysisError("training", got="no stable model from any start", remedy="fewer output delays")
    ended = "interrupted" if interrupted else best.ended
    theta = best.theta if basis is None else network.lifted(best.theta, basis)  # type: ignore[attr-defined]
    model = ReducedOrderModel(network, theta, delays, scaling, sampling_rate_hz, agitation=agitation, fill=fill)
    return model, TrainingRecord(best.epochs, best.epoch, ended, interrupted)


def require_galilean(network: Network, delays: Delays, agitation: Agitation | None = None) -> None:
    """Refuse models that cannot be blind for the mean of their past inputs.

    Parameters
    ----------
    network : Network
    delays : Delays
    agitation : Agitation, optional

    Raises
    ------
    InputError
        If the network is none of normalised radial basis functions, has feedback, or sees a single past input or a
        state of the speed.

    Notes
    -----
    Where all centres are across the direction 1 of equal inputs, ‖φ + a1 − c_i‖² = ‖φ − c_i‖² + the same for all
    i, which cancels in the shares of a normalised network (B.7), and in those alone.
    """
    is_plain = isinstance(network, NormalisedRadialBasis) and not delays.outputs and agitation is None
    if not is_plain or len(delays.inputs) < 2:
        memory = "" if agitation is None else " and slow states"
        raise InputError(
            "model without the mean of its inputs",
            got=f"{network.kind} with {len(delays.inputs)} + {len(delays.outputs)} delays{memory}",
            allowed="normalised_rbf, two delays or more, no feedback, no slow states",
        )


def _with_fewer_regressors(task: _Task) -> tuple[_Task, FloatArray | None]:
    """The task along the directions in which its regressors vary, where these are few; their basis."""
    # a model that runs free feeds its outputs back one by one, which has no other directions
    if task.delays.outputs or not isinstance(task.network, NetworkOfDistances):
        return task, None
    basis = principal_directions(task.training, task.delays, galilean=task.galilean)
    n_directions = basis.shape[1]
    # beyond half of them the sums of a delay line by correlations cost less
    if 2 * n_directions > task.delays.n_regressors and not task.galilean:
        return task, None
    training, validation = (
        [along(basis, run, task.delays) for run in runs] for runs in (task.training, task.validation)
    )
    fewer = replace(
        task,
        network=task.network.along(n_directions),
        delays=Delays((), n_states=n_directions),
        training=training,
        validation=validation,
    )
    return fewer, basis


def _train_once(
    task: _Task,
    settings: TrainingSettings,
    start: int,
    best: _Best,
    *,
    started: float,
    on_epoch: Callable[[Epoch], None],
) -> None:
    """One start: one step ahead, then free if there is feedback."""
    # every start its own stream, whatever the starts before it drew
    rng = np.random.default_rng([settings.seed, start])
    theta = task.backend.asarray(task.network.initial(*_initial_samples(task, rng), rng))
    is_line = task.delays.is_one_line
    size = _LINE_BLOCK if is_line else BLOCK
    one_step = OneStepProblem(
        task.backend,
        task.network,
        lambda: blocks(task.training, task.delays, size),
        is_line,
        n_alike=1 if task.delays.inputs else task.network.n_inputs,
        # of a delay line moments are correlations, which know no gaps
        every=1 if is_line else max(1, n_samples(task.training, task.delays) // _enough(task.network)),
    )
    # NOE starts from a trained NARX, as in the source (2.2)
    stages: list[tuple[LeastSquaresProblem, ArrayBackend]] = [(one_step, task.backend)]
    if task.delays.outputs:  # sample by sample, compiled: on the host
        stages.append((_FreeRunProblem(task.network, task.delays, task.training), array_backend()))
    number = 0
    for problem, backend in stages:
        is_last = problem is stages[-1][0]
        # epochs one step ahead are no candidates for the best free-running model
        own = best if is_last else _Best()
        # one step ahead only prepares the free run: a rising validation error does not end it
        own_settings = settings if is_last else replace(settings, patience=settings.n_epochs)
        theta, number = _descend(
            replace(task, backend=backend),
            problem,
            backend.asarray(theta),
            own_settings,
            own,
            place=(start, number, started),
            on_epoch=on_epoch,
        )


def _descend(
    task: _Task,
    problem: LeastSquaresProblem,
    theta: Array,
    settings: TrainingSettings,
    best: _Best,
    *,
    place: tuple[int, int, float],
    on_epoch: Callable[[Epoch], None],
) -> tuple[FloatArray, int]:
    """Epoch after epoch until the validation error keeps rising, nothing improves, or the epochs are used up."""
    start, number, started = place
    n_training, n_validation = n_samples(task.training, task.delays), n_samples(task.validation, task.delays)
    unit = task.output_scale**2
    step: Step | None = Step(*problem.improved(theta))
    stop, ended = EarlyStop(settings.patience, settings.least_gain), "epochs used up"
    for done in range(settings.n_epochs + 1):
        assert step is not None
        theta = step.theta
        parameters = task.backend.to_numpy(theta)
        # free-running from the first epoch on, as the model will be used
        validation = _free_squares(task.network, task.delays, parameters, task.validation) / n_validation
        epoch = Epoch(
            start,
            number,
            step.squares / n_training * unit,
            validation * unit,
            time.monotonic() - started,
        )
        best.take(epoch, parameters)
        on_epoch(epoch)
        number += 1
        if reason := stop.reason(validation):
            ended = reason
            break
        if done == settings.n_epochs:
            break
        step = next_step(problem, step, task.backend.xp)
        if step is None:
            ended = "no further improvement"
            break
    if best.epoch is not None and best.epoch.start == start:
        best.ended = ended
    return task.backend.to_numpy(theta), number


def _enough(network: Network) -> int:
    """Samples from which the curvature of a sum of squares is known well enough for a step."""
    return _SAMPLES_PER_PARAMETER * network.n_parameters


@dataclass(frozen=True)
class _FreeRunProblem:
    """The error of a model running free from measured outputs at the start of every stretch."""

    network: Any
    delays: Delays
    runs: list[Run]

    def _stretches(self) -> Iterator[tuple[Run, free_run.Stretch]]:
        for run in self.runs:
            for first, last in segments(run, self.delays):
                yield run, free_run.Stretch(first, last)

    def normal_sums(self, theta: Array) -> NormalSums:
        n = self.network.n_parameters
        sums, squares = free_run.SensitivitySums(np.zeros((n, n)), np.zeros(n)), 0.0
        model = feedback_model(self.network, theta, self.delays)
        for run, stretch in self._stretches():
            squares += free_run.free_run_sums(model, run.x, run.y, stretch, sums)
        # the compiled loop fills the lower triangle only
        return NormalSums(sums.matrix + np.tril(sums.matrix, -1).T, sums.gradient, squares)

    def improved(self, theta: Array) -> tuple[Array, float]:
        # with feedback the weights enter their own later outputs: nothing is linear, so nothing is solved for
        return theta, _free_squares(self.network, self.delays, theta, self.runs)


def _free_squares(network: Network, delays: Delays, theta: FloatArray, runs: Sequence[Run]) -> float:
    """Σ e² of free runs; infinite if one runs away."""
    # without feedback one step ahead is the free run
    if not delays.outputs:
        squares = 0.0
        for phi, target in blocks(runs, delays, BLOCK):
            error = target - network.output(np, theta, phi)
            squares += float(error @ error)
        return squares
    squares = 0.0
    model = feedback_model(network, theta, delays)
    for run in runs:
        for first, last in segments(run, delays):
            own = run.y.copy()
            reached = free_run.run_free(model, run.x, own, free_run.Stretch(first, last))
            if reached < last:
                return math.inf
            squares += float(np.sum((run.y[first:last] - own[first:last]) ** 2))
    return squares


def fitted_scaling(
    training: Sequence[Run], validation: Sequence[Run], delays: Delays, settings: TrainingSettings
) -> Scaling:
    """Scale so that all regressors together have the wanted spread and the output is of size one.

    Parameters
    ----------
    training, validation : sequence of Run
        The training runs give the scales; of both there must be samples.
    delays : Delays
    settings : TrainingSettings
        Its `input_spread`.

    Raises
    ------
    InputError
        If no stretch of either is longer than the delays.
    AnalysisError
        If input or output is constant.
    """
    for what, runs in (("training", training), ("validation", validation)):
        if not n_samples(runs, delays):
            longest = max((run.x.size for run in runs), default=0)
            raise InputError(
                f"{what} runs",
                got=f"no stretch longer than the delays ({delays.longest} samples; longest run {longest})",
                remedy="take fewer delays or longer runs",
            )
    x = np.concatenate([run.x for run in training])
    y = np.concatenate([run.y for run in training])
    found = []
    for what, values in (("input", x), ("output", y)):
        mean, spread = float(np.nanmean(values)), float(np.nanstd(values))
        if not spread > 1e-12 * max(abs(mean), 1e-300):
            raise AnalysisError(f"{what} of the training runs", got="a constant", remedy="train on runs that move")
        found.append((mean, spread))
    (x_mean, x_spread), (y_mean, y_spread) = found
    # Distances in the network's values add up over the delays: divided by √n, so that as many neurons are felt
    # with 70 delays as with 2.
    return Scaling(x_mean, x_spread * math.sqrt(delays.n_regressors) / settings.input_spread, y_mean, y_spread)


def _initial_samples(task: _Task, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Some samples of the training runs, evenly drawn."""
    total = n_samples(task.training, task.delays)
    share = min(1.0, _LARGEST_INITIAL / total)
    parts = []
    for phi, target in blocks(task.training, task.delays, BLOCK):
        # drawn evenly over all runs, block by block: centres shall lie where the motion was
        kept = rng.random(target.size) < share
        parts.append((phi[:, kept], target[kept]))
    phi, target = np.concatenate([p for p, _ in parts], axis=1), np.concatenate([t for _, t in parts])
    if not target.size:
        phi, target = next(iter(blocks(task.training, task.delays, BLOCK)))
    return phi, target
