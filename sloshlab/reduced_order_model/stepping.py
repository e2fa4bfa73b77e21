"""A trained model in a loop, one step at a time: at t_k it sees the velocity there and says the force of t_{k+1}.

Its delays start at 1, so that the force never waits for the motion that it makes. Between two instants the force
is the cubic through f(k−2) … f(k+1): nothing is held, nothing lags.
"""

from __future__ import annotations

from dataclasses import astuple
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.reduced_order_model import free_run
from sloshlab.reduced_order_model.break_up import next_share
from sloshlab.reduced_order_model.model import RUNAWAY, ReducedOrderModel
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis

FloatArray = npt.NDArray[np.float64]

REST_STEPS: Final = 500
"""Steps for which a model with feedback has been at rest when a simulation begins."""
CUBIC: Final = np.array(
    [[0.0, 0.0, 1.0, 0.0], [1 / 6, -1.0, 1 / 2, 1 / 3], [0.0, 1 / 2, -1.0, 1 / 2], [-1 / 6, 1 / 2, -1 / 2, 1 / 6]]
)
"""Coefficients of 1, x, x², x³ of the cubic through values at x = −2, −1, 0, 1."""


def require_no_slow_states(model: ReducedOrderModel) -> None:
    """Refuse a model whose regressors a loop would have to integrate.

    Raises
    ------
    InputError
        If it sees slow states.
    """
    if model.agitation is not None:
        got = "a model with slow states among its regressors"
        raise InputError("rom", got=got, allowed="models without, or with a break-up", remedy="train another")


class SteppedModel:
    """A model that begins at rest and takes its own steps.

    Parameters
    ----------
    model : ReducedOrderModel
        Already in the units of its tank (`scaled_to`).

    Raises
    ------
    InputError
        If it sees the present input, slow states beside its delay lines, or a fill level that was not set.

    Attributes
    ----------
    sampling_rate_hz : float
        Of its steps.
    """

    def __init__(self, model: ReducedOrderModel) -> None:
        require_no_slow_states(model)
        if min(model.delays.inputs) < 1:
            raise InputError(
                "rom: input delays",
                got=", ".join(str(delay) for delay in sorted(model.delays.inputs)[:3]) + " …",
                allowed="1 and more",
                remedy="the force cannot wait for the motion it makes; train without the present input",
            )
        self._model, self.sampling_rate_hz = model, model.sampling_rate_hz
        self._of_inputs = np.array(model.delays.inputs) - 1
        self._of_outputs = np.array(model.delays.outputs, np.int64) - 1
        self._constants = model.constant_regressors
        self._break_up = None if model.break_up is None else np.array(astuple(model.break_up))
        network = model.network
        self._is_radial = isinstance(network, NormalisedRadialBasis | RadialBasis)
        n_neurons = network.n_neurons if isinstance(network, NormalisedRadialBasis | RadialBasis) else 0
        self._kind = free_run.kind_of(network) if self._is_radial else -1
        self._features, self._factors = np.empty(n_neurons), np.empty(n_neurons)
        self.begin()

    def begin(self) -> None:
        """Put the tank to rest: no motion, and what the model makes of it with its own outputs."""
        scaling, n_line = self._model.scaling, self._model.delays.longest
        self._velocities = np.full(n_line, -scaling.input_offset / scaling.input_scale)
        self._outputs = np.full(n_line, -scaling.output_offset / scaling.output_scale)
        self._forces, self._last_velocity = np.zeros(4), 0.0
        self._share = 1.0 if self._break_up is None else float(self._break_up[-1])
        # without feedback four steps fill the forces of the cubic; with it the model has to come to rest first
        for _ in range(REST_STEPS if self._model.has_feedback else 4):
            self.step(0.0)

    def step(self, velocity_m_per_s: float) -> FloatArray:
        """Take the velocity of this instant; return the force until the next one.

        Parameters
        ----------
        velocity_m_per_s : float
            Of the tank, absolute, upward positive.

        Returns
        -------
        ndarray, shape (4,)
            Coefficients [N] of 1, x, x², x³ with x from 0 to 1 over the step, upward positive.
        """
        scaling = self._model.scaling
        self._velocities[1:] = self._velocities[:-1]
        self._velocities[0] = (velocity_m_per_s - scaling.input_offset) / scaling.input_scale
        # the force that was said to lie ahead is that of this instant now
        self._outputs[1:] = self._outputs[:-1]
        self._outputs[0] = (self._forces[3] - scaling.output_offset) / scaling.output_scale
        self._forces[:3] = self._forces[1:]
        ahead = self._network() * scaling.output_scale + scaling.output_offset
        if self._break_up is not None:
            self._share = next_share(
                self._share, velocity_m_per_s, self._last_velocity, 1 / self.sampling_rate_hz, self._break_up
            )
            self._last_velocity = velocity_m_per_s
            ahead *= self._share
        self._forces[3] = ahead
        return np.asarray(CUBIC @ self._forces)

    @property
    def runs_away(self) -> bool:
        """Whether the force ahead is one that no training can have meant."""
        scaling = self._model.scaling
        # written so that NaN is caught, too
        return not abs((self._forces[3] - scaling.output_offset) / scaling.output_scale) <= RUNAWAY

    def _network(self) -> float:
        model = self._model
        phi = np.concatenate([self._velocities[self._of_inputs], self._outputs[self._of_outputs], self._constants])
        if self._is_radial:
            return float(free_run.evaluate(self._kind, model.theta, phi, self._features, self._factors))
        return float(model.network.output(np, model.theta, phi[:, None])[0])
