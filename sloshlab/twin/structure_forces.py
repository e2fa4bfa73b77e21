"""Forces on the structure (and some on the tank): friction, drag, springs, masses. All act against motion.

Names and parameters are those of the vocabulary of effects; v, x are those of the place.
"""

from __future__ import annotations

from math import exp, pi

from sloshlab.twin.law import BASE_ACCELERATION, DIRECTION, DISPLACEMENT, VELOCITY, law, law_of_lanes
from sloshlab.twin.terms import ForceKind, Parameter, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

_BOTH = ("structure", "tank")


@law_of_lanes
def _viscous(motion, parameters, memory, rates):
    return -parameters[0] * motion[VELOCITY]


@law_of_lanes
def _coulomb(motion, parameters, memory, rates):
    # DIRECTION, not the sign of v: the engine holds it within a step and knows sticking, where it asks for both
    # signs
    return -parameters[0] * motion[DIRECTION]


@law
def _asymmetric(motion, parameters, memory, rates):
    return -parameters[0] if motion[DIRECTION] > 0 else parameters[1]


@law
def _stribeck(motion, parameters, memory, rates):
    # at rest this is the static force, which is what sticking can hold
    ratio = motion[VELOCITY] / parameters[2]
    return -(parameters[0] + (parameters[1] - parameters[0]) * exp(-ratio * ratio)) * motion[DIRECTION]


@law_of_lanes
def _quadratic_drag(motion, parameters, memory, rates):
    return -parameters[0] * motion[VELOCITY] * abs(motion[VELOCITY])


@law
def _cubic(motion, parameters, memory, rates):
    return -parameters[0] * motion[DISPLACEMENT] ** 3


@law
def _quadratic(motion, parameters, memory, rates):
    return -parameters[0] * motion[DISPLACEMENT] ** 2


@law_of_lanes
def _linear(motion, parameters, memory, rates):
    return -parameters[0] * motion[DISPLACEMENT]


@law_of_lanes
def _constant(motion, parameters, memory, rates):
    return parameters[0]


@law
def _nothing(motion, parameters, memory, rates):
    return 0.0


@law
def _clearance(motion, parameters, memory, rates):
    force = 0.0
    # the force is continuous at the gap, its slope is not: a switch keeps the order of the scheme
    if memory[0] < 0:
        force -= parameters[1] * (motion[DISPLACEMENT] - parameters[0])
    if memory[1] < 0:
        force -= parameters[1] * (motion[DISPLACEMENT] + parameters[0])
    return force


@law
def _clearance_events(motion, parameters, memory, values):
    values[0] = parameters[0] - motion[DISPLACEMENT]
    values[1] = parameters[0] + motion[DISPLACEMENT]
    return 0.0


@law
def _missing_mode(motion, parameters, memory, rates):
    omega = 2 * pi * parameters[0]
    damping, mass = 2 * parameters[1] * omega, parameters[2]
    stretch, closing = memory[0] - motion[DISPLACEMENT], memory[1] - motion[VELOCITY]
    force = mass * (omega * omega * stretch + damping * closing)
    # its motion is relative to the base like that of the place, and a shaken base drives it as it drives any
    # mode; felt by the relative motion only, modes of shaken structures stayed hidden
    rates[0], rates[1] = memory[1], -force / mass - motion[BASE_ACCELERATION]
    return force


VISCOUS_DAMPING = register(
    ForceKind(
        "viscous_damping",
        _BOTH,
        (Parameter("damping_n_s_per_m", "N s m-1", -1e4, 1e4),),
        _viscous,
        equation="−c v",
    )
)
COULOMB_FRICTION = register(
    ForceKind(
        "coulomb_friction",
        _BOTH,
        (Parameter("force_n", "N", 0.0, 1e4),),
        _coulomb,
        dry_friction=True,
        equation="−F sgn v; sticks within ±F",
    )
)
ASYMMETRIC_FRICTION = register(
    ForceKind(
        "asymmetric_friction",
        ("structure",),
        (Parameter("force_up_n", "N", 0.0, 1e4), Parameter("force_down_n", "N", 0.0, 1e4)),
        _asymmetric,
        dry_friction=True,
        equation="−F₊ for v > 0, +F₋ for v < 0",
    )
)
STRIBECK_FRICTION = register(
    ForceKind(
        "stribeck_friction",
        ("structure",),
        (
            Parameter("coulomb_n", "N", 0.0, 1e4),
            Parameter("static_n", "N", 0.0, 1e4),
            Parameter("stribeck_velocity_m_per_s", "m s-1", 1e-6, 1e3),
        ),
        _stribeck,
        dry_friction=True,
        equation="−(F_c + (F_s − F_c) exp(−(v/v_s)²)) sgn v",
    )
)
QUADRATIC_DRAG = register(
    ForceKind(
        "quadratic_drag",
        _BOTH,
        (Parameter("drag_n_s2_per_m2", "N s2 m-2", 0.0, 1e5),),
        _quadratic_drag,
        equation="−c v|v|",
    )
)
CUBIC_STIFFNESS = register(
    ForceKind(
        "cubic_stiffness",
        ("structure",),
        (Parameter("stiffness_n_per_m3", "N m-3", -1e12, 1e12),),
        _cubic,
        equation="−k₃ x³",
    )
)
QUADRATIC_STIFFNESS = register(
    ForceKind(
        "quadratic_stiffness",
        ("structure",),
        (Parameter("stiffness_n_per_m2", "N m-2", -1e9, 1e9),),
        _quadratic,
        equation="−k₂ x²",
    )
)
STIFFNESS_CHANGE = register(
    ForceKind(
        "stiffness_change",
        ("structure",),
        (Parameter("stiffness_n_per_m", "N m-1", -1e7, 1e7),),
        _linear,
        equation="−Δk x",
    )
)
CLEARANCE = register(
    ForceKind(
        "clearance",
        ("structure",),
        (Parameter("gap_m", "m", 0.0, 1.0), Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e8)),
        _clearance,
        events=_clearance_events,
        n_switches=2,
        equation="−k (x ∓ gap) beyond ±gap",
    )
)
MISSING_MODE = register(
    ForceKind(
        "missing_mode",
        ("structure",),
        (
            Parameter("frequency_hz", "Hz", 0.01, 1e4),
            Parameter("damping_ratio", "1", 0.0, 1.0),
            Parameter("participation", "kg", 1e-9, 1e3),
        ),
        _missing_mode,
        memory=lambda values, table: (0.0, 0.0),
        moves_with_place=True,
        equation="mass on a spring and damper at the place, which the base moves too",
    )
)
MASS_ERROR = register(
    ForceKind(
        "mass_error",
        _BOTH,
        (Parameter("mass_kg", "kg", -1e3, 1e3),),
        _nothing,
        mass=lambda values: values["mass_kg"],
        equation="−Δm a",
    )
)
CONSTANT_FORCE = register(
    ForceKind("constant_force", ("structure",), (Parameter("force_n", "N", -1e4, 1e4),), _constant, equation="F")
)
