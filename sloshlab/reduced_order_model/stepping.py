"""A trained model in a loop of Python, one step at a time: what the tanks of an aircraft take.

Between two instants the force is the cubic through f(k−2) … f(k+1): nothing is held, nothing lags.
"""

from __future__ import annotations

from dataclasses import astuple
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.compiled_step import (
    FORCES,
    N_VALUES,
    rest,
    step_table,
    take_step,
    workspace_size,
)
from sloshlab.reduced_order_model.model import RUNAWAY, ReducedOrderModel

FloatArray = npt.NDArray[np.float64]

CUBIC: Final = np.array(
    [[0.0, 0.0, 1.0, 0.0], [1 / 6, -1.0, 1 / 2, 1 / 3], [0.0, 1 / 2, -1.0, 1 / 2], [-1 / 6, 1 / 2, -1 / 2, 1 / 6]]
)
"""Coefficients of 1, x, x², x³ of the cubic through values at x = −2, −1, 0, 1."""


def require_steppable(model: ReducedOrderModel) -> None:
    """Refuse a model that no loop with the motion can take step by step.

    Parameters
    ----------
    model : ReducedOrderModel

    Raises
    ------
    InputError
        If a loop would have to integrate regressors, slow states, or the model sees the present input.
    """
    if model.agitation is not None:
        got = "a model with slow states among its regressors"
        raise InputError("rom", got=got, allowed="models without, or with a break-up", remedy="train another")
    # the force would have to wait for the motion that it makes
    if min(model.delays.inputs) < 1:
        raise InputError(
            "rom: input delays",
            got=", ".join(str(delay) for delay in sorted(model.delays.inputs)[:3]) + " …",
            allowed="1 and more",
            remedy="the force on the tank cannot wait for the motion it makes; train without the present input",
        )


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
        require_steppable(model)
        self._scaling, self.sampling_rate_hz = model.scaling, model.sampling_rate_hz
        table = step_table(model)
        # in the order of the places of the values in `compiled_step`, of which the last are the twin's
        values = np.zeros(N_VALUES)
        values[:5] = model.sampling_rate_hz, *astuple(model.scaling)
        self._numbers = np.concatenate([values, table, np.zeros(workspace_size(table))])
        self._workspace = self._numbers[N_VALUES + table.size :]
        self._forces = self._workspace[FORCES : FORCES + 4]
        self.begin()

    def begin(self) -> None:
        """Put the tank to rest: no motion, and what the model makes of it with its own outputs."""
        self._workspace[:] = 0.0
        rest(self._numbers)

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
        take_step(self._numbers, float(velocity_m_per_s))
        return np.asarray(CUBIC @ self._forces)

    @property
    def runs_away(self) -> bool:
        """Whether the force ahead is one that no training can have meant."""
        # written so that NaN is caught, too
        return not abs((self._forces[3] - self._scaling.output_offset) / self._scaling.output_scale) <= RUNAWAY
