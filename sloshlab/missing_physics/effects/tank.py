"""Effects of the tank and its liquid."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Final

import numpy as np
from scipy.stats import qmc

from sloshlab.missing_physics.candidate import Effect, EffectParameter, Numbers, Surroundings, multiples, register
from sloshlab.missing_physics.effects import scales
from sloshlab.missing_physics.effects.force_effect import (
    COULOMB_CHARACTER,
    DRAG_CHARACTER,
    INERTIAL_CHARACTER,
    MOST_DAMPING_OF_A_MODE,
    VISCOUS_CHARACTER,
    force_effect,
    rocks,
)
from sloshlab.missing_physics.evidence import (
    CONSERVATIVE,
    DISSIPATIVE,
    HALF_ORDER,
    IMPULSIVE,
    MEMORY,
    ODD_IN_DISPLACEMENT,
    ODD_IN_VELOCITY,
    ONSET,
    STATE_FUNCTION,
    TIME_VARYING,
)
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import Range
from sloshlab.twin.liquid_effects import AIR_CUSHION, FARADAY_WAVE, LATERAL_MODE, LIQUID_DAMPING, LIQUID_LOSS
from sloshlab.twin.rocking_liquid import equivalent_lateral_mass_kg, rocking_liquid
from sloshlab.twin.structure_forces import COULOMB_FRICTION, MASS_ERROR, QUADRATIC_DRAG, VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL, EFFECTIVE_MASS, FADING_MASS, VARYING_MASS, VISCOUS_MAP
from sloshlab.twin.terms import Term

_CONTACT_HZ: Final = 50.0
"""Of the first starts of an impact."""
_LOWEST_PLACE, _HIGHEST_PLACE = np.log((0.25, 20.0, 0.05)), np.log((1.3, 200.0, 0.9))
_PLACES_OF_AN_IMPACT: Final = np.exp(
    qmc.scale(qmc.Halton(3, scramble=False).random(301)[1:], _LOWEST_PLACE, _HIGHEST_PLACE)
)
"""Share of the room, frequency [Hz] and damping ratio of a contact, spread evenly in logarithms (Halton).

An impact needs many starts: with a gap that differs by 2 % every later bounce is another one.
"""
_LEVELS = "decays or sweeps at accelerations below and above the threshold"


# Forces of the liquid, in shares of a liquid that is moved as a whole.
_SHARE_OF_LIQUID: Final = (3e-3, 10.0)
_BETA: Final = Range(3e-3, 2.0, may_be_negative=True)
_THRESHOLD: Final = Range(0.02, 1.0, scales.acceleration_g)
_AVERAGING: Final = Range(0.3, 30.0, scales.period)
_DAMPING_RATIO: Final = Range(5e-4, MOST_DAMPING_OF_A_MODE)


VISCOUS = force_effect(
    VISCOUS_DAMPING,
    "tank",
    [{"damping_n_s_per_m": 0.2}],
    ranges={"damping_n_s_per_m": Range(*_SHARE_OF_LIQUID, scales.liquid_damping)},
    bounds={"damping_n_s_per_m": (0.0, 1e4)},
    separated_by="two or more amplitudes and frequencies",
    spoken_for_by=VISCOUS_CHARACTER,
)
COULOMB = force_effect(
    COULOMB_FRICTION,
    "tank",
    [{"force_n": 0.1}],
    ranges={"force_n": Range(*_SHARE_OF_LIQUID, scales.liquid_force)},
    separated_by="two or more amplitudes",
    spoken_for_by=COULOMB_CHARACTER,
    limits=("force_n",),
)
DRAG = force_effect(
    QUADRATIC_DRAG,
    "tank",
    [{"drag_n_s2_per_m2": 0.2}],
    ranges={"drag_n_s2_per_m2": Range(*_SHARE_OF_LIQUID, scales.liquid_drag)},
    separated_by="two or more amplitudes",
    spoken_for_by=DRAG_CHARACTER,
)
MASS = force_effect(
    MASS_ERROR,
    "tank",
    [{"mass_kg": share} for share in (0.1, -0.1)],
    ranges={"mass_kg": Range(*_SHARE_OF_LIQUID, scales.liquid_mass, may_be_negative=True)},
    bounds={"mass_kg": (-10.0, 10.0)},
    separated_by="a known mass added to the tank, and a run with frozen liquid",
    spoken_for_by=INERTIAL_CHARACTER,
    corrects="mass of tank and liquid",
)
# A share β of the liquid's mass that does not follow is a mass of the tank: the two are always listed together.
EFFECTIVE = force_effect(
    EFFECTIVE_MASS,
    "tank",
    [{"beta": share} for share in (0.1, -0.1)],
    ranges={"beta": _BETA},
    fixed=lambda at: {"liquid_mass_kg": at.rig.liquid_mass_kg},
    fitted=("beta",),
    separated_by="runs with frozen and moving liquid, at several amplitudes",
    spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT, STATE_FUNCTION),
)
# Detunes a beam like a cubic spring or hysteresis, in the place of which it is tried.
FADING = force_effect(
    FADING_MASS,
    "tank",
    [{"beta": share, "fade_g": 0.4, "averaging_s": 2.0} for share in (0.1, -0.1)],
    ranges={"beta": _BETA, "fade_g": Range(0.03, 3.0, scales.acceleration_g), "averaging_s": _AVERAGING},
    fixed=lambda at: {"liquid_mass_kg": at.rig.liquid_mass_kg},
    fitted=("beta", "fade_g", "averaging_s"),
    bounds={"averaging_s": (0.05, 5.0)},
    separated_by="runs with frozen and moving liquid, at several amplitudes",
    spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT),
    variant_of="effective_mass",
)

_VARIES: Final = (
    "per_octave",
    "per_octave_squared",
    "per_doubling",
    "per_doubling_squared",
    "per_octave_and_doubling",
)


def _sweeps(at: Surroundings) -> bool:
    """Whether a shaker moves the tank at several frequencies, at each of which it has the mass of its own."""
    return at.twin.structure is None and not at.has_one_frequency


# On a shaker the liquid follows less at high frequencies and more at high levels: no constant effective mass
# explains that, a quadratic in octaves and doublings does.
VARYING = force_effect(
    VARYING_MASS,
    "tank",
    [
        {"beta": share, **{f"beta_{name}": slope for name in _VARIES}}
        for share in (0.1, -0.1)
        for slope in (0.1, -0.1)
    ],
    ranges={name: _BETA for name in ("beta", *(f"beta_{name}" for name in _VARIES))},
    fixed=lambda at: {
        "liquid_mass_kg": at.rig.liquid_mass_kg,
        "frequency_hz": at.frequency_hz,
        "level_g": 0.5 * scales.acceleration_g(at),
        "averaging_s": 2 / at.frequency_hz,
    },
    fitted=("beta", *(f"beta_{name}" for name in _VARIES)),
    needs=_sweeps,
    separated_by="runs with frozen and moving liquid, at several amplitudes",
    spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT),
    variant_of="effective_mass",
)


def _damping(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    del channel
    known = {"liquid_mass_kg": at.rig.liquid_mass_kg, "start_frequency_hz": at.frequency_hz}
    damper = LIQUID_DAMPING(place="tank", **known, **numbers)
    return Extension(terms=(damper,))


# A liquid whose damping fluctuates within a run, not only from run to run, looks like this, too.
_SLOSHING: Final = (
    EffectParameter("threshold_g", 0.02, 20.0, range=_THRESHOLD),
    EffectParameter("peak_w_bar", 0.0, 20.0, range=Range(0.01, 5.0)),
    EffectParameter("rise", 0.05, 20.0, range=Range(0.1, 10.0)),  # a peak beyond all levels
    # levels that hardly change do not tell it
    EffectParameter("averaging_s", 0.01, 5.0, range=_AVERAGING),
)
SLOSHING = register(
    Effect(
        "liquid_sloshing",
        "tank",
        "−(m_l/π) Ω W̄(â) v; W̄ rises from nothing at the threshold a_t to its peak at a_t (1 + rise), and falls",
        _SLOSHING,
        multiples(
            _SLOSHING,
            *(
                {"threshold_g": share, "peak_w_bar": 0.5, "rise": rise, "averaging_s": 2.0}
                for share in (0.1, 0.3, 0.6)
                for rise in (0.5, 2.0)
            ),
        ),
        _damping,
        _LEVELS,
        spoken_for_by=(DISSIPATIVE, ODD_IN_VELOCITY, ONSET),
        size=("peak_w_bar",),
    )
)


_DAMPERS: Final = ("viscous_damping", "liquid_damping", VISCOUS_MAP.name)
_OF_MOVING_LIQUID: Final = (*_DAMPERS, "effective_mass_map")
"""Forces of the baseline for moving liquid; liquid that has not broken up yet has none of them."""


def _changed_liquid(
    change: Callable[[Term, Numbers, Surroundings], Term], kinds: tuple[str, ...]
) -> Callable[..., Extension]:
    """What it makes of the forces of the liquid that are there."""

    def extension(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
        del channel

        def liquid(terms: tuple[Term, ...]) -> tuple[Term, ...]:
            return tuple(
                change(_as_liquid_damping(term, at), numbers, at) if term.name in kinds else term for term in terms
            )

        return Extension(liquid=liquid)

    return extension


def _as_liquid_damping(term: Term, at: Surroundings) -> Term:
    if term.name != "viscous_damping":
        return term
    return LIQUID_DAMPING(
        damping_n_s_per_m=max(term.values["damping_n_s_per_m"], 0.0),
        liquid_mass_kg=at.rig.liquid_mass_kg,
        start_frequency_hz=at.frequency_hz,
    )


def _damps(at: Surroundings) -> bool:
    return any(term.place == "tank" and term.name in _DAMPERS for term in at.twin.terms)


# A liquid that has broken up stays so: with a state that fell back as soon as the motion calmed down, a liquid
# that is broken up for good could not be described.
_NEVER_CALM_S: Final = 1e9
# A level that agitates the liquid at once, like a step, left fits in local minima. A soft one leads out of them,
# and its sharpness follows the recordings.
_DELAY: Final = (
    EffectParameter("time_constant_s", 2e-3, 20.0, range=Range(0.05, 100.0, scales.period)),
    EffectParameter("agitated_g", 0.02, 20.0, range=_THRESHOLD),
    # a start that goes on does not tell it
    EffectParameter("averaging_s", 0.01, 5.0, range=_AVERAGING),
    EffectParameter("sharpness", 2.0, 50.0, range=Range(2.0, 50.0)),
)
DELAY = register(
    Effect(
        "breakup_delay",
        "tank",
        "the forces of moving liquid times s, ṡ = p (1 − s)/τ, p = rⁿ/(1 + rⁿ), r = â/a_agitated; s stays",
        _DELAY,
        multiples(
            _DELAY,
            *(
                {"time_constant_s": n, "agitated_g": share, "averaging_s": 2.0, "sharpness": 4.0}
                for n in (1.0, 5.0)
                for share in (0.1, 0.4)
            ),
        ),
        _changed_liquid(
            lambda term, numbers, at: term.changed(
                break_up_s=numbers["time_constant_s"],
                **{name: value for name, value in numbers.items() if name != "time_constant_s"},
                calming_s=_NEVER_CALM_S,
            ),
            _OF_MOVING_LIQUID,
        ),
        "a sudden start at constant amplitude",
        _damps,
        spoken_for_by=(MEMORY, ODD_IN_VELOCITY),
        size=("time_constant_s",),
    )
)
# Work per cycle goes with the damping and the square of the level, so that (a_s/â)² keeps it where it is.
_SATURATION: Final = (
    EffectParameter("threshold_g", 0.02, 50.0, range=_THRESHOLD),
    EffectParameter("averaging_s", 0.01, 5.0, range=_AVERAGING),
)
SATURATION = register(
    Effect(
        "high_g_saturation",
        "tank",
        "the damping of the liquid times (a_s/â)² beyond a_s: work per cycle stops growing",
        _SATURATION,
        multiples(_SATURATION, *({"threshold_g": share, "averaging_s": 2.0} for share in (0.3, 0.5, 0.7))),
        _changed_liquid(
            lambda term, numbers, at: term.changed(
                saturation_g=numbers["threshold_g"], averaging_s=numbers["averaging_s"]
            ),
            _DAMPERS,
        ),
        _LEVELS,
        _damps,
        spoken_for_by=(ODD_IN_VELOCITY, ONSET),
    )
)


def _knows_work(at: Surroundings) -> bool:
    """Whether work per cycle was measured over the level: a fitted damper has no level from which it falls."""
    return any(term.place == "tank" and term.name == VISCOUS_MAP.name for term in at.twin.terms)


# Work per cycle may go on growing, less than with the square of the level.
# In a simulated tank W̄ falls with the power 0.76 from 4 g on, not with the square.
_GRADUAL: Final = (
    EffectParameter("threshold_g", 0.02, 50.0, range=_THRESHOLD),
    EffectParameter("exponent", 0.2, 4.0, range=Range(0.2, 4.0, is_log=False)),
    EffectParameter("averaging_s", 0.01, 5.0, range=_AVERAGING),
)
GRADUAL_SATURATION = register(
    Effect(
        "gradual_saturation",
        "tank",
        "the damping of the liquid times (a_s/â)ⁿ beyond a_s: work per cycle grows less, or falls where n > 2",
        _GRADUAL,
        multiples(
            _GRADUAL, *({"threshold_g": share, "exponent": 1.0, "averaging_s": 2.0} for share in (0.3, 0.5, 0.7))
        ),
        _changed_liquid(
            lambda term, numbers, at: term.changed(
                saturation_g=numbers["threshold_g"],
                saturation_exponent=numbers["exponent"],
                averaging_s=numbers["averaging_s"],
            ),
            (VISCOUS_MAP.name,),
        ),
        _LEVELS,
        _knows_work,
        spoken_for_by=(ODD_IN_VELOCITY, ONSET),
        variant_of="high_g_saturation",
    )
)


def _impact_numbers(
    at: Surroundings, room: float, contact_hz: float, damping_ratio: float, share: float = 0.05
) -> dict[str, float]:
    """Parameters of an impact by the share of the room above the liquid and by its contact."""
    rate, mass_kg = 2 * pi * contact_hz, share * at.rig.liquid_mass_kg
    return {
        "gap_m": room * (1 - at.rig.liquid.fill_level) * at.rig.tank.height_m,
        "stiffness_n_per_m": mass_kg * rate**2,
        "damping_kg_per_s": 2 * damping_ratio * mass_kg * rate,
        "share": share,
    }


def _impact(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    del channel
    height = at.rig.tank.height_m
    # A ball needs a radius: a gap as high as the tank leaves none.
    gap = min(numbers["gap_m"], 0.98 * height)
    ball = BOUNCING_BALL(
        radius_m=0.5 * (height - gap),
        stiffness_n_per_m=numbers["stiffness_n_per_m"],
        damping_kg_per_s=numbers["damping_kg_per_s"],
        hardening_per_m=0.0,
        beta=1.0 - numbers["share"],
        liquid_mass_kg=at.rig.liquid_mass_kg,
        height_m=height,
        contact_pulls=0.0,  # a liquid pushes and never pulls; a contact that pulls made every bounce too slow
    )
    return Extension(terms=(ball,))


# Where impacts are violent the bounces are chaotic: with the true numbers one run of three was followed to the
# noise and the others not at all.
IMPACT = register(
    Effect(
        "ceiling_impact",
        "tank",
        "a share of the liquid that flies between floor and ceiling and meets them through spring and damper",
        (
            EffectParameter("gap_m", 1e-4, 1.0, range=Range(0.25, 1.3, scales.room)),
            EffectParameter("stiffness_n_per_m", 50.0, 1e7, range=Range(1e-3, 16.0, scales.contact_stiffness)),
            EffectParameter("damping_kg_per_s", 0.0, 1e4, range=Range(1e-4, 4.0, scales.contact_damping)),
            EffectParameter("share", 0.002, 1.0, range=Range(5e-3, 1.0)),
        ),
        lambda at: [
            _impact_numbers(at, room, _CONTACT_HZ, 0.3, share) for share in (1.0, 0.2, 0.05) for room in (1.0, 0.6)
        ],
        _impact,
        "accelerations below and above 1 g, forces sampled fast",
        spoken_for_by=(DISSIPATIVE, IMPULSIVE, ONSET, MEMORY),
        size=("stiffness_n_per_m", "damping_kg_per_s", "share"),
        sought_at=lambda at: [_impact_numbers(at, *place) for place in _PLACES_OF_AN_IMPACT],
    )
)


def _waves_of_the_box(at: Surroundings) -> list[dict[str, float]]:
    """The first sideways mode along each side of the tank, where the beam's dimensions tell how it rocks.

    Its mass is the one that moves up and down as strongly as the rocking liquid does at its frequency.
    """
    structure = at.rig.structure
    if structure is None or None in (structure.length_m, structure.width_m, structure.thickness_m):
        return []
    terms = [rocking_liquid(at.rig, along=side, n_modes=1)[0] for side in ("length", "width")]
    starts = [
        {"frequency_hz": term.values["frequency_hz"], "mass_kg": equivalent_lateral_mass_kg(term)}
        for term in terms
    ]
    return [
        {**start, "damping_ratio": 0.01}
        for start in starts
        if 0.1 < start["frequency_hz"] / at.frequency_hz < 10.0 and start["mass_kg"] > 3e-3 * at.rig.liquid_mass_kg
    ]


# The tank has to rotate to drive it: on a beam's tip it does, in a guide it does not.
LATERAL = force_effect(
    LATERAL_MODE,
    "tank",
    lambda at: [
        *(
            {"frequency_hz": frequency, "mass_kg": 0.2 * at.rig.liquid_mass_kg, "damping_ratio": 0.01}
            for frequency in (*(ratio * at.frequency_hz for ratio in (0.3, 0.7, 1.4)), *at.missed_hz)
        ),
        *_waves_of_the_box(at),
    ],
    ranges={
        "frequency_hz": Range(0.1, 10.0, scales.frequency),
        "mass_kg": Range(3e-3, 1.0, scales.liquid_mass),
        "damping_ratio": _DAMPING_RATIO,
    },
    bounds={"damping_ratio": (0.0, MOST_DAMPING_OF_A_MODE)},
    separated_by="a slow sweep over its frequency at small amplitude",
    needs=rocks,
    spoken_for_by=(MEMORY,),
    size=("mass_kg",),
)
# A parametric instability: the wave is at half the frequency of the motion.
FARADAY = force_effect(
    FARADAY_WAVE,
    "tank",
    [{"frequency_hz": 0.5, "growth": growth, "force_n": 0.3, "damping_ratio": 0.02} for growth in (0.3, 1.0)],
    ranges={
        # half of the lowest to half of the highest frequency of a sweep
        "frequency_hz": Range(0.2, 1.2, scales.frequency),
        "growth": Range(0.03, 30.0, scales.reciprocal_g),
        "force_n": Range(*_SHARE_OF_LIQUID, scales.liquid_force),
        "damping_ratio": _DAMPING_RATIO,
    },
    bounds={"growth": (1e-3, 100.0), "damping_ratio": (0.0, MOST_DAMPING_OF_A_MODE)},
    separated_by="spectra at half the frequency below and above the threshold",
    spoken_for_by=(HALF_ORDER, MEMORY, ONSET),
    size=("force_n",),
)
LOSS = force_effect(
    LIQUID_LOSS,
    "tank",
    [{"rate_kg_per_s": 0.1}],
    ranges={"rate_kg_per_s": Range(3e-3, 1.0, scales.loss_rate)},
    separated_by="the same test at the beginning and at the end of the day",
    spoken_for_by=(TIME_VARYING, ODD_IN_DISPLACEMENT),
)
# Far from its resonance it is a mass: trapped air of next to no stiffness was named for a mass that was missing,
# before its special cases were tried in its place.
CUSHION = force_effect(
    AIR_CUSHION,
    "tank",
    lambda at: [
        {
            "stiffness_n_per_m": 0.2 * at.rig.liquid_mass_kg * (2 * pi * frequency) ** 2,
            "mass_kg": 0.2 * at.rig.liquid_mass_kg,
            "hardening_per_m": 0.1 * (2 * pi * frequency) ** 2 / at.acceleration_m_per_s2,
            "damping_ratio": 0.03,
        }
        for frequency in (*(ratio * at.frequency_hz for ratio in (1.7, 3.0, 6.0)), *at.missed_hz)
    ],
    ranges={
        "stiffness_n_per_m": Range(3e-3, 100.0, scales.liquid_stiffness),
        "mass_kg": Range(3e-3, 1.0, scales.liquid_mass),
        "hardening_per_m": Range(0.03, 30.0, scales.hardening),
        "damping_ratio": _DAMPING_RATIO,
    },
    bounds={"damping_ratio": (0.0, MOST_DAMPING_OF_A_MODE)},
    separated_by="two pressures of the gas",
    spoken_for_by=(CONSERVATIVE, ODD_IN_DISPLACEMENT),
    size=("stiffness_n_per_m", "mass_kg"),
)
