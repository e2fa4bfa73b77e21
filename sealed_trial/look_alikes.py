"""Pairs of explanations that a plan cannot tell apart: the truth, and every set of names that is as good.

A spring or a mass of the structure is none of them: it is a number of the baseline, which may be wrong
(`hidden_rig.wrongly_believed`). Nor are dashpots and losses without frequency: the relaxing springs of these creep
after a release or a start, by which decays tell them apart to thousands of nats, and one frequency to hundreds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sealed_trial.hidden_physics import structure_effects, tank_effects
from sealed_trial.hidden_physics.effect import HiddenEffect
from sealed_trial.laboratory.hidden_rig import HiddenRig
from sealed_trial.laboratory.test_plan import TestPlan

_CARRIED, _ALL = ("sdof", "beam"), ("sdof", "beam", "shaker")


@dataclass(frozen=True)
class LookAlike:
    """A truth and its equals.

    Attributes
    ----------
    truth : HiddenEffect
    equals : tuple of tuple of str
        Sets of effects, each of which explains as much, the truth included.
    plans : tuple of str
        Where this holds.
    """

    truth: HiddenEffect
    equals: tuple[tuple[str, ...], ...]
    plans: tuple[str, ...]


_ASYMMETRIC = (("asymmetric_friction",), ("coulomb_friction", "constant_force"))
_TANK_MASS = (("mass_error",), ("effective_mass",))

LOOK_ALIKES: Final = (
    LookAlike(
        HiddenEffect(
            "asymmetric_friction", "structure", structure_effects.asymmetric, _CARRIED, True, is_friction=True
        ),
        _ASYMMETRIC,
        ("sdof_decays", "sdof_base", "sdof_mixed", "beam_decays", "beam_mixed", "beam_base"),
    ),
    LookAlike(
        HiddenEffect("mass_error", "tank", tank_effects.mass, _ALL),
        _TANK_MASS,
        ("sdof_base", "sdof_mixed", "beam_decays", "beam_base", "beam_mixed", "shaker_sweeps", "shaker_stepped"),
    ),
    LookAlike(
        HiddenEffect("viscous_damping", "tank", tank_effects.viscous, ("shaker",), tank_model="frozen"),
        (("viscous_damping",), ("sensor_delay",)),
        ("shaker_one_frequency",),
    ),
    LookAlike(
        HiddenEffect("mass_error", "tank", tank_effects.mass, ("sdof", "shaker")),
        (("mass_error",), ("effective_mass",), ("sensor_gain",)),
        ("sdof_decays", "sdof_one_frequency", "shaker_one_frequency"),
    ),
)


def possible_look_alikes(plan: TestPlan, rig: HiddenRig) -> list[LookAlike]:
    """Those that hold for a plan and a rig."""
    tank_model = "viscous" if rig.tank_damping_kg_per_s else "frozen"
    return [
        alike
        for alike in LOOK_ALIKES
        if plan.name in alike.plans
        and plan.kind in alike.truth.kinds
        and alike.truth.tank_model in ("", tank_model)
        and not (alike.truth.is_friction and rig.coulomb_n)
    ]
