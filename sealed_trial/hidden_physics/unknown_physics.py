"""Physics that the vocabulary has no name for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from sealed_trial.hidden_physics.effect import Change, DrawnEffect, HiddenEffect, Scales, Signals
from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.system import storage_of_springs

_ALL = ("sdof", "beam", "shaker")
_CARRIED = ("sdof", "beam")


def _unknown(
    block: str, description: str, change: Callable[[float], Change], channel: str = "", most: float = 1e3
) -> DrawnEffect:
    return DrawnEffect("unknown", block, change, channel, most=most, description=description)


def pumped_stiffness(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A spring whose stiffness is modulated from outside."""
    unit, rate = 0.03 * scales.stiffness_n_per_m, scales.rate_rad_per_s * generator.uniform(0.15, 0.6)
    return _unknown(
        "structure",
        "stiffness modulated in time",
        lambda m: Change({}, {at.STIFFNESS_MODULATION: m * unit, at.STIFFNESS_MODULATION_RATE: rate}),
        most=12.0,
    )


def fractional(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Damping of fractional order, stronger than any tolerance of viscous damping."""
    exponent = generator.uniform(0.35, 0.6)
    stiffening = storage_of_springs(exponent, scales.rate_rad_per_s)

    def change(m: float) -> Change:
        gain = 0.06 * m * scales.stiffness_n_per_m / scales.rate_rad_per_s**exponent
        kernel = {at.RELAXATION_GAIN: gain, at.STIFFNESS_CHANGE: -gain * stiffening}
        return Change({}, kernel, relaxation_exponent=exponent)

    return _unknown("structure", "fractional damping", change, most=2.0)


def damping_with_displacement(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A damper that closes with the displacement: c x² v."""
    unit = 2 * scales.damping_n_s_per_m / scales.displacement_m**2
    return _unknown(
        "structure",
        "damping that grows with the displacement",
        lambda m: Change({}, {at.DAMPING_OF_DISPLACEMENT: m * unit}),
    )


def loosening(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A joint loosens in the middle of every run."""
    unit, instant = -0.03 * scales.stiffness_n_per_m, generator.uniform(0.8, 2.0)

    def change(m: float) -> Change:
        return Change({}, {at.STIFFNESS_STEP: m * unit, at.STIFFNESS_STEP_TIME: instant})

    return _unknown("structure", "stiffness that drops at an instant", change, most=10.0)


def one_sided_damping(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A liquid that dissipates on the way down only."""
    unit = 2 * scales.liquid_mass_kg * scales.rate_rad_per_s * 0.6 / math.pi
    return _unknown("tank", "damping of downward motion only", lambda m: Change({}, {at.TANK_ONE_SIDED: m * unit}))


def crooked_sensor(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A sensor whose characteristic is curved."""
    names = [name for name in sorted(scales.rms) if name not in ("force_interface", "acceleration_root")]
    channel = str(generator.choice(names))
    order, peak = int(generator.choice([2, 3])), scales.peak[channel]

    def change(m: float) -> Change:
        def distort(signals: Signals, rate_hz: float, run: int) -> Signals:
            values = signals[channel]
            return {**signals, channel: values + 0.03 * m * peak * (values / peak) ** order}

        return Change({}, distortion=distort)

    return _unknown("sensor", f"characteristic with a term of order {order}", change, channel, most=10.0)


def sticky_sensor(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A sensor with play: its reading turns only after the motion has gone back by some way."""
    names = [name for name in sorted(scales.rms) if name not in ("force_interface", "acceleration_root")]
    channel = str(generator.choice(names))

    def change(m: float) -> Change:
        half = 0.02 * m * scales.peak[channel]

        def distort(signals: Signals, rate_hz: float, run: int) -> Signals:
            follows, reading = np.empty_like(signals[channel]), float(signals[channel][0])
            for k, value in enumerate(signals[channel].tolist()):
                reading = min(max(reading, value - half), value + half)
                follows[k] = reading
            return {**signals, channel: follows}

        return Change({}, distortion=distort)

    return _unknown("sensor", "a sensor with play", change, channel, most=20.0)


UNKNOWN_PHYSICS: Final = (
    HiddenEffect("pumped_stiffness", "structure", pumped_stiffness, _CARRIED),
    HiddenEffect("fractional", "structure", fractional, ("sdof",), needs_frequencies=True),
    HiddenEffect("damping_with_displacement", "structure", damping_with_displacement, _CARRIED, True),
    HiddenEffect("loosening", "structure", loosening, _CARRIED),
    HiddenEffect("one_sided_damping", "tank", one_sided_damping, _ALL),
    HiddenEffect("crooked_sensor", "sensor", crooked_sensor, _ALL, True),
    HiddenEffect("sticky_sensor", "sensor", sticky_sensor, _ALL, True),
)
