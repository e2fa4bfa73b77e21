"""What a real liquid does beyond a constant damper: thresholds, delays, saturation, waves, cushions, losses.

All are forces Δf on the tank, beyond that of frozen liquid.
"""

from __future__ import annotations

from math import pi, sqrt

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.twin.break_up import (
    AVERAGING,
    NEVER_G,
    at_rest,
    level_g,
    rate_of_break_up,
    share_broken_up,
    share_by_saturation,
)
from sloshlab.twin.break_up import PARAMETERS as BREAK_UP_PARAMETERS
from sloshlab.twin.law import ACCELERATION, DISPLACEMENT, TIME, VELOCITY, law
from sloshlab.twin.terms import ForceKind, Parameter, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

_G = GRAVITY_M_PER_S2
_BREAK_UP = 6
"""Where the numbers of `break_up` begin among those of the damper."""


@law
def _liquid_damping(motion, parameters, memory, rates):
    """−s [c · saturation + (m_l/π) ω W̄(â)] v; s builds up while the liquid is agitated."""
    omega = sqrt(memory[1] / memory[0]) if memory[0] > 0 else 1.0
    # bounded, so that a motion that has died away has a frequency
    omega = min(max(omega, 1.0), 1e4)
    averaging = parameters[_BREAK_UP + AVERAGING]
    rates[0] = (motion[VELOCITY] ** 2 - memory[0]) / averaging
    rates[1] = (motion[ACCELERATION] ** 2 - memory[1]) / averaging
    size = level_g(memory[1])
    rates[2] = rate_of_break_up(parameters, _BREAK_UP, size, memory[2])
    damping = parameters[0] * share_by_saturation(parameters, _BREAK_UP, size)
    if size > parameters[2]:
        over = (size - parameters[2]) / (parameters[4] * parameters[2])
        # (E.4) with W̄ over the level: 2b/(1 + b²) has its largest value 1 at b = 1, a level of (1 + rise) times
        # the threshold
        damping += parameters[1] / pi * omega * parameters[3] * 2.0 * over / (1.0 + over * over)
    return -share_broken_up(parameters, _BREAK_UP, memory[2]) * damping * motion[VELOCITY]


LIQUID_DAMPING = register(
    ForceKind(
        "liquid_damping",
        ("tank",),
        (
            Parameter("damping_n_s_per_m", "N s m-1", 0.0, 1e4, 0.0),
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
            Parameter("threshold_g", "1", 1e-3, 1e6, NEVER_G),
            Parameter("peak_w_bar", "1", 0.0, 100.0, 0.0),
            Parameter("rise", "1", 1e-3, 1e3, 1.0),
            Parameter("start_frequency_hz", "Hz", 1e-3, 1e4, 10.0),
            *BREAK_UP_PARAMETERS,
        ),
        _liquid_damping,
        memory=lambda values, table: (
            1e-6,
            1e-6 * (2 * pi * values["start_frequency_hz"]) ** 2,
            at_rest(values["break_up_s"]),
        ),
        uses_acceleration=True,
        equation="−s [c (a_s/â)ᵐ beyond a_s + (m_l/π) Ω W̄_peak 2b/(1 + b²)] v, b = (â/a_t − 1)/rise beyond a_t, "
        "ṡ = p (1 − s)/τ − (1 − p) s/τ_calm, p = rⁿ/(1 + rⁿ), r = â/a_agitated; â from the mean square of a",
    )
)


@law
def _oscillator(motion, parameters, memory, rates):
    """A mass on a spring and a damper that the tank carries."""
    omega = 2 * pi * parameters[0]
    stretch, closing = memory[0] - motion[DISPLACEMENT], memory[1] - motion[VELOCITY]
    pull = omega * omega * stretch + 2 * parameters[2] * omega * closing
    rates[0], rates[1] = memory[1], -pull
    return parameters[1] * pull


LATERAL_MODE = register(
    ForceKind(
        "lateral_mode",
        ("tank",),
        (
            Parameter("frequency_hz", "Hz", 0.01, 1e4),
            Parameter("mass_kg", "kg", 0.0, 1e3),
            Parameter("damping_ratio", "1", 0.0, 1.0, 0.01),
        ),
        _oscillator,
        memory=lambda values, table: (0.0, 0.0),
        # instead of m frozen, whose inertia the structure already has: that one is given back
        mass=lambda values: -values["mass_kg"],
        moves_with_place=True,
        equation="m (ω² s + 2ζω ṡ + a), s the mode's motion in the tank, instead of m frozen",
    )
)


@law
def _cushion(motion, parameters, memory, rates):
    """Liquid on a gas spring that hardens as it is compressed and softens as it expands."""
    mass, hardening = parameters[1], parameters[2]
    stretch, closing = memory[0] - motion[DISPLACEMENT], memory[1] - motion[VELOCITY]
    # gas that is compressed to nothing would be a wall of any stiffness, which no step follows
    left = max(1.0 - hardening * stretch, 0.02)
    omega = sqrt(parameters[0] / mass)
    push = omega * omega * stretch / left + 2.0 * parameters[3] * omega * closing
    rates[0], rates[1] = memory[1], -push
    return mass * push


AIR_CUSHION = register(
    ForceKind(
        "air_cushion",
        ("tank",),
        (
            Parameter("stiffness_n_per_m", "N m-1", 1.0, 1e9),
            Parameter("mass_kg", "kg", 1e-9, 1e6),
            Parameter("hardening_per_m", "m-1", -1e5, 1e5, 0.0),
            Parameter("damping_ratio", "1", 0.0, 1.0, 0.02),
        ),
        _cushion,
        memory=lambda values, table: (0.0, 0.0),
        # given back, as of the wave above
        mass=lambda values: -values["mass_kg"],
        moves_with_place=True,
        equation="m (k/m · s/(1 − hs) + 2ζω ṡ + a), liquid of mass m on trapped gas that s > 0 compresses",
    )
)


@law
def _loss(motion, parameters, memory, rates):
    # the structure still carries what has gone: its inertia is taken back
    return parameters[0] * motion[TIME] * motion[ACCELERATION]


LIQUID_LOSS = register(
    ForceKind(
        "liquid_loss",
        ("tank",),
        (Parameter("rate_kg_per_s", "kg s-1", 0.0, 1e3),),
        _loss,
        uses_acceleration=True,
        equation="+ṁ t a, the mass that has gone by time t",
    )
)


@law
def _faraday(motion, parameters, memory, rates):
    """A parametrically driven wave, limited by its own size."""
    omega = 2 * pi * parameters[0]
    wave, speed = memory[0], memory[1]
    rates[0] = speed
    rates[1] = (
        -2.0 * parameters[3] * omega * speed
        - omega * omega * (1.0 + parameters[1] * motion[ACCELERATION] / _G) * wave
        # grows with the drive until this term detunes it; without it a parametric wave has no size
        - omega * omega * wave**3
    )
    return parameters[2] * wave


FARADAY_WAVE = register(
    ForceKind(
        "faraday_wave",
        ("tank",),
        (
            Parameter("frequency_hz", "Hz", 0.01, 1e4),
            Parameter("growth", "1", 0.0, 100.0, 1.0),
            Parameter("force_n", "N", -1e6, 1e6),
            Parameter("damping_ratio", "1", 0.0, 1.0, 0.03),
        ),
        _faraday,
        # a disturbance to grow from: a flat surface is an equilibrium, if an unstable one
        memory=lambda values, table: (1e-3, 0.0),
        uses_acceleration=True,
        equation="F y, ÿ = −2ζω ẏ − ω² (1 + growth · a/g) y − ω² y³",
    )
)
