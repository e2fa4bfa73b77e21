"""An effect that is one more force of the twin."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from sloshlab.missing_physics.candidate import (
    Effect,
    EffectParameter,
    MissingForces,
    Numbers,
    Surroundings,
    multiples,
    register,
)
from sloshlab.missing_physics.evidence import (
    CONSERVATIVE,
    DISSIPATIVE,
    NO_ONSET,
    ODD_IN_DISPLACEMENT,
    ODD_IN_VELOCITY,
    RATE_DEPENDENT,
    RATE_INDEPENDENT,
    STATE_FUNCTION,
    THIRD_ORDER,
    WORK_1,
    WORK_2,
    WORK_3,
)
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import Range
from sloshlab.twin.terms import ForceKind

MOST_DAMPING_OF_A_MODE: Final = 0.2
"""Ratio to the critical one; a coordinate with more damping has no resonance and is no mode."""

VISCOUS_CHARACTER: Final = (DISSIPATIVE, ODD_IN_VELOCITY, STATE_FUNCTION, RATE_DEPENDENT, WORK_2, NO_ONSET)
COULOMB_CHARACTER: Final = (
    DISSIPATIVE,
    ODD_IN_VELOCITY,
    STATE_FUNCTION,
    RATE_INDEPENDENT,
    WORK_1,
    NO_ONSET,
    THIRD_ORDER,
)
DRAG_CHARACTER: Final = (DISSIPATIVE, ODD_IN_VELOCITY, STATE_FUNCTION, RATE_DEPENDENT, WORK_3)
INERTIAL_CHARACTER: Final = (CONSERVATIVE, ODD_IN_DISPLACEMENT, STATE_FUNCTION, NO_ONSET)
STRUCTURAL_CHARACTER: Final = (DISSIPATIVE, ODD_IN_VELOCITY, RATE_INDEPENDENT, WORK_2, NO_ONSET)
"""Terms of `evidence.TERMS` that hold for forces of one kind, in the structure as in the tank."""


def has_structure(surroundings: Surroundings) -> bool:
    """Whether there is a structure to act on."""
    return surroundings.twin.structure is not None


def rocks(surroundings: Surroundings) -> bool:
    """Whether the tank rotates as it moves, as at the tip of a beam."""
    structure = surroundings.rig.structure
    return structure is not None and structure.kind == "beam"


def force_effect(
    kind: ForceKind,
    block: str,
    starts: Callable[[Surroundings], Iterable[Numbers]] | Sequence[Numbers],
    *,
    ranges: Mapping[str, Range] | None = None,
    name: str = "",
    fixed: Callable[[Surroundings], Mapping[str, float]] | None = None,
    fitted: tuple[str, ...] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    separated_by: str = "",
    needs: Callable[[Surroundings], bool] | None = None,
    spoken_for_by: tuple[str, ...] = (),
    variant_of: str = "",
    reduces_to: tuple[str, ...] = (),
    corrects: str = "",
    size: tuple[str, ...] = (),
    limits: tuple[str, ...] = (),
) -> Effect:
    """Register a force of the twin as an effect.

    Parameters
    ----------
    kind : ForceKind
    block : {"structure", "tank"}
    starts : callable or sequence of mapping
        (surroundings) → sets of numbers to start from; or these sets, in multiples of the scales of the ranges.
    ranges : mapping of str to Range
        What is believed of the numbers; without one, two decades about the largest start.
    fixed : callable, optional
        (surroundings) → numbers that are not fitted.
    fitted : tuple of str
        Names of those that are; all by default.
    name : str, optional
        That of the kind by default.
    bounds : mapping, optional
        Narrower ones than those of the kind.
    separated_by, needs, spoken_for_by, variant_of, reduces_to, corrects, size
        As of `Effect`.
    limits : tuple of str, optional
        Numbers that the force does not exceed in either direction: the missing force shows their mean.

    Examples
    --------
    >>> from sloshlab.twin.structure_forces import QUADRATIC_DRAG
    >>> [parameter.name for parameter in QUADRATIC_DRAG.parameters]
    ['drag_n_s2_per_m2']
    """

    def extension(numbers: Numbers, surroundings: Surroundings, channel: str) -> Extension:
        del channel
        # Numbers that scale with the size of the effect are known from the rig and not fitted beside it.
        known = fixed(surroundings) if fixed is not None else {}
        return Extension(terms=(kind(place=block, **{**known, **numbers}),))

    narrower = bounds or {}
    parameters = tuple(
        EffectParameter(
            parameter.name,
            *narrower.get(parameter.name, (parameter.low, parameter.high)),
            range=(ranges or {}).get(parameter.name),
        )
        for parameter in kind.parameters
        if not fitted or parameter.name in fitted
    )
    begun = starts if callable(starts) else multiples(parameters, *starts)
    return register(
        Effect(
            name or kind.name,
            block,
            kind.equation,
            parameters,
            begun,
            extension,
            separated_by,
            needs or (has_structure if block == "structure" else lambda surroundings: True),
            spoken_for_by=spoken_for_by,
            variant_of=variant_of,
            reduces_to=reduces_to,
            corrects=corrects,
            size=size,
            proposes=_at_its_limits(begun, limits),
        )
    )


def _at_its_limits(
    starts: Callable[[Surroundings], Iterable[Numbers]], limits: tuple[str, ...]
) -> Callable[[Surroundings, MissingForces, Numbers], Iterable[Numbers]]:
    """Starts whose limits have in mean the size of the missing force where it is largest most of the time.

    Friction that slides is at its limit. Where it holds it is less, and along a recorded motion that has stopped
    the noise of the velocity says nothing of it.
    """

    def proposed(at: Surroundings, missing: MissingForces, known: Numbers) -> list[Numbers]:
        del known
        sizes = [np.abs(force.force_n[force.force_n != 0.0]) for force in missing.values()]
        limit = max((float(np.median(size)) for size in sizes if size.size), default=0.0)
        if not limits or limit <= 0.0:
            return []
        means = [(start, float(np.mean([start[name] for name in limits]))) for start in starts(at)]
        return [{**start, **{name: start[name] * limit / mean for name in limits}} for start, mean in means]

    return proposed
