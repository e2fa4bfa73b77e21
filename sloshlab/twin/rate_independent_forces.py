"""Losses that do not depend on how fast a cycle is run through: structural damping, hysteresis, friction and play.

They turn where the velocity does, friction behind a play where its slider starts and where the play ends, too; the
engine finds these instants, so that no step looks across them. Relaxing springs are linear and turn nowhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Final

from sloshlab.twin.law import DIRECTION, DISPLACEMENT, VELOCITY, law
from sloshlab.twin.terms import ForceKind, Parameter, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"


_N_SPRINGS: Final = 8
_FASTEST: Final = 16.0
"""Rate of the fastest spring over that of the middle one."""


@law
def _structural(motion, parameters, memory, rates):
    # Reid's law: 4 ∫₀ᴬ (π/2) η k x dx = πηkA² per cycle. Nonlinear: modes at one time share it as they share
    # friction.
    amplitude = abs(motion[DISPLACEMENT])
    return -0.5 * pi * parameters[0] * parameters[1] * amplitude * motion[DIRECTION]


@law
def _bouc_wen(motion, parameters, memory, rates):
    """ż = α v − βγ |v| |z|^(ν−1) z − βδ v |z|^ν; the switches are the signs of v and z."""
    z, v = memory[0], motion[VELOCITY]
    # |z| by the switch: within a step z may have crossed zero, where its power must not become NaN
    size = memory[2] * z
    if size < 0.0:
        size = 0.0
    # the usual exponent needs no power function
    power = size if parameters[3] == 1.0 else size ** parameters[3]
    rates[0] = parameters[0] * v - power * (parameters[1] * memory[1] * v * memory[2] + parameters[2] * v)
    return -z


@law
def _bouc_wen_events(motion, parameters, memory, values):
    values[0] = motion[VELOCITY]
    values[1] = memory[0]
    return 0.0


STRUCTURAL_DAMPING = register(
    ForceKind(
        "structural_damping",
        ("structure",),
        (Parameter("loss_factor", "1", 0.0, 0.6), Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e9)),
        _structural,
        dry_friction=True,
        equation="−(π/2) η k |x| sgn v, which takes πηkA² per cycle whatever its frequency",
    )
)
"""k is what the place feels; its loss factor η is that of App. A, W/(2πU) with U = kA²/2."""


@law
def _relaxing_springs(motion, parameters, memory, rates):
    """−ηk Σ(y_j − s_j x)/Σl_j, ẏ_j = v − r_j y_j; l_j and s_j are loss and storage of a spring at ω.

    Rates r_j lie evenly on a logarithmic axis, from ω/10^d to 16 ω, d decades of creep.
    """
    middle = 2.0 * pi * parameters[2]
    slowest = 10.0 ** -parameters[3]
    # evenly spaced logarithms: such a sum loses nearly the same share at all frequencies between the slowest and
    # the fastest
    ratio = (_FASTEST / slowest) ** (1.0 / (_N_SPRINGS - 1))
    relative, force, loss = slowest, 0.0, 0.0
    for j in range(_N_SPRINGS):
        rates[j] = motion[VELOCITY] - relative * middle * memory[j]
        # storage of a relaxing spring at ω; it is taken off, so that the law adds loss and no stiffness there
        of_unit = 1.0 / (1.0 + relative * relative)
        force += memory[j] - of_unit * motion[DISPLACEMENT]
        loss += relative * of_unit
        relative *= ratio
    return -parameters[0] * parameters[1] * force / loss


LINEAR_STRUCTURAL_DAMPING = register(
    ForceKind(
        "linear_structural_damping",
        ("structure",),
        (
            Parameter("loss_factor", "1", 0.0, 0.6),
            Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e9),
            Parameter("frequency_hz", "Hz", 1e-3, 1e5),
            Parameter("creep_decades", "1", 0.3, 4.0, 1.2),
        ),
        _relaxing_springs,
        memory=lambda values, table: (0.0,) * _N_SPRINGS,
        equation="−η k H(x): a loss factor that no frequency changes, by springs that relax about frequency_hz",
    )
)
"""The same loss as a linear force, which superposes: for motion of many frequencies at once.

What relaxes slower than the motion creeps: after a release the rest position moves for a while.
"""


def _rate_of_yielding(parameters: Mapping[str, float], speed_m_per_s: float) -> float:
    """|v| ν α/z_y, z_y = (α/(βγ + βδ))^(1/ν): how fast a loop comes to the force at which it yields.

    Unloading may be steeper, but begins where the velocity turns.
    """
    stiffness, exponent = parameters["stiffness_n_per_m"], parameters["exponent"]
    closing = parameters["beta_gamma"] + parameters["beta_delta"]
    if stiffness <= 0.0 or closing <= 0.0:
        return 0.0
    limit: float = (stiffness / closing) ** (1.0 / exponent)
    return speed_m_per_s * exponent * stiffness / limit


HYSTERESIS = register(
    ForceKind(
        "hysteresis",
        ("structure",),
        (
            Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e9),
            Parameter("beta_gamma", "N(1-nu) m-1", -1e9, 1e9),
            Parameter("beta_delta", "N(1-nu) m-1", -1e9, 1e9),
            Parameter("exponent", "1", 1.0, 5.0, 1.0),
        ),
        _bouc_wen,
        events=_bouc_wen_events,
        n_switches=2,
        memory=lambda values, table: (0.0,),
        memory_rate=_rate_of_yielding,
        equation="−z, ż = α v − βγ |v| |z|^(ν−1) z − βδ v |z|^ν (Bouc–Wen)",
    )
)
"""β, γ and δ of the usual form enter only as these two products; α is the stiffness where z is small."""


@law
def _behind_play(motion, parameters, memory, rates):
    """−k max(|e| − p/2, 0) sgn e, at most F; ė = v, zero while the slider follows.

    The switches are the signs of v, of what is beyond the play and of what is beyond the friction.
    """
    behind = memory[0]
    slips = memory[3] > 0.0
    # while the slider follows, e stays: friction is moved, not stretched further
    rates[0] = 0.0 if slips and behind * memory[1] > 0.0 else motion[VELOCITY]
    force = parameters[0] if slips else parameters[2] * (abs(behind) - 0.5 * parameters[1])
    if memory[2] < 0.0:
        force = 0.0
    return -force if behind > 0.0 else force


@law
def _behind_play_events(motion, parameters, memory, values):
    beyond = abs(memory[0]) - 0.5 * parameters[1]
    values[0] = motion[VELOCITY]
    values[1] = beyond
    values[2] = parameters[2] * beyond - parameters[0]
    return 0.0


FRICTION_BEHIND_PLAY = register(
    ForceKind(
        "friction_behind_play",
        ("structure",),
        (
            Parameter("force_n", "N", 0.0, 1e7),
            Parameter("play_m", "m", 0.0, 10.0),
            Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e12),
        ),
        _behind_play,
        events=_behind_play_events,
        n_switches=3,
        memory=lambda values, table: (0.0,),
        equation="−k max(|e| − p/2, 0) sgn e, at most F; ė = v, zero where the slider follows",
    )
)
"""A slider with dry friction F that is moved through a stiffness k with a play p; e is how far it is behind.

After a reversal the force unloads, the play is crossed at no force, and the stiffness loads again.
"""


@law
def _behind_play_by_direction(motion, parameters, memory, rates):
    """As behind a play, with F₊ while the slider is pulled upward and F₋ while it is pulled downward."""
    behind = memory[0]
    slips = memory[3] > 0.0
    rates[0] = 0.0 if slips and behind * memory[1] > 0.0 else motion[VELOCITY]
    limit = parameters[0] if behind > 0.0 else parameters[1]
    force = limit if slips else parameters[3] * (abs(behind) - 0.5 * parameters[2])
    if memory[2] < 0.0:
        force = 0.0
    return -force if behind > 0.0 else force


@law
def _behind_play_by_direction_events(motion, parameters, memory, values):
    beyond = abs(memory[0]) - 0.5 * parameters[2]
    limit = parameters[0] if memory[0] > 0.0 else parameters[1]
    values[0] = motion[VELOCITY]
    values[1] = beyond
    values[2] = parameters[3] * beyond - limit
    return 0.0


FRICTION_BEHIND_PLAY_BY_DIRECTION = register(
    ForceKind(
        "friction_behind_play_by_direction",
        ("structure",),
        (
            Parameter("force_up_n", "N", 0.0, 1e7),
            Parameter("force_down_n", "N", 0.0, 1e7),
            Parameter("play_m", "m", 0.0, 10.0),
            Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e12),
        ),
        _behind_play_by_direction,
        events=_behind_play_by_direction_events,
        n_switches=3,
        memory=lambda values, table: (0.0,),
        equation="−k max(|e| − p/2, 0) sgn e, at most F₊ for e > 0 and F₋ for e < 0; ė = v, zero where it follows",
    )
)
"""The same slider with another friction upward (F₊) than downward (F₋)."""
