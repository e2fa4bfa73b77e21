"""A card of flight tests: gust passages, pulses of the flap and a taxi run, and what drives the wing in each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Kind = Literal["gust", "pulse", "taxi"]
RATE_HZ: Final = 128.0
OVERSAMPLING: Final = 16
"""Of the drives; the motion is integrated at half of it."""


@dataclass(frozen=True)
class FlightPoint:
    """One run.

    Attributes
    ----------
    kind : str
        Gusts in flight, pulses of the flap in flight, or rolling on the ground.
    airspeed_m_per_s : float
        0 on the ground.
    level : float
        Largest gust [m/s], flap angle [rad] or acceleration of the root [m/s²].
    repeat : int
        Number of the run among those of one test, whose drive they share.
    """

    kind: Kind
    airspeed_m_per_s: float
    level: float
    repeat: int = 1


CARD: Final = (
    FlightPoint("gust", 14.0, 1.2),
    FlightPoint("gust", 20.0, 2.6),
    FlightPoint("pulse", 14.0, 0.15),
    FlightPoint("pulse", 20.0, 0.30),
    FlightPoint("pulse", 20.0, 0.30, 2),
    FlightPoint("taxi", 0.0, 5.0),
)
"""Two speeds, at each a level of its own, one repeat, and a run without air."""
DURATION_S: Final = 3.4


@dataclass(frozen=True, eq=False)
class Signals:
    """What is done in a run, at `RATE_HZ` times `OVERSAMPLING`.

    Attributes
    ----------
    gust_m_per_s, command_rad, root_m_per_s2 : ndarray, shape (n,)
    """

    gust_m_per_s: FloatArray
    command_rad: FloatArray
    root_m_per_s2: FloatArray


def signals_of(point: FlightPoint, generator: np.random.Generator) -> Signals:
    """Draw what is done in a run; repeats are drawn with equal generators.

    Parameters
    ----------
    point : FlightPoint
    generator : numpy.random.Generator
    """
    rate = RATE_HZ * OVERSAMPLING
    time = np.arange(int(DURATION_S * rate) + 1) / rate
    nothing = np.zeros(time.size)
    if point.kind == "gust":
        return Signals(_gusts(time, point, generator), nothing, nothing)
    if point.kind == "pulse":
        return Signals(nothing, _pulses(time, point.level, generator), nothing)
    return Signals(nothing, nothing, _bumps(time, point.level, generator))


def _gusts(time: FloatArray, point: FlightPoint, generator: np.random.Generator) -> FloatArray:
    """1 − cos gusts, two in a run, 2 to 6 m long, up and down."""
    gust = np.zeros(time.size)
    for k, size in enumerate(generator.permutation([1.0, 0.75])):
        duration = generator.uniform(2.0, 6.0) / point.airspeed_m_per_s
        start = 0.25 + 1.3 * k + generator.uniform(0.0, 0.4)
        inside = (time >= start) & (time <= start + duration)
        sign = generator.choice([-1.0, 1.0])
        gust[inside] += (
            sign * 0.5 * size * point.level * (1 - np.cos(2 * np.pi * (time[inside] - start) / duration))
        )
    return gust


def _pulses(time: FloatArray, level: float, generator: np.random.Generator) -> FloatArray:
    """Doublets of the flap, two in a run, with smooth ramps of 80 ms."""
    command = np.zeros(time.size)
    for k, size in enumerate(generator.permutation([1.0, 0.7])):
        half = generator.uniform(0.10, 0.25)
        start = 0.25 + 1.5 * k + generator.uniform(0.0, 0.4)
        sign = generator.choice([-1.0, 1.0])
        up = _ramp(time - start)
        down, back = _ramp(time - start - half), _ramp(time - start - 2 * half)
        command += sign * size * level * (up - 2 * down + back)
    return command


def _ramp(time: FloatArray) -> FloatArray:
    """From 0 to 1 within 80 ms, half a cosine."""
    return 0.5 * (1 - np.cos(np.pi * np.clip(time / 0.08, 0.0, 1.0)))


def _bumps(time: FloatArray, level: float, generator: np.random.Generator) -> FloatArray:
    """Bumps of a runway: two periods each under a smooth window, whose mean is none."""
    root = np.zeros(time.size)
    for k, size in enumerate(generator.permutation([1.0, 0.7])):
        frequency = generator.uniform(2.5, 8.0)
        start = 0.2 + 1.35 * k + generator.uniform(0.0, 0.4)
        phase = (time - start) * frequency
        inside = (phase >= 0) & (phase <= 2)
        root[inside] += size * level * np.sin(2 * np.pi * phase[inside]) * np.sin(np.pi * phase[inside] / 2) ** 2
    return root
