"""What a real liquid does beyond a constant damper: thresholds, delays, saturation, waves, cushions, losses.

All are forces Δf on the tank, beyond that of frozen liquid.
"""

from __future__ import annotations

from math import pi, sqrt

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.twin.law import ACCELERATION, DISPLACEMENT, TIME, VELOCITY, law
from sloshlab.twin.terms import ForceKind, Parameter, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

_G = GRAVITY_M_PER_S2
_TRACKING_S = 0.2
_AGITATED = 1.0
_NEVER = 1e6


@law
def _liquid_damping(motion, parameters, memory, rates):
    """−s [c · saturation + (m_l/π) ω W̄(â)] v; s builds up while the liquid is thrown about."""
    omega = sqrt(memory[1] / memory[0]) if memory[0] > 0 else 1.0
    omega = min(max(omega, 1.0), 1e4)
    rates[0] = (motion[VELOCITY] ** 2 - memory[0]) / _TRACKING_S
    rates[1] = (motion[ACCELERATION] ** 2 - memory[1]) / _TRACKING_S
    size = sqrt((omega * motion[VELOCITY]) ** 2 + motion[ACCELERATION] ** 2) / _G
    rates[2] = ((1.0 if size > _AGITATED else 0.0) - memory[2]) / parameters[5]
    built = memory[2] if parameters[5] > 1e-3 else 1.0
    damping = parameters[0]
    if size > parameters[4]:
        damping *= (parameters[4] / size) ** 2
    over = size / parameters[2] - 1.0
    if over > 0.0:
        damping += parameters[1] / pi * omega * parameters[3] * min(over, 1.0)
    return -built * damping * motion[VELOCITY]


LIQUID_DAMPING = register(
    ForceKind(
        "liquid_damping",
        ("tank",),
        (
            Parameter("damping_n_s_per_m", "N s m-1", 0.0, 1e4, 0.0),
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
            Parameter("threshold_g", "1", 1e-3, 1e6, _NEVER),
            Parameter("peak_w_bar", "1", 0.0, 100.0, 0.0),
            Parameter("saturation_g", "1", 1e-3, 1e6, _NEVER),
            Parameter("time_constant_s", "s", 1e-4, 100.0, 1e-3),
            Parameter("start_frequency_hz", "Hz", 1e-3, 1e4, 10.0),
        ),
        _liquid_damping,
        memory=lambda values, table: (
            1e-6,
            1e-6 * (2 * pi * values["start_frequency_hz"]) ** 2,
            0.0 if values["time_constant_s"] > 1e-3 else 1.0,
        ),
        uses_acceleration=True,
        equation="−s [c (a_s/â)² beyond a_s + (m_l/π) Ω W̄_peak ramp(â/a_t − 1)] v, ṡ = (1 − s)/τ beyond 1 g",
    )
)


@law
def _oscillator(motion, parameters, memory, rates):
    """A mass on a spring and a damper that the tank carries."""
    omega = 2 * pi * parameters[0]
    stretch, closing = memory[0] - motion[DISPLACEMENT], memory[1] - motion[VELOCITY]
    pull = omega * omega * stretch + 2 * parameters[2] * omega * closing
    rates[0], rates[1] = memory[1], -pull
    return parameters[1] * (pull + motion[ACCELERATION])


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
        moves_with_place=True,
        uses_acceleration=True,
        equation="m (ω² s + 2ζω ṡ + a), s the mode's motion in the tank, instead of m frozen",
    )
)


@law
def _cushion(motion, parameters, memory, rates):
    """All liquid on a gas spring that hardens as its height is used up."""
    mass, gap = parameters[1], parameters[2]
    stretch, closing = memory[0] - motion[DISPLACEMENT], memory[1] - motion[VELOCITY]
    left = max(1.0 - abs(stretch) / gap, 0.02)
    omega = sqrt(parameters[0] / mass)
    push = omega * omega * stretch / left + 0.04 * omega * closing
    rates[0], rates[1] = memory[1], -push
    return mass * (push + motion[ACCELERATION])


AIR_CUSHION = register(
    ForceKind(
        "air_cushion",
        ("tank",),
        (
            Parameter("stiffness_n_per_m", "N m-1", 1.0, 1e9),
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
            Parameter("gap_m", "m", 1e-6, 100.0),
        ),
        _cushion,
        memory=lambda values, table: (0.0, 0.0),
        moves_with_place=True,
        uses_acceleration=True,
        equation="m_l (k/m_l · s/(1 − |s|/gap) + a), the liquid on trapped gas, ζ = 0.02",
    )
)


@law
def _loss(motion, parameters, memory, rates):
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
        -0.06 * omega * speed - omega * omega * (1.0 + motion[ACCELERATION] / _G) * wave - omega * omega * wave**3
    )
    return parameters[1] * parameters[2] * _G * wave


FARADAY_WAVE = register(
    ForceKind(
        "faraday_wave",
        ("tank",),
        (
            Parameter("frequency_hz", "Hz", 0.01, 1e4),
            Parameter("growth", "1", -100.0, 100.0),
            Parameter("liquid_mass_kg", "kg", 1e-9, 1e6),
        ),
        _faraday,
        memory=lambda values, table: (1e-3, 0.0),
        uses_acceleration=True,
        equation="growth · m_l g y, ÿ = −0.06 ω ẏ − ω² (1 + a/g) y − ω² y³",
    )
)
