"""Effects of the structure: friction, losses, springs, masses, modes."""

from __future__ import annotations

from sloshlab.missing_physics.candidate import Numbers, Surroundings
from sloshlab.missing_physics.effects import scales
from sloshlab.missing_physics.effects.force_effect import (
    COULOMB_CHARACTER,
    DRAG_CHARACTER,
    INERTIAL_CHARACTER,
    MOST_DAMPING_OF_A_MODE,
    STRUCTURAL_CHARACTER,
    VISCOUS_CHARACTER,
    force_effect,
)
from sloshlab.missing_physics.evidence import (
    CONSERVATIVE,
    CONSTANT,
    DISSIPATIVE,
    EVEN,
    MEMORY,
    NO_ONSET,
    ODD_IN_DISPLACEMENT,
    ODD_IN_VELOCITY,
    ONSET,
    RATE_INDEPENDENT,
    SECOND_ORDER,
    STATE_FUNCTION,
    THIRD_ORDER,
    WORK_1,
)
from sloshlab.missing_physics.prior import Range
from sloshlab.twin.rate_independent_forces import (
    FRICTION_BEHIND_PLAY,
    FRICTION_BEHIND_PLAY_BY_DIRECTION,
    HYSTERESIS,
    LINEAR_STRUCTURAL_DAMPING,
    STRUCTURAL_DAMPING,
)
from sloshlab.twin.structure_forces import (
    ASYMMETRIC_FRICTION,
    CLEARANCE,
    CONSTANT_FORCE,
    COULOMB_FRICTION,
    CUBIC_STIFFNESS,
    MASS_ERROR,
    MISSING_MODE,
    QUADRATIC_DRAG,
    QUADRATIC_STIFFNESS,
    STIFFNESS_CHANGE,
    STRIBECK_FRICTION,
    VISCOUS_DAMPING,
)

_OTHER_LEVELS = "decays or sweeps at two or more amplitudes"
_FRICTION = Range(1e-4, 1.0, scales.force)
_LOSS_FACTOR = Range(3e-4, 0.3)
_PLAY = Range(3e-3, 1.0, scales.displacement)
_BEHIND_PLAY = Range(0.03, 300.0, scales.secant_stiffness)
_OFF_RESONANCE = tuple(sign * 0.02 * n for n in range(1, 16) for sign in (1, -1))
"""Of mass or stiffness: from one to the next a frequency moves by 1 %, what a fit follows over 50 cycles."""


def _static_stiffness(at: Surroundings) -> float:
    """What the loss factor of the structure is a share of."""
    structure = at.twin.structure
    return scales.stiffness(at) if structure is None else structure.static_stiffness_n_per_m


VISCOUS = force_effect(
    VISCOUS_DAMPING,
    "structure",
    [{"damping_n_s_per_m": 0.01}],
    ranges={"damping_n_s_per_m": Range(3e-4, 1.0, scales.damping)},
    bounds={"damping_n_s_per_m": (0.0, 1e4)},
    separated_by=_OTHER_LEVELS + ", and at two frequencies",
    spoken_for_by=VISCOUS_CHARACTER,
)
# Dry friction gives the cost local minima, and what is named beside it is a draw to a degree: two simulations
# that agree to three parts in a million have ended in different ones.
COULOMB = force_effect(
    COULOMB_FRICTION,
    "structure",
    [{"force_n": share} for share in (0.003, 0.02)],
    ranges={"force_n": _FRICTION},
    separated_by=_OTHER_LEVELS + ", down to rest",
    spoken_for_by=COULOMB_CHARACTER,
    limits=("force_n",),
)

# The same force as dry friction of (F₊ + F₋)/2 with a constant force of (F₋ − F₊)/2, whatever is recorded.
ASYMMETRIC = force_effect(
    ASYMMETRIC_FRICTION,
    "structure",
    [{"force_up_n": 0.015, "force_down_n": 0.005}, {"force_up_n": 0.005, "force_down_n": 0.015}],
    ranges={"force_up_n": _FRICTION, "force_down_n": _FRICTION},
    separated_by="none: the two are the same force; measure the static rest position with the friction taken off",
    spoken_for_by=(DISSIPATIVE, ODD_IN_VELOCITY, STATE_FUNCTION, RATE_INDEPENDENT, WORK_1, NO_ONSET, CONSTANT),
    reduces_to=("coulomb_friction",),
    limits=("force_up_n", "force_down_n"),
)
# Where friction falls with the speed over all of the motion, what it takes away is what a damper adds: then it
# cannot be told from Coulomb friction and a damper.
STRIBECK = force_effect(
    STRIBECK_FRICTION,
    "structure",
    [{"coulomb_n": 0.01, "static_n": 0.02, "stribeck_velocity_m_per_s": share} for share in (0.05, 0.2, 0.6)],
    ranges={
        "coulomb_n": _FRICTION,
        "static_n": _FRICTION,
        "stribeck_velocity_m_per_s": Range(3e-3, 2.0, scales.velocity),
    },
    bounds={"stribeck_velocity_m_per_s": (1e-3, 1e3)},
    separated_by="slow motion about the Stribeck velocity",
    spoken_for_by=(DISSIPATIVE, ODD_IN_VELOCITY, STATE_FUNCTION, NO_ONSET, THIRD_ORDER),
    reduces_to=("coulomb_friction",),
    limits=("coulomb_n", "static_n"),
)
DRAG = force_effect(
    QUADRATIC_DRAG,
    "structure",
    [{"drag_n_s2_per_m2": 0.01}],
    ranges={"drag_n_s2_per_m2": Range(3e-4, 1.0, scales.drag)},
    separated_by=_OTHER_LEVELS,
    spoken_for_by=DRAG_CHARACTER,
)
# Per static stiffness of the structure, as a loss factor is stated; fitted together, both would be one number.
STRUCTURAL = force_effect(
    STRUCTURAL_DAMPING,
    "structure",
    [{"loss_factor": 0.01}],
    ranges={"loss_factor": _LOSS_FACTOR},
    fixed=lambda at: {"stiffness_n_per_m": _static_stiffness(at)},
    fitted=("loss_factor",),
    separated_by="the same amplitude at two frequencies",
    spoken_for_by=STRUCTURAL_CHARACTER,
)
# Reid's law above is nonlinear; relaxing springs have a nearly constant loss factor over some decades and are
# linear.
LINEAR_STRUCTURAL = force_effect(
    LINEAR_STRUCTURAL_DAMPING,
    "structure",
    [{"loss_factor": 0.01, "creep_decades": decades} for decades in (1.2, 2.4)],
    ranges={"loss_factor": _LOSS_FACTOR, "creep_decades": Range(0.3, 4.0, is_log=False)},
    fixed=lambda at: {"stiffness_n_per_m": _static_stiffness(at), "frequency_hz": at.frequency_hz},
    fitted=("loss_factor", "creep_decades"),
    size=("loss_factor",),
    separated_by="the same amplitude at two frequencies",
    spoken_for_by=STRUCTURAL_CHARACTER,
    variant_of="structural_damping",
)


def _bouc_wen(at: Surroundings) -> list[Numbers]:
    stiffness = 0.05 * scales.stiffness(at)
    # Products that a recording can tell: force and shape of a Bouc–Wen loop depend on β γ and β δ only.
    return [
        {
            "stiffness_n_per_m": stiffness,
            "beta_gamma": 0.5 * stiffness / (stiffness * share * at.displacement_m) ** exponent,
            "beta_delta": 0.5 * stiffness / (stiffness * share * at.displacement_m) ** exponent,
            "exponent": exponent,
        }
        for share in (0.1, 0.3)
        for exponent in (1.0, 2.0)
    ]


def _yield(at: Surroundings) -> float:
    """βγ of a loop that yields at 3 % of m a, between 1/x of the exponent 1 and 1/(x z) of 2: 1/(x √z)."""
    return float(1.0 / (at.displacement_m * (0.03 * at.force_n) ** 0.5))


_YIELD = Range(0.01, 1e4, _yield, may_be_negative=True)
"""Up to 1/x_y of what yields at 3 % of m a and is as steep as the largest stiffness below, 300 m a/x."""
# An exponent of one is a value like any other, so that it may rest at that bound.
BOUC_WEN = force_effect(
    HYSTERESIS,
    "structure",
    _bouc_wen,
    ranges={
        "stiffness_n_per_m": Range(1e-3, 300.0, scales.secant_stiffness),
        "beta_gamma": _YIELD,
        "beta_delta": _YIELD,
        "exponent": Range(1.0, 3.0, is_log=False),
    },
    bounds={"exponent": (1.0, 3.0)},
    separated_by="slow loops of several amplitudes",
    spoken_for_by=(DISSIPATIVE, MEMORY, RATE_INDEPENDENT),
)


BEHIND_PLAY = force_effect(
    FRICTION_BEHIND_PLAY,
    "structure",
    # dampers and joints of machines hold as much as moves; what a rig has beside its spring holds little
    [{"force_n": share, "play_m": 0.1, "stiffness_n_per_m": 5 * share} for share in (0.2, 1.0, 0.02)],
    ranges={"force_n": _FRICTION, "play_m": _PLAY, "stiffness_n_per_m": _BEHIND_PLAY},
    separated_by="slow reversals at several amplitudes, with the force read while it is low",
    spoken_for_by=(DISSIPATIVE, MEMORY, RATE_INDEPENDENT),
    reduces_to=("coulomb_friction",),
    limits=("force_n",),
)
# A constant force is nested in it: it moves the middle of the loop by (F₋ − F₊)/2 as long as the slider follows.
BEHIND_PLAY_BY_DIRECTION = force_effect(
    FRICTION_BEHIND_PLAY_BY_DIRECTION,
    "structure",
    [
        {"force_up_n": up, "force_down_n": down, "play_m": 0.1, "stiffness_n_per_m": 5 * max(up, down)}
        for up, down in ((0.6, 0.3), (0.3, 0.6), (0.02, 0.01), (0.01, 0.02))
    ],
    ranges={
        "force_up_n": _FRICTION,
        "force_down_n": _FRICTION,
        "play_m": _PLAY,
        "stiffness_n_per_m": _BEHIND_PLAY,
    },
    separated_by="slow reversals at several amplitudes, with the force read while it is low",
    spoken_for_by=(DISSIPATIVE, MEMORY, RATE_INDEPENDENT, CONSTANT),
    variant_of="friction_behind_play",
    reduces_to=("friction_behind_play", "asymmetric_friction", "coulomb_friction"),
    limits=("force_up_n", "force_down_n"),
)
CUBIC = force_effect(
    CUBIC_STIFFNESS,
    "structure",
    [{"stiffness_n_per_m3": share} for share in (0.03, -0.03)],
    ranges={"stiffness_n_per_m3": Range(1e-3, 3.0, scales.cubic_stiffness, may_be_negative=True)},
    separated_by="a larger range of amplitudes on both sides of rest",
    spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT, STATE_FUNCTION, THIRD_ORDER),
)
# A cubic spring about an offset is a cubic and a quadratic one.
QUADRATIC = force_effect(
    QUADRATIC_STIFFNESS,
    "structure",
    [{"stiffness_n_per_m2": share} for share in (0.03, -0.03)],
    ranges={"stiffness_n_per_m2": Range(1e-3, 3.0, scales.quadratic_stiffness, may_be_negative=True)},
    separated_by="a larger range of amplitudes on both sides of rest",
    spoken_for_by=(CONSERVATIVE, EVEN, STATE_FUNCTION, SECOND_ORDER),
)
STIFFNESS = force_effect(
    STIFFNESS_CHANGE,
    "structure",
    [{"stiffness_n_per_m": share} for share in _OFF_RESONANCE],
    ranges={"stiffness_n_per_m": Range(1e-3, 1.0, scales.stiffness, may_be_negative=True)},
    separated_by="a known mass added to the tank",
    spoken_for_by=INERTIAL_CHARACTER,
    corrects="stiffness of the structure",
)
# Its size is the stiffness: a larger gap is less of it.
GAP = force_effect(
    CLEARANCE,
    "structure",
    [{"gap_m": share, "stiffness_n_per_m": 0.2} for share in (0.2, 0.5, 0.8)],
    ranges={
        "gap_m": Range(0.02, 1.0, scales.displacement, is_log=False),
        "stiffness_n_per_m": Range(3e-3, 100.0, scales.stiffness),
    },
    separated_by="amplitudes just below and above the gap",
    spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT, STATE_FUNCTION, ONSET, THIRD_ORDER),
    size=("stiffness_n_per_m",),
)
# Far from its frequency a mode acts as a mass or as a spring, which are nested in it.
MODE = force_effect(
    MISSING_MODE,
    "structure",
    lambda at: [
        {
            "frequency_hz": frequency,
            "damping_ratio": 0.02,
            "participation": 0.02 * at.moving_mass_kg,
        }
        for frequency in (*(ratio * at.frequency_hz for ratio in (0.6, 1.6, 2.5, 4.0)), *at.missed_hz)
    ],
    ranges={
        "frequency_hz": Range(0.1, 20.0, scales.frequency),
        "damping_ratio": Range(5e-4, MOST_DAMPING_OF_A_MODE),
        "participation": Range(1e-4, 1.0, scales.mass),
    },
    bounds={"damping_ratio": (0.0, MOST_DAMPING_OF_A_MODE)},
    separated_by="a sweep over the missing mode's frequency",
    spoken_for_by=(MEMORY,),
    size=("participation",),
)
# Of either sign, as a stiffness: on one mode a mass is a softer spring with less damping, whatever moves it.
MASS = force_effect(
    MASS_ERROR,
    "structure",
    [{"mass_kg": share} for share in _OFF_RESONANCE],
    ranges={"mass_kg": Range(1e-3, 0.7, scales.mass, may_be_negative=True)},
    bounds={"mass_kg": (-10.0, 10.0)},
    separated_by="a known mass added to the tank",
    spoken_for_by=INERTIAL_CHARACTER,
    corrects="mass of the structure",
)
# It shows in the static part of a displacement, where the zero of the sensor may be off by as much.
OFFSET = force_effect(
    CONSTANT_FORCE,
    "structure",
    [{"force_n": share} for share in (0.01, -0.01)],
    ranges={"force_n": Range(1e-4, 1.0, scales.force, may_be_negative=True)},
    separated_by="the static rest position",
    spoken_for_by=(CONSERVATIVE, EVEN, CONSTANT, NO_ONSET),
)
