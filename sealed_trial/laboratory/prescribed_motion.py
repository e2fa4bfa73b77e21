"""Motions of a shaker or of a base, as tables of displacement, velocity and acceleration that belong together.

All begin at rest and grow smoothly, as a shaker does. Derivatives are exact where a formula has them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

FloatArray = npt.NDArray[np.float64]

TABLE_RATE_HZ = 4096.0
_GRAVITY = 9.81
_SLOW_HZ = 0.5
"""Below which the position loop of a shaker leaves no motion."""


@dataclass(frozen=True)
class Motion:
    """A table of a motion.

    Attributes
    ----------
    step_s : float
    table : ndarray, shape (n, 4)
        Displacement, velocity, acceleration, and the modulation of the liquid's damping.
    """

    step_s: float
    table: FloatArray


def at_rest(duration_s: float) -> Motion:
    """No motion at all."""
    return Motion(1 / TABLE_RATE_HZ, np.zeros((_length(duration_s), 4)))


def random_motion(
    duration_s: float, rms_g: float, centre_hz: float, width_hz: float, generator: np.random.Generator
) -> Motion:
    """Gaussian motion: sines of random phase under a Gaussian spectrum of the acceleration."""
    # a shaker's stroke leaves no slow motion
    frequencies = np.arange(
        max(0.4 * centre_hz, centre_hz - 2 * width_hz), centre_hz + 2 * width_hz, 0.5 / duration_s
    )
    frequencies = frequencies + generator.uniform(-0.2, 0.2, frequencies.size) / duration_s
    weights = np.exp(-0.5 * ((frequencies - centre_hz) / width_hz) ** 2)
    amplitudes = weights * rms_g * _GRAVITY * math.sqrt(2) / math.sqrt(float(np.sum(weights**2)))
    phases = generator.uniform(0, 2 * math.pi, frequencies.size)
    time = _time(duration_s)
    displacement, velocity = np.zeros(time.size), np.zeros(time.size)
    acceleration = np.zeros(time.size)
    for amplitude, frequency, phase in zip(amplitudes, frequencies, phases, strict=True):
        rate = 2 * math.pi * frequency
        cosine, sine = np.cos(rate * time + phase), np.sin(rate * time + phase)
        displacement -= amplitude / rate**2 * cosine
        velocity += amplitude / rate * sine
        acceleration += amplitude * cosine
    return _grown(time, displacement, velocity, acceleration, 0.6)


def swept_motion(
    duration_s: float, level_g: float, start_hz: float, stop_hz: float, *, stroke_m: float = 0.0125
) -> Motion:
    """Octave sweep at a constant acceleration, with the stroke limited."""
    time = _time(duration_s)
    octaves_per_s = math.log2(stop_hz / start_hz) / duration_s
    rate = 2 * math.pi * start_hz * 2 ** (octaves_per_s * time)
    phase = rate / (octaves_per_s * math.log(2))
    wanted = level_g * _GRAVITY / rate**2
    amplitude = _limited(wanted, stroke_m)
    return _harmonic(time, amplitude, phase, rate, rate * octaves_per_s * math.log(2))


def stepped_motion(duration_s: float, levels_g: FloatArray, frequencies_hz: FloatArray) -> Motion:
    """Dwells of equal length at pairs of level and frequency, with smooth changes between them."""
    time = _time(duration_s)
    dwell = duration_s / len(frequencies_hz)
    change = 0.15 * dwell
    places, rates, amplitudes = [], [], []
    for k, (level, frequency) in enumerate(zip(levels_g, frequencies_hz, strict=True)):
        places += [k * dwell + change, (k + 1) * dwell - change]
        rates += [2 * math.pi * frequency] * 2
        amplitudes += [min(level * _GRAVITY / (2 * math.pi * frequency) ** 2, 0.0125)] * 2
    rate = _smooth_steps(time, np.array(places), np.array(rates))
    amplitude = _smooth_steps(time, np.array(places), np.array(amplitudes))
    phase = CubicSpline(time, rate).antiderivative()(time)
    return _harmonic(time, amplitude, phase, rate, np.gradient(rate, time, edge_order=2))


def wandering_motion(duration_s: float, level_g: float, start_hz: float, stop_hz: float) -> Motion:
    """Frequency and amplitude wander slowly, so that both of them vary together (VFA)."""
    time = _time(duration_s)
    middle, half = math.sqrt(start_hz * stop_hz), 0.5 * math.log(stop_hz / start_hz)
    exponent = half * np.sin(2 * math.pi * 2.0 * time / duration_s)
    rate = 2 * math.pi * middle * np.exp(exponent)
    slope = rate * half * 4 * math.pi / duration_s * np.cos(2 * math.pi * 2.0 * time / duration_s)
    level = level_g * (0.55 - 0.45 * np.cos(2 * math.pi * 3.0 * time / duration_s + 0.4))
    amplitude = _limited(level * _GRAVITY / rate**2, 0.0125)
    phase = CubicSpline(time, rate).antiderivative()(time)
    return _harmonic(time, amplitude, phase, rate, slope)


def acting(motion: Motion, limit: float, dead_zone: float) -> Motion:
    """What an actuator makes of a commanded acceleration: nothing within its dead zone, no more than its limit.

    Its position loop takes what is slower than half a hertz, of fourth order.
    """
    commanded = motion.table[:, 2]
    beyond = np.sign(commanded) * np.maximum(np.abs(commanded) - dead_zone, 0.0)
    wanted = np.minimum(np.abs(beyond), limit) * np.sign(beyond)
    # mirrored and faded out, or what ends suddenly would ring in what is slow
    n = min(wanted.size - 1, round(4.0 / motion.step_s))
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, n + 1) / n)
    padded = np.concatenate([-(wanted[n:0:-1] * fade[::-1]), wanted, -(wanted[-2 : -n - 2 : -1] * fade)])
    spectrum, rate = np.fft.rfft(padded), 2 * math.pi * np.fft.rfftfreq(padded.size, motion.step_s)
    rate[0], spectrum[0] = 1.0, 0.0
    spectrum /= 1 + (2 * math.pi * _SLOW_HZ / rate) ** 4
    table = motion.table.copy()
    for column, power in ((0, -2), (1, -1), (2, 0)):
        found = np.fft.irfft(spectrum * (1j * rate) ** power, padded.size)
        table[:, column] = found[n : n + wanted.size]
    return Motion(motion.step_s, table)


def with_modulation(motion: Motion, strength: float, generator: np.random.Generator) -> Motion:
    """The same motion with a liquid whose damping fluctuates, as chaos makes it from repeat to repeat."""
    table = motion.table.copy()
    n = table.shape[0]
    kept = math.exp(-motion.step_s / 0.25)
    shocks = generator.standard_normal(n) * strength * math.sqrt(1 - kept**2)
    table[:, 3] = np.clip(lfilter([1.0], [1.0, -kept], shocks), -0.95, 3.0)
    return Motion(motion.step_s, table)


def _limited(wanted_m: FloatArray, stroke_m: float) -> FloatArray:
    """Amplitude with the stroke's limit rounded off."""
    return np.asarray(wanted_m * (1 + (wanted_m / stroke_m) ** 8) ** (-1 / 8))


def _length(duration_s: float) -> int:
    return math.ceil(duration_s * TABLE_RATE_HZ) + 3


def _time(duration_s: float) -> FloatArray:
    return np.arange(_length(duration_s)) / TABLE_RATE_HZ


def _smooth_steps(time: FloatArray, places: FloatArray, values: FloatArray) -> FloatArray:
    """Constant over dwells, with a C² change between the end of one and the begin of the next."""
    result = np.full(time.size, values[0])
    for k in range(1, len(places)):
        share = np.clip((time - places[k - 1]) / (places[k] - places[k - 1]), 0, 1)
        result += (values[k] - values[k - 1]) * share**3 * (10 - 15 * share + 6 * share**2)
    return result


def _harmonic(
    time: FloatArray, amplitude: FloatArray, phase: FloatArray, rate: FloatArray, slope: FloatArray
) -> Motion:
    """u = −A cos φ with A, φ, φ̇, φ̈ given; the slow derivatives of A by splines."""
    spline = CubicSpline(time, amplitude)
    first, second = spline(time, 1), spline(time, 2)
    cosine, sine = np.cos(phase), np.sin(phase)
    displacement = -amplitude * cosine
    velocity = -first * cosine + amplitude * rate * sine
    acceleration = (
        -second * cosine + 2 * first * rate * sine + amplitude * slope * sine + amplitude * rate**2 * cosine
    )
    return _grown(time, displacement, velocity, acceleration, 0.4)


def _grown(
    time: FloatArray, displacement: FloatArray, velocity: FloatArray, acceleration: FloatArray, over_s: float
) -> Motion:
    """Multiplied by a ramp from 0 to 1 with three continuous derivatives."""
    s = np.clip(time / over_s, 0, 1)
    ramp = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    first = 140 * s**3 * (1 - s) ** 3 / over_s
    second = 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / over_s**2
    table = np.zeros((time.size, 4))
    table[:, 0] = ramp * displacement
    table[:, 1] = first * displacement + ramp * velocity
    table[:, 2] = second * displacement + 2 * first * velocity + ramp * acceleration
    return Motion(1 / TABLE_RATE_HZ, table)
