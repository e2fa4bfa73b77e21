"""Effects of the sensors: what a channel makes of what it should show."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from sloshlab.diagnosis.candidate import Effect, EffectParameter, Numbers, Surroundings, register
from sloshlab.diagnosis.extension import Extension, Reading, SensorFault

FloatArray = NDArray[np.float64]
Others = Mapping[str, FloatArray]


def _all_channels(at: Surroundings) -> list[str]:
    return list(at.channels)


def _compared_channels(at: Surroundings) -> list[str]:
    """Those that are seen beside the simulation: all but one that drives it alone."""
    alone = at.driving if len(at.driving) == 1 else ()
    return [name for name in at.channels if name not in alone]


def _sensor_effect(
    name: str,
    equation: str,
    parameters: tuple[EffectParameter, ...],
    starts: Callable[[Surroundings], Iterable[Numbers]],
    reading: Callable[[Numbers], Reading],
    undone: Callable[[Numbers], Reading] | None,
    *,
    look_alikes: tuple[str, ...] = (),
    separated_by: str = "the channel beside a second sensor at the same place",
    places: Callable[[Surroundings], list[str]] | None = None,
) -> Effect:
    def extension(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
        del at
        key = (f"sensor.{name}.{channel}", *sorted(numbers.items()))
        return Extension(
            faults=(SensorFault(channel, reading(numbers), None if undone is None else undone(numbers), key),)
        )

    return register(
        Effect(
            name,
            "sensor",
            equation,
            parameters,
            starts,
            extension,
            look_alikes,
            separated_by,
            places=places or (_compared_channels if undone is None else _all_channels),
        )
    )


def _scaled(factor: Callable[[Numbers], float]) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        return lambda values, rate, others, recorded: values * factor(numbers)

    return of


GAIN = _sensor_effect(
    "sensor_gain",
    "y → (1 + ε) y",
    (EffectParameter("ratio", -0.9, 5.0),),
    lambda at: [{"ratio": ratio} for ratio in (0.05, -0.05)],
    _scaled(lambda numbers: 1 + numbers["ratio"]),
    _scaled(lambda numbers: 1 / (1 + numbers["ratio"])),
    look_alikes=("mass_error",),
)


def _shifted(sign: float) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
            del others, recorded
            return _later(values, sign * numbers["delay_s"] * rate)

        return reading

    return of


def _later(values: FloatArray, samples: float) -> FloatArray:
    """Values `samples` later, by phase; the series is reflected at its ends."""
    margin = min(values.size - 1, 64 + int(abs(samples)))
    padded = np.concatenate(
        [2 * values[0] - values[margin:0:-1], values, 2 * values[-1] - values[-2 : -margin - 2 : -1]]
    )
    spectrum = np.fft.rfft(np.nan_to_num(padded))
    frequency = np.fft.rfftfreq(padded.size)
    moved = np.fft.irfft(spectrum * np.exp(-2j * np.pi * frequency * samples), padded.size)
    result = moved[margin : margin + values.size]
    return np.asarray(np.where(np.isfinite(values), result, np.nan))


DELAY = _sensor_effect(
    "sensor_delay",
    "y(t) → y(t − τ)",
    (EffectParameter("delay_s", -0.05, 0.05),),
    lambda at: [{"delay_s": sign * 0.02 / at.frequency_hz} for sign in (1, -1)],
    _shifted(1.0),
    _shifted(-1.0),
    look_alikes=("viscous_damping", "sensor_high_pass"),
)


def _high_passed(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del others, recorded
        two = 2 * numbers["time_constant_s"] * rate
        a, b = (two - 1) / (two + 1), two / (two + 1)
        return np.asarray(lfilter([b, -b], [1.0, -a], values))

    return reading


def _integrated_back(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del others, recorded
        return np.asarray(values + np.nancumsum(values - np.nanmean(values)) / (numbers["time_constant_s"] * rate))

    return reading


HIGH_PASS = _sensor_effect(
    "sensor_high_pass",
    "τ ẏ + y = τ u̇",
    (EffectParameter("time_constant_s", 1e-3, 100.0),),
    lambda at: [{"time_constant_s": value} for value in (2.0, 0.2, 0.03)],
    _high_passed,
    _integrated_back,
    look_alikes=("sensor_delay",),
)


def _clipped(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del rate, others
        limit = numbers["limit"] * float(np.nanmax(np.abs(recorded)))
        return np.asarray(np.clip(values, -limit, limit))

    return reading


CLIPPING = _sensor_effect(
    "sensor_clipping",
    "y → min(max(y, −limit), limit), limit as a share of the largest reading",
    (EffectParameter("limit", 0.1, 1.5),),
    lambda at: [{"limit": 1.0}],
    _clipped,
    None,
)


def _drifted(numbers: Numbers) -> Reading:
    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del others
        time = np.arange(values.size) / rate
        return np.asarray(values + numbers["rate"] * float(np.nanstd(recorded)) * (time - time.mean()))

    return reading


DRIFT = _sensor_effect(
    "sensor_drift",
    "y → y + rate · t, in RMS of the channel per second",
    (EffectParameter("rate", -10.0, 10.0),),
    lambda at: [{"rate": sign * 0.3 / at.longest_run_s} for sign in (1, -1)],
    _drifted,
    None,
    look_alikes=("liquid_loss",),
)


def _humming(line_hz: float) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
            """Its phase is free in every run: that of the line within what is left."""
            del others
            time = np.arange(values.size) / rate
            left = np.nan_to_num(recorded - values)
            line = np.exp(2j * np.pi * line_hz * time)
            amplitude = complex(2 * np.mean(left * line.conj()))
            size = abs(amplitude)
            turned = amplitude / size if size > 0 else 1.0
            scale = numbers["amplitude"] * float(np.nanstd(recorded))
            return np.asarray(values + scale * (line * turned).real)

        return reading

    return of


HUM = [
    _sensor_effect(
        name,
        f"y → y + A cos(2π {line:g} t + φ), A in RMS of the channel",
        (EffectParameter("amplitude", 0.0, 10.0),),
        lambda at: [{"amplitude": 0.02}],
        _humming(line),
        None,
        separated_by="the channel with nothing moving",
    )
    for name, line in (("mains_hum", 50.0), ("mains_hum_60", 60.0))
]


def _stretched(sign: float) -> Callable[[Numbers], Reading]:
    def of(numbers: Numbers) -> Reading:
        def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
            del rate, others, recorded
            places = np.arange(values.size) * (1 + sign * numbers["ratio"])
            return np.asarray(np.interp(places, np.arange(values.size), values))

        return reading

    return of


CLOCK = _sensor_effect(
    "clock_skew",
    "y(t) → y((1 + ε) t)",
    (EffectParameter("ratio", -0.05, 0.05),),
    lambda at: [{"ratio": sign * 0.02 / (at.frequency_hz * at.longest_run_s)} for sign in (1, -1)],
    _stretched(1.0),
    _stretched(-1.0),
    look_alikes=("sensor_delay",),
)


def _pairs(at: Surroundings) -> list[str]:
    names = list(at.channels)
    return [f"{to}<{source}" for to in _compared_channels(at) for source in names if source != to][:12]


def _cross_talk(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
    to, _, source = channel.partition("<")
    factor = numbers["ratio"] * at.channels[to] / max(at.channels[source], 1e-300)

    def reading(values: FloatArray, rate: float, others: Others, recorded: FloatArray) -> FloatArray:
        del rate, recorded
        return values + factor * others[source] if source in others else values

    return Extension(faults=(SensorFault(to, reading, None, (f"sensor.cross_talk.{channel}", numbers["ratio"])),))


CROSS_TALK = register(
    Effect(
        "cross_talk",
        "sensor",
        "y₁ → y₁ + r y₂, r in RMS over RMS",
        (EffectParameter("ratio", -1.0, 1.0),),
        lambda at: [{"ratio": sign * 0.03} for sign in (1, -1)],
        _cross_talk,
        ("mass_error", "sensor_gain"),
        "the second channel disconnected",
        places=_pairs,
    )
)
