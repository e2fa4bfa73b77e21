"""Effects of the excitation: what the base does beyond the motion that is measured at it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.missing_physics.candidate import Effect, EffectParameter, Numbers, Surroundings, multiples, register
from sloshlab.missing_physics.effects import scales
from sloshlab.missing_physics.evidence import (
    CONSERVATIVE,
    MEMORY,
    NO_ONSET,
    ODD_IN_DISPLACEMENT,
    ONSET,
    THIRD_ORDER,
)
from sloshlab.missing_physics.extension import ActingDrive, Extension
from sloshlab.missing_physics.prior import Range
from sloshlab.twin.base_rocking import BaseRocking


def _has_root_moment(at: Surroundings) -> bool:
    """Only a beam with dimensions bends at a root; a twin of the user's own has no rig."""
    described = getattr(at.rig, "structure", None)
    return described is not None and described.kind == "beam" and described.length_m is not None


def _compliance(at: Surroundings) -> float:
    """Of a root whose rotation carries the tip as far as the beam's own deflection does."""
    described, structure = at.rig.structure, at.twin.structure
    assert described is not None
    assert described.length_m is not None
    assert structure is not None
    return 1.0 / (structure.static_stiffness_n_per_m * described.length_m**2)


def _rocks(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    del channel
    assert at.rig.structure is not None
    return Extension(structure=BaseRocking(at.rig.structure, numbers["compliance_rad_per_n_m"]).of)


_ROCKING: Final = (EffectParameter("compliance_rad_per_n_m", 0.0, 1.0, range=Range(3e-4, 0.5, _compliance)),)
# The root turns without mass or damping of its own, in the modes that the rig file has.
ROCKING = register(
    Effect(
        "base_rocking",
        "excitation",
        "the base turns by θ = c M, M the root moment of the beam; every place moves by x θ, the tip by l θ",
        _ROCKING,
        multiples(_ROCKING, {"compliance_rad_per_n_m": 0.03}, {"compliance_rad_per_n_m": 0.005}),
        _rocks,
        "two accelerometers on the base, one before and one behind the root, in a decay",
        _has_root_moment,
        spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT, NO_ONSET),
    )
)


def saturated(limit: float, dead_zone: float) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """What acts of a command: nothing within the dead zone, what is beyond it up to the limit."""
    return lambda command: np.clip(command - np.clip(command, -dead_zone, dead_zone), -limit, limit)


def _saturates(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    del at
    key = (f"excitation.actuator_saturation.{channel}", *sorted(numbers.items()))
    return Extension(drives=(ActingDrive(channel, saturated(numbers["limit"], numbers["dead_zone"]), key),))


def _commands(at: Surroundings) -> list[str]:
    """Channels that alone drive: of several that read one motion, none is a command."""
    drives_alone = at.rig is None or (at.twin.structure is not None and len(at.driving) == 1)
    return [name for name in at.driving if drives_alone]


def _up_to_the_peak(at: Surroundings) -> Mapping[str, tuple[float, float]]:
    """A limit at the largest command is none."""
    peak = scales.peak(at)
    return {"limit": (0.01 * peak, peak), "dead_zone": (0.0, 0.99 * peak)}


_SATURATION: Final = (
    EffectParameter("limit", 1e-12, 1e12, range=Range(0.05, 1.0, scales.peak, is_log=False)),
    EffectParameter("dead_zone", 0.0, 1e12, range=Range(0.0, 0.5, scales.peak, is_log=False)),
)
# In the unit of the channel that drives, which is read before the actuator and not behind it.
SATURATION = register(
    Effect(
        "actuator_saturation",
        "excitation",
        "between the command u and what acts: u less what the dead zone takes, within ±limit",
        _SATURATION,
        multiples(
            _SATURATION,
            *(
                {"limit": limit, "dead_zone": dead_zone}
                # a limit that is hardly met leads to the one that is there, but not past a dead zone that is not
                for limit, dead_zone in (
                    (0.8, 0.005),
                    *((limit, 0.0) for limit in (0.98, 0.9, 0.7, 0.5)),
                    (0.98, 0.1),
                    (0.7, 0.1),
                )
            ),
        ),
        _saturates,
        "the motion or force of the actuator beside its command, at two levels",
        places=_commands,
        limits=_up_to_the_peak,
        spoken_for_by=(MEMORY, ONSET, THIRD_ORDER),
    )
)
