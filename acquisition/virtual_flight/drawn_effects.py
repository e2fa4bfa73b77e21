"""What may be drawn into a flight: every effect with its size, and what explains the recordings as well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.hidden_physics import HiddenFlight, Oscillator

Generator = np.random.Generator


@dataclass(frozen=True, eq=False)
class DrawnEffect:
    """One hidden effect of a size.

    Attributes
    ----------
    name, block : str
    parameters : dict of str to float
        Under the names of the vocabulary.
    hidden : HiddenFlight
    nearest : dict of str to callable
        Other names that come near it: what they hide where their number is off its nearest by a relative change.
    """

    name: str
    block: str
    parameters: dict[str, float]
    hidden: HiddenFlight
    nearest: dict[str, Callable[[float], HiddenFlight]] = field(default_factory=dict)


Draw = Callable[[DescribedWing, Generator, float], DrawnEffect]
"""(wing, generator, size about one) → effect."""


def _either(generator: Generator) -> float:
    return float(generator.choice([-1.0, 1.0]))


def _lift_gain(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    ratio = _either(generator) * 0.12 * size
    return DrawnEffect("lift_gain", "aerodynamics", {"ratio": ratio}, HiddenFlight(lift_gain=ratio))


def _lag(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    ratio = float(np.exp(_either(generator) * 0.7 * size))
    return DrawnEffect("aerodynamic_lag", "aerodynamics", {"lag_ratio": ratio}, HiddenFlight(lag_ratio=ratio))


def _stall(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    angle = 0.085 / size**0.5
    hidden = HiddenFlight(stall_angle_rad=angle)
    return DrawnEffect("aerodynamic_nonlinearity", "aerodynamics", {"stall_angle_rad": angle}, hidden)


def _airspeed(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    ratio = _either(generator) * 0.06 * size
    return DrawnEffect("airspeed_error", "sensor", {"ratio": ratio}, HiddenFlight(airspeed_ratio=ratio))


def _gust_delay(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    delay = 0.010 * size
    return DrawnEffect("gust_shape", "excitation", {"delay_s": delay}, HiddenFlight(gust_delay_s=delay))


def _gust_low_pass(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    constant = 0.015 * size
    hidden = HiddenFlight(gust_time_constant_s=constant)
    return DrawnEffect("gust_shape", "excitation", {"time_constant_s": constant}, hidden)


def _saturation(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    limit = 0.22 / size**0.5
    return DrawnEffect("control_saturation", "control", {"limit_rad": limit}, HiddenFlight(flap_limit_rad=limit))


def _rate_limit(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    rate = 3.0 / size**0.5
    hidden = HiddenFlight(flap_rate_rad_per_s=rate)
    return DrawnEffect("control_rate_limit", "control", {"rate_rad_per_s": rate}, hidden)


def _delay(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    delay = 0.012 * size
    return DrawnEffect("actuator_delay", "control", {"delay_s": delay}, HiddenFlight(actuator_delay_s=delay))


def _play(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    play = 0.03 * size
    return DrawnEffect("control_freeplay", "control", {"play_rad": play}, HiddenFlight(play_rad=play))


def _loss(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    factor = 0.05 * size
    hidden = HiddenFlight(loss_factor=factor)
    return DrawnEffect("structural_damping", "structure", {"loss_factor": factor}, hidden)


def _mode(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    mass, frequency, ratio = 0.04 * size, float(generator.uniform(3.0, 9.0)), float(generator.uniform(0.01, 0.05))
    oscillator = Oscillator(wing.semi_span_m, 0.0, frequency, ratio, mass, mass)
    parameters = {"mass_kg": mass, "frequency_hz": frequency, "damping_ratio": ratio}
    return DrawnEffect("missing_mode", "structure", parameters, HiddenFlight(oscillators=(oscillator,)))


def _sloshing(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    tank = len(wing.tanks) - 1
    threshold, peak = float(generator.uniform(0.3, 0.8)), 0.8 * size
    hidden = HiddenFlight(sloshing={tank: (threshold, peak)})
    return DrawnEffect("liquid_sloshing", "tank", {"threshold_g": threshold, "peak_w_bar": peak}, hidden)


def _liquid_loss(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    tank, rate = len(wing.tanks) - 1, 0.015 * size
    hidden = HiddenFlight(liquid_loss_kg_per_s={tank: rate})
    return DrawnEffect("liquid_loss", "tank", {"rate_kg_per_s": rate}, hidden)


def _sensor(name: str, kind: str, number: Callable[[Generator, float], float], parameter: str) -> Draw:
    def drawn(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
        channel = wing.accelerometers[int(generator.integers(len(wing.accelerometers)))][0]
        value = number(generator, size)
        return DrawnEffect(name, "sensor", {parameter: value}, HiddenFlight(sensor=((channel, kind, value),)))

    return drawn


def _mass(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    """More or less liquid, with its inertia or without: what its weight alone does both do."""
    tank, share = len(wing.tanks) - 1, _either(generator) * 0.25 * size
    believed = wing.tanks[tank].fill_level
    share = min(max(share, 0.05 / believed - 1), 0.95 / believed - 1)

    def weight(change: float) -> HiddenFlight:
        return HiddenFlight(effective_mass={tank: share * (1 + change)})

    def filled(change: float) -> HiddenFlight:
        return HiddenFlight(fill_levels={tank: believed * (1 + share * (1 + change))})

    if generator.random() < 0.5:
        return DrawnEffect("effective_mass", "tank", {"beta": share}, weight(0.0), {"fuel_state": filled})
    level = {"fill_level": believed * (1 + share)}
    return DrawnEffect("fuel_state", "tank", level, filled(0.0), {"effective_mass": weight})


SINGLES: Final[tuple[Draw, ...]] = (
    _lift_gain,
    _lag,
    _stall,
    _airspeed,
    _gust_delay,
    _gust_low_pass,
    _saturation,
    _rate_limit,
    _delay,
    _play,
    _loss,
    _mode,
    _sloshing,
    _liquid_loss,
    _mass,
    _sensor("sensor_gain", "gain", lambda generator, size: _either(generator) * 0.06 * size, "ratio"),
    _sensor("sensor_delay", "delay", lambda generator, size: 0.004 * size, "delay_s"),
)


def _cubic_spring(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    hidden = HiddenFlight(tip_stiffness_n_per_m3=2e4 * size)
    return DrawnEffect("unknown", "structure", {}, hidden)


def _buffet(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    strouhal = float(generator.uniform(0.05, 0.15))
    hidden = HiddenFlight(buffet_lift_coefficient=0.02 * size, buffet_strouhal=strouhal)
    return DrawnEffect("unknown", "aerodynamics", {}, hidden)


def _hunting(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    hidden = HiddenFlight(hunting_rad=0.004 * size, hunting_hz=float(generator.uniform(3.0, 8.0)))
    return DrawnEffect("unknown", "control", {}, hidden)


def _slug(wing: DescribedWing, generator: Generator, size: float) -> DrawnEffect:
    hidden = HiddenFlight(slug_kg=0.4 * size, slug_threshold_g=float(generator.uniform(0.4, 0.7)))
    return DrawnEffect("unknown", "tank", {}, hidden)


LOOK_ALIKES: Final[tuple[Draw, ...]] = (_mass,)
OUTSIDE: Final[tuple[Draw, ...]] = (_cubic_spring, _buffet, _hunting, _slug)
