"""A model of one tank used for another one of the same shape and fill level (2.33–2.35).

It works in similarity of ω̄ = Ω/√(g/h) and of the Froude number v̄ = v/√(gh), at equal accelerations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.scaling_error import ScalingError, scaling_error
from sloshlab.rig import Rig

HYPOTHESES: Final = (
    "W̄ depends on ω̄ and v̄; Reynolds and Bond number are secondary",
    "the height of the tank is its main dimension; its base area does not matter",
    "both tanks are filled to the same level",
    "both tanks are boxes",
)
_SAME_FILL: Final = 0.01
_SAME: Final = 1e-9
_NEEDED: Final = ("fill_level", "tank_height_m", "liquid_mass_kg")
FULL_MASS: Final = "full_liquid_mass_kg"
"""Fact of a model of several fills: mass of the liquid that would fill the tank, whose forces it says."""
_LIQUID: Final = ("kinematic_viscosity_m2_per_s", "surface_tension_n_per_m", "density_kg_per_m3")


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
        return cls.of_facts(tank_facts(trained), other)

    @classmethod
    def of_facts(cls, facts: Mapping[str, Any], other: Rig) -> TankScaling:
        """Return the factors from the tank that a model remembers to another one.

        Parameters
        ----------
        facts : mapping
            As `tank_facts` gives them; fill level, height and mass must be there.
        other : Rig

        Raises
        ------
        InputError
            If the facts do not tell the tank, or the fill levels differ.
        """
        level, height_m, mass_kg = (_stated(facts, name) for name in _NEEDED)
        if abs(level - other.liquid.fill_level) > _SAME_FILL:
            raise InputError(
                "fill level of the other tank",
                got=f"{other.liquid.fill_level:g}",
                allowed=f"{level:g}, that of the tank the model was trained on",
                remedy="train a model at that fill level",
            )
        height = other.tank.height_m / height_m
        # (2.33, 2.34): equal ω̄ and v̄ at equal accelerations make times and velocities grow with √h
        root, now = math.sqrt(height), tank_facts(other)
        viscosity, tension, density = (_ratio(facts.get(name), now[name]) for name in _LIQUID)
        # (2.35) for the force; Re and Bo follow and are told, since they are not held
        return cls(
            root, root, other.liquid_mass_kg / mass_kg, viscosity * root * height, tension * height**2 / density
        )

    @property
    def is_same(self) -> bool:
        """Whether nothing has to be scaled."""
        return max(abs(factor - 1) for factor in (self.time, self.velocity, self.force)) < _SAME

    @property
    def error(self) -> ScalingError:
        """What the law may be wrong by; the liquid is taken to be the same where the rigs do not tell it."""
        # of one liquid Re grows with h √h and Bo with h²
        reynolds = self.time**3 if math.isnan(self.reynolds) else self.reynolds
        return scaling_error(reynolds, self.time**4 if math.isnan(self.bond) else self.bond)


def tank_facts(rig: Rig) -> dict[str, float | None]:
    """Return what a model must remember of the tank that it is trained on.

    Parameters
    ----------
    rig : Rig
    """
    return {
        "fill_level": rig.liquid.fill_level,
        "tank_height_m": rig.tank.height_m,
        "liquid_mass_kg": rig.liquid_mass_kg,
        **{name: getattr(rig.liquid, name) for name in _LIQUID},
    }


def _stated(facts: Mapping[str, Any], name: str) -> float:
    value = facts.get(name)
    if not isinstance(value, int | float) or not 0 < value < math.inf:
        raise InputError(
            f"model: {name} of its training",
            got=repr(value)[:40],
            allowed="a positive number",
            remedy="train it again",
        )
    return float(value)


def _ratio(before: object, after: object) -> float:
    if isinstance(before, int | float) and isinstance(after, int | float) and before and after:
        return before / after
    return math.nan


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
    scaled = {**vars(factors), "hypotheses": list(HYPOTHESES), "error": vars(factors.error)}
    facts = {**model.facts, "scaled": scaled}
    memory = model.agitation and model.agitation.scaled(time=factors.time, velocity=factors.velocity)
    return replace(
        model,
        scaling=scaling,
        sampling_rate_hz=model.sampling_rate_hz / factors.time,
        facts=facts,
        agitation=memory,
        break_up=model.break_up and model.break_up.scaled(factors.time),
    )


def filled_model(model: ReducedOrderModel, fill_level: float) -> ReducedOrderModel:
    """Return a model of several fills as that of its own tank at one of them; any other model as it is.

    Parameters
    ----------
    model : ReducedOrderModel
        One that sees the fill says forces on the mass of a full tank, `full_liquid_mass_kg` of its facts.
    fill_level : float

    Returns
    -------
    ReducedOrderModel
        Forces are those on the liquid that is there; its facts tell this tank.

    Raises
    ------
    InputError
        If the fill level is beyond those of the training, or the model does not tell its tank.
    """
    if model.fill is None or model.fill.level is not None:
        return model
    full_kg, old = _stated(model.facts, FULL_MASS), model.scaling
    scaling = replace(
        old, output_offset=old.output_offset * fill_level, output_scale=old.output_scale * fill_level
    )
    facts = {**model.facts, "fill_level": fill_level, "liquid_mass_kg": full_kg * fill_level}
    return replace(model.at_fill(fill_level), scaling=scaling, facts=facts)


def model_for_tank(model: ReducedOrderModel, rig: Rig) -> tuple[ReducedOrderModel, TankScaling]:
    """Return a model in the units of a tank and at its fill, and how far that tank is from its own.

    Parameters
    ----------
    model : ReducedOrderModel
        Whose facts tell the tank of its training.
    rig : Rig

    Raises
    ------
    InputError
        If the model does not tell its tank, or was trained at other fill levels.
    """
    filled = filled_model(model, rig.liquid.fill_level)
    factors = TankScaling.of_facts(filled.facts, rig)
    return (filled if factors.is_same else scaled_to(filled, factors)), factors
