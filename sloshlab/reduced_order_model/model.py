"""A trained model: what it sees, how it is scaled, and its parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model import free_run
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.array_backend import ArrayBackend, array_backend
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.fill_input import FillInput
from sloshlab.reduced_order_model.networks.network import Network
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run, regressors, segments

FloatArray = NDArray[np.float64]
_BLOCK: Final = 4096
RUNAWAY: Final = 100.0
"""A free run has run away when its output is this many times the scale of the training outputs."""


@dataclass(frozen=True)
class Scaling:
    """From physical to the network's values: (value − offset)/scale.

    Attributes
    ----------
    input_offset, input_scale, output_offset, output_scale : float
    """

    input_offset: float = 0.0
    input_scale: float = 1.0
    output_offset: float = 0.0
    output_scale: float = 1.0

    def scaled(self, run: Run) -> Run:
        """Return the run in the network's values."""
        return Run(
            (run.x - self.input_offset) / self.input_scale,
            (run.y - self.output_offset) / self.output_scale,
            run.name,
        )

    def output_of(self, values: FloatArray) -> FloatArray:
        """Return outputs of the network in physical values."""
        return values * self.output_scale + self.output_offset


def scaled_run(
    run: Run,
    scaling: Scaling,
    agitation: Agitation | None,
    sampling_rate_hz: float,
    fill: FillInput | None = None,
) -> Run:
    """Return a run in the network's values, with the states of the liquid and the fill that the model sees."""
    if agitation is None and fill is None:
        return scaling.scaled(run)
    rows = [] if agitation is None else list(agitation.regressors(run.x, sampling_rate_hz))
    if fill is not None:
        rows.append(fill.regressor(run.x.size, run.fill_level))
    return replace(scaling.scaled(run), states=np.stack(rows))


@dataclass(frozen=True)
class ReducedOrderModel:
    """NFIR (no output delays) or NARX/NOE model of one input and one output.

    Attributes
    ----------
    network : Network
    theta : ndarray, shape (n_parameters,)
    delays : Delays
    scaling : Scaling
    sampling_rate_hz : float
        Of the samples that the delays count.
    facts : dict
        What it was trained on, and how; kept with it.
    agitation : Agitation, optional
        Memory of the liquid's state: slow states seen beside the delay line. A run then begins at rest.
    break_up : BreakUp, optional
        Memory of the liquid's state: a gain on the output. A run then begins at rest.
    fill : FillInput, optional
        The fill level among the regressors; `at_fill` says which.
    """

    network: Network
    theta: FloatArray
    delays: Delays
    scaling: Scaling
    sampling_rate_hz: float
    facts: dict[str, Any] = field(default_factory=dict)
    agitation: Agitation | None = None
    break_up: BreakUp | None = None
    fill: FillInput | None = None

    def __post_init__(self) -> None:
        n_remembered = 0 if self.agitation is None else self.agitation.n_states
        n_states = n_remembered + (self.fill is not None)
        if self.delays.n_states != n_states or (self.agitation and len(self.agitation.scales) != n_remembered):
            allowed = f"{self.delays.n_states} scaled states, as many as among the regressors"
            raise InputError("memory of the model", got=f"{n_states} states", allowed=allowed)
        # a break-up is a gain on a model of the steady state: fed back, its output would not be what the network
        # was trained on
        if self.break_up is not None and self.delays.outputs:
            raise InputError("memory of the model", got="a break-up and feedback", allowed="one of them")
        if self.theta.shape != (self.network.n_parameters,) or not np.isfinite(self.theta).all():
            raise InputError(
                "parameters of the model",
                got=f"{self.theta.shape}",
                allowed=f"{self.network.n_parameters} finite numbers",
            )
        if self.network.n_inputs != self.delays.n_regressors:
            raise InputError(
                "model", got=f"{self.network.n_inputs} inputs", allowed=f"{self.delays.n_regressors} regressors"
            )

    @property
    def has_feedback(self) -> bool:
        """Whether it sees its own outputs."""
        return bool(self.delays.outputs)

    @property
    def constant_regressors(self) -> FloatArray:
        """What the network sees behind the delay lines without change during a run: its fill level, if any.

        Raises
        ------
        InputError
            If it sees the fill level and none was set.
        """
        return np.empty(0) if self.fill is None else self.fill.regressor(1)

    def at_fill(self, level: float) -> ReducedOrderModel:
        """Return the model for a tank filled to a level.

        Parameters
        ----------
        level : float
            Height of the liquid over height of the tank.

        Raises
        ------
        InputError
            If the model does not see the fill level, or the level is beyond those of its training.
        """
        if self.fill is None:
            raise InputError("model", got="one that does not see the fill level", allowed="one trained with it")
        return replace(self, fill=self.fill.at(level))

    def predict(self, x: ArrayLike, y: ArrayLike, backend: ArrayBackend | None = None) -> FloatArray:
        """Return ŷ one step ahead; past outputs are the measured ones.

        Parameters
        ----------
        x, y : array_like, shape (n,)
            Measured input and output; NaN where nothing is known.
        backend : ArrayBackend, optional

        Returns
        -------
        ndarray, shape (n,)
            NaN where a regressor is not known.
        """
        chosen = backend or array_backend()
        run = scaled_run(Run.of(x, y), self.scaling, self.agitation, self.sampling_rate_hz, self.fill)
        # a model without feedback needs no measured output: it predicts where that is lost, too
        known = run if self.has_feedback else replace(run, y=np.nan_to_num(run.y))
        theta, predicted = chosen.asarray(self.theta), np.full(run.x.size, np.nan)
        for first, last in segments(known, self.delays):
            for start in range(first, last, _BLOCK):
                stop = min(start + _BLOCK, last)
                phi = chosen.asarray(regressors(known, self.delays, start, stop))
                predicted[start:stop] = chosen.to_numpy(self.network.output(chosen.xp, theta, phi))
        outputs = self.scaling.output_of(predicted)
        if self.break_up is not None:
            # on the physical force: a share of nothing must be nothing, which an offset of the scaling would
            # spoil
            outputs *= self.break_up.share(np.asarray(x, np.float64), self.sampling_rate_hz)
        return outputs

    def simulate(self, x: ArrayLike, start: ArrayLike | None = None) -> FloatArray:
        """Return ŷ of a free run: the model sees the input and its own outputs.

        Parameters
        ----------
        x : array_like, shape (n,)
            Input; NaN where nothing is known.
        start : array_like, shape (n,), optional
            Outputs to start from, at the beginning and after every gap; zero by default.

        Returns
        -------
        ndarray, shape (n,)
            NaN where the input of the delay lines is not known.

        Raises
        ------
        AnalysisError
            If a model with feedback runs away.
        """
        values = np.asarray(x, np.float64)
        if not self.has_feedback:
            return self.predict(values, np.zeros_like(values))
        outputs = np.zeros_like(values) if start is None else np.nan_to_num(np.asarray(start, np.float64))
        run = self.scaling.scaled(Run.of(values, outputs))
        model, simulated = self.compiled(), np.full(values.size, np.nan)
        for first, last in segments(run, self.delays):
            own = run.y.copy()
            reached = free_run.run_free(model, run.x, own, free_run.Stretch(first, last))
            if reached < last:
                raise AnalysisError(
                    "free run of the model",
                    got=f"it runs away at {reached / self.sampling_rate_hz:.3f} s",
                    remedy="take a model without feedback, or train this one further",
                )
            # what was given to start from is not simulated and stays NaN
            simulated[first:last] = own[first:last]
        return self.scaling.output_of(simulated)

    def compiled(self) -> free_run.FeedbackModel:
        """Network and delay lines for the compiled loops of a free run.

        Raises
        ------
        AnalysisError
            If the network has none.
        """
        if not isinstance(self.network, NormalisedRadialBasis | RadialBasis):
            raise AnalysisError(
                "model with feedback", got=self.network.kind, allowed="normalised_rbf, rbf", remedy="use NFIR"
            )
        return feedback_model(self.network, self.theta, self.delays)


def feedback_model(network: Any, theta: FloatArray, delays: Delays) -> free_run.FeedbackModel:
    """Return a radial basis network with its delay lines for the compiled loops."""
    inputs, outputs = np.array(delays.inputs, np.int64), np.array(delays.outputs, np.int64)
    return free_run.FeedbackModel(free_run.kind_of(network), theta, network.n_neurons, inputs, outputs, RUNAWAY)
