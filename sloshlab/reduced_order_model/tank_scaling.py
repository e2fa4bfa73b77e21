"""A model of one tank used for another one of the same shape and fill level (2.33–2.35).

It works in similarity of ω̄ = Ω/√(g/h) and of the Froude number v̄ = v/√(gh), at equal accelerations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.rig import Rig

HYPOTHESES: Final = (
    "W̄ depends on ω̄ and v̄; Reynolds and Bond number are secondary",
    "the height of the tank is its main dimension; its base area does not matter",
    "both tanks are filled to the same level",
    "both tanks are boxes",
)
_SAME_FILL: Final = 0.01


@dataclass(frozen=True)
class TankScaling:
    """Factors from the tank that a model was trained on to another one.

    Attributes
    ----------
    time, velocity, force : float
        Times are √(h'/h), velocities √(h'/h), forces m_l'/m_l as large.
    reynolds, bond : float
        Factors of v h/ν and ρ g h²/σ, which the hypotheses disregard; NaN if the rigs do not tell them.
    """

    time: float
    velocity: float
    force: float
    reynolds: float
    bond: float

    @classmethod
    def between(cls, trained: Rig, other: Rig) -> TankScaling:
        """Return the factors from one tank to another.

        Parameters
        ----------
        trained, other : Rig

        Raises
        ------
        InputError
            If the fill levels differ.
        """
        levels = trained.liquid.fill_level, other.liquid.fill_level
        if abs(levels[0] - levels[1]) > _SAME_FILL:
            raise InputError(
                "fill level of the other tank",
                got=f"{levels[1]:g}",
                allowed=f"{levels[0]:g}, that of the tank the model was trained on",
                remedy="train a model at that fill level",
            )
        height = other.tank.height_m / trained.tank.height_m
        root = math.sqrt(height)
        return cls(
            root,
            root,
            other.liquid_mass_kg / trained.liquid_mass_kg,
            _ratio(trained.liquid.kinematic_viscosity_m2_per_s, other.liquid.kinematic_viscosity_m2_per_s)
            * root
            * height,
            _ratio(trained.liquid.surface_tension_n_per_m, other.liquid.surface_tension_n_per_m)
            * height**2
            * other.liquid.density_kg_per_m3
            / trained.liquid.density_kg_per_m3,
        )


def _ratio(before: float | None, after: float | None) -> float:
    return before / after if before and after else math.nan


def scaled_to(model: ReducedOrderModel, factors: TankScaling) -> ReducedOrderModel:
    """Return the model for another tank: same delays and parameters, other rate and units.

    Nothing is resampled: the delays count samples of another length. A simulation at another rate lets the
    model take its own steps.

    Parameters
    ----------
    model : ReducedOrderModel
    factors : TankScaling
    """
    old = model.scaling
    scaling = Scaling(
        old.input_offset * factors.velocity,
        old.input_scale * factors.velocity,
        old.output_offset * factors.force,
        old.output_scale * factors.force,
    )
    facts = {**model.facts, "scaled": {**vars(factors), "hypotheses": list(HYPOTHESES)}}
    return replace(model, scaling=scaling, sampling_rate_hz=model.sampling_rate_hz / factors.time, facts=facts)
