"""Which classes a trial consists of, and which effects a plan can tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sealed_trial.hidden_physics.effect import HiddenEffect
from sealed_trial.hidden_physics.sensor_effects import SENSOR_EFFECTS
from sealed_trial.hidden_physics.structure_effects import STRUCTURE_EFFECTS
from sealed_trial.hidden_physics.tank_effects import TANK_EFFECTS
from sealed_trial.laboratory.hidden_rig import HiddenRig
from sealed_trial.laboratory.test_plan import TestPlan

CLASSES: Final = ("nothing", "retunable", "single", "pair", "masked", "look_alike", "outside")
SHARES: Final = (60, 20, 80, 25, 20, 20, 15)
"""Of 240 cases; other sizes in proportion."""

SINGLES: Final = (*STRUCTURE_EFFECTS, *TANK_EFFECTS, *SENSOR_EFFECTS)


def class_sizes(n_cases: int) -> dict[str, int]:
    """Numbers of cases of every class, by largest remainders.

    Examples
    --------
    >>> class_sizes(240)
    {'nothing': 60, 'retunable': 20, 'single': 80, 'pair': 25, 'masked': 20, 'look_alike': 20, 'outside': 15}
    >>> class_sizes(60)
    {'nothing': 15, 'retunable': 5, 'single': 20, 'pair': 6, 'masked': 5, 'look_alike': 5, 'outside': 4}
    """
    exact = np.array(SHARES) * n_cases / sum(SHARES)
    sizes = np.floor(exact).astype(int)
    for place in np.argsort(sizes - exact, kind="stable")[: n_cases - int(sizes.sum())]:
        sizes[place] += 1
    return dict(zip(CLASSES, sizes.tolist(), strict=True))


def possible(effects: Sequence[HiddenEffect], plan: TestPlan, rig: HiddenRig) -> list[HiddenEffect]:
    """Effects that this rig can have and this plan can tell from all others."""
    tank_model = "viscous" if rig.tank_damping_kg_per_s else "frozen"
    return [
        effect
        for effect in effects
        if plan.kind in effect.kinds
        and (plan.has_levels or not effect.needs_levels)
        and (plan.has_frequencies or not effect.needs_frequencies)
        and (plan.has_driven_base or not effect.needs_driven_base)
        and effect.tank_model in ("", tank_model)
        and not (effect.is_friction and rig.coulomb_n)
    ]
