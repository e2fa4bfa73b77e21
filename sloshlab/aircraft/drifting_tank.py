"""A trained model in a tank that drifts: what is slower than any training is taken out of the velocity it sees.

A tank at constant velocity is a tank at rest: its liquid gives no force. A network that was trained on velocities
of shakers has never seen one and answers with a force, which carries a free aircraft on; it then climbs at metres
per second while its flutter goes on. A clamped wing cannot drift.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.model import AircraftTank
from sloshlab.aircraft.tank_simulation import VerticalForce
from sloshlab.aircraft.vertical_sloshing import model_in_tank
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.validity_domain import BINS_PER_OCTAVE, ValidityDomain

FloatArray = npt.NDArray[np.float64]

_SHARE_OF_LOWEST: Final = 0.25
"""Of the lowest frequency of the training: the filter leads by 14° there, by 7° an octave above."""


class DriftFree:
    """A model behind a filter of first order, v − v_slow with v̇_slow = ω_c (v − v_slow), v held over a step.

    Parameters
    ----------
    model : VerticalForce
    corner_hz : float
        ω_c/2π.

    Attributes
    ----------
    sampling_rate_hz : float
        Of the model.
    """

    def __init__(self, model: VerticalForce, corner_hz: float) -> None:
        self._model, self.sampling_rate_hz = model, model.sampling_rate_hz
        self._gain = -math.expm1(-2 * math.pi * corner_hz / model.sampling_rate_hz)
        self._slow = 0.0

    def begin(self) -> None:
        """Put the liquid to rest."""
        self._model.begin()
        self._slow = 0.0

    def step(self, velocity_m_per_s: float) -> FloatArray:
        """As the model, without the slow part of the velocity."""
        self._slow += self._gain * (velocity_m_per_s - self._slow)
        return self._model.step(velocity_m_per_s - self._slow)

    @property
    def runs_away(self) -> bool:
        """Whether the model's force has lost all bounds."""
        return self._model.runs_away


def corner_of_drift_hz(model: ReducedOrderModel) -> float | None:
    """A quarter of the lowest frequency that a model was trained at, in the time of its training.

    Parameters
    ----------
    model : ReducedOrderModel

    Returns
    -------
    float or None
        None if it does not tell its training.
    """
    if "domain" not in model.facts:
        return None
    domain = ValidityDomain.of_facts(model.facts["domain"])
    return float(_SHARE_OF_LOWEST * 2 ** (domain.first_bin / BINS_PER_OCTAVE))


def model_in_drifting_tank(model: ReducedOrderModel, tank: AircraftTank) -> VerticalForce:
    """A trained model in the units of a tank of a free aircraft; as in a clamped one if its training is not told.

    Parameters
    ----------
    model : ReducedOrderModel
    tank : AircraftTank
    """
    stepped, corner_hz = model_in_tank(model, tank), corner_of_drift_hz(model)
    if corner_hz is None:
        return stepped
    return DriftFree(stepped, corner_hz * stepped.sampling_rate_hz / model.sampling_rate_hz)
