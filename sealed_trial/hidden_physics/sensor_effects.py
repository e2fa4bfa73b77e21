"""Effects of one channel's chain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import lfilter

from sealed_trial.hidden_physics.effect import Change, Distortion, DrawnEffect, HiddenEffect, Scales, Signals

FloatArray = npt.NDArray[np.float64]
_ALL = ("sdof", "beam", "shaker")
_CARRIED = ("sdof", "beam")
_MOST_RUNS: Final = 16
"""Of a plan."""


def _of_channel(channel: str, distorted: Callable[[FloatArray, float], FloatArray]) -> Distortion:
    """A distortion of one channel alone."""

    def distort(signals: Signals, rate_hz: float, run: int) -> Signals:
        del run
        return {**signals, channel: distorted(signals[channel], rate_hz)}

    return distort


def _channel(scales: Scales, generator: np.random.Generator, *, without: tuple[str, ...] = ()) -> str:
    """Any channel that shows something."""
    largest = max(scales.rms.values())
    names = [name for name in sorted(scales.rms) if name not in without and scales.rms[name] > 1e-9 * largest]
    return str(generator.choice(names))


def _motions(scales: Scales, generator: np.random.Generator) -> str:
    """A channel of the tank's or the beam's motion, which others show too."""
    return _channel(scales, generator, without=("force_interface", "acceleration_root"))


def gain(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Gain beyond calibration, of a motion that others show too: of a force it would be a mass as well."""
    forces = tuple(name for name in scales.rms if name.startswith("force"))
    channel = _channel(scales, generator, without=(*forces, "acceleration_root"))
    sign = 1 if generator.random() < 0.5 else -1

    def change(m: float) -> Change:
        ratio = 0.05 * m * sign
        return Change({"ratio": ratio}, distortion=_of_channel(channel, lambda y, rate: (1 + ratio) * y))

    return DrawnEffect("sensor_gain", "sensor", change, channel, 0.4, 5.0)


def delay(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """One channel comes later than the others."""
    channel = _motions(scales, generator)

    def change(m: float) -> Change:
        late = 0.003 * m

        def distorted(values: FloatArray, rate_hz: float) -> FloatArray:
            time = np.arange(values.size) / rate_hz
            return np.asarray(CubicSpline(time, values)(np.maximum(time - late, 0.0)))

        return Change({"delay_s": late}, distortion=_of_channel(channel, distorted))

    return DrawnEffect("sensor_delay", "sensor", change, channel, most=10.0)


def high_pass(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A piezoelectric sensor discharges."""
    channel = _channel(scales, generator, without=("displacement_tank", "acceleration_root"))

    def change(m: float) -> Change:
        time_constant = 0.3 / m

        def distorted(values: FloatArray, rate_hz: float) -> FloatArray:
            kept = np.exp(-1 / (rate_hz * time_constant))
            # charged at the first sample: what was there before the record has long leaked away
            start = [-values[0] * (1 + kept) / 2]
            return np.asarray(lfilter([(1 + kept) / 2, -(1 + kept) / 2], [1, -kept], values, zi=start)[0])

        return Change({"time_constant_s": time_constant}, distortion=_of_channel(channel, distorted))

    return DrawnEffect("sensor_high_pass", "sensor", change, channel, 0.05, 12.0)


def clipping(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """An amplifier saturates below the converter's range."""
    channel = _motions(scales, generator)

    def change(m: float) -> Change:
        limit = scales.peak[channel] / (1 + 0.3 * m)
        clipped = _of_channel(channel, lambda y, rate: np.clip(y, -limit, limit))
        return Change({"limit": limit}, late_distortion=clipped)

    return DrawnEffect("sensor_clipping", "sensor", change, channel, 0.1, 10.0)


def drift(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A zero that wanders away."""
    channel, sign = _channel(scales, generator, without=("acceleration_root",)), generator.choice([-1.0, 1.0])
    unit = 0.02 * sign * scales.rms[channel]

    def change(m: float) -> Change:
        ramp = _of_channel(channel, lambda y, rate: y + m * unit * np.arange(y.size) / rate)
        return Change({"rate": m * unit}, distortion=ramp)

    return DrawnEffect("sensor_drift", "sensor", change, channel, most=20.0)


def hum(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """The mains on one channel."""
    channel = _channel(scales, generator)
    frequency = generator.choice([50.0, 60.0]) + 0.03 * generator.standard_normal()
    phase, unit = generator.uniform(0, 2 * np.pi), 0.03 * scales.rms[channel]

    def change(m: float) -> Change:
        def distorted(values: FloatArray, rate_hz: float) -> FloatArray:
            time = np.arange(values.size) / rate_hz
            return np.asarray(values + m * unit * np.sin(2 * np.pi * frequency * time + phase))

        return Change({"amplitude": m * unit}, distortion=_of_channel(channel, distorted))

    return DrawnEffect("mains_hum", "sensor", change, channel)


def skew(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """The clock of one device runs fast."""
    channel, sign = _motions(scales, generator), generator.choice([-1.0, 1.0])

    def change(m: float) -> Change:
        ratio = 4e-4 * m * sign

        def distorted(values: FloatArray, rate_hz: float) -> FloatArray:
            time = np.arange(values.size) / rate_hz
            return np.asarray(CubicSpline(time, values)(np.minimum(time * (1 + ratio), time[-1])))

        return Change({"ratio": ratio}, distortion=_of_channel(channel, distorted))

    return DrawnEffect("clock_skew", "sensor", change, channel, most=20.0)


def cross_talk(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """One acceleration leaks into another that moves otherwise."""
    tip_to_root = generator.random() < 0.5
    channel, source = (
        ("acceleration_root", "acceleration_tip") if tip_to_root else ("acceleration_tip", "acceleration_root")
    )
    if scales.rms["acceleration_root"] < 1e-6 * scales.rms["acceleration_tip"]:
        channel, source = "acceleration_root", "acceleration_tip"
    unit = 0.05 if channel == "acceleration_root" else 0.1

    def change(m: float) -> Change:
        def distort(signals: Signals, rate_hz: float, run: int) -> Signals:
            return {**signals, channel: signals[channel] + m * unit * signals[source]}

        return Change({"ratio": m * unit}, distortion=distort)

    # A small part of a reading leaks, or of the source into a base at rest; more is a wrong connection.
    own = scales.rms[channel] / max(scales.rms[source], 1e-300)
    largest = 0.1 * max(own, 1.0) if channel == "acceleration_root" else 0.2 * own
    return DrawnEffect("cross_talk", "sensor", change, channel, most=min(8.0, largest / unit))


def hold(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A device that updates its output more slowly than it is recorded, at instants of its own in every run."""
    channel, first = _motions(scales, generator), generator.random(_MOST_RUNS)

    def change(m: float) -> Change:
        update_rate = 300.0 / m

        def distort(signals: Signals, rate_hz: float, run: int) -> Signals:
            values = signals[channel]
            time = np.arange(values.size) / rate_hz
            n = int(np.ceil(time[-1] * update_rate)) + 1
            updates = (np.arange(-1, n) + first[run % _MOST_RUNS]) / update_rate
            # of a high degree: a beam moves at up to a third of the sampling rate
            read = make_interp_spline(time, values, k=7)(np.clip(updates, 0.0, time[-1]))
            return {**signals, channel: read[np.searchsorted(updates, time, side="right") - 1]}

        return Change({"update_rate_hz": update_rate}, distortion=distort)

    return DrawnEffect("sample_and_hold", "sensor", change, channel, 0.65, 15.0)


SENSOR_EFFECTS: Final = (
    HiddenEffect("sensor_gain", "sensor", gain, _ALL),
    HiddenEffect("sensor_delay", "sensor", delay, _ALL),
    HiddenEffect("sensor_high_pass", "sensor", high_pass, _ALL, needs_frequencies=True),
    HiddenEffect("sensor_clipping", "sensor", clipping, _ALL, needs_levels=True),
    HiddenEffect("sensor_drift", "sensor", drift, _ALL),
    HiddenEffect("mains_hum", "sensor", hum, _ALL),
    HiddenEffect("clock_skew", "sensor", skew, _ALL),
    HiddenEffect("cross_talk", "sensor", cross_talk, _CARRIED, needs_frequencies=True),
    HiddenEffect("sample_and_hold", "sensor", hold, _ALL),
)
