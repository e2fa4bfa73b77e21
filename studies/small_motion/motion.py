"""Vertical motions of the tank: slow ones that train, random ones that judge, and fast ones on a slow one.

All are velocities, differentiated exactly. A slow velocity under a fast one takes away the zero crossings of the
velocity and hardly changes the acceleration.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from studies.splined_motion import KNOTS_PER_S, SplinedMotion, phase_at_knots, swing

FloatArray = NDArray[np.float64]

STROKE_M: Final = 0.0125
"""Of the shaker; where level and frequency of a slow run ask for more, the level is smaller."""
FREQUENCY_HZ: Final = (7.0, 16.0)
"""Of slow runs."""
BEAM_HZ: Final = 10.87
BEAM_DAMPING_RATIO: Final = 0.025
"""Of the beam with its liquid, as the source measured it in random motion (Table 2.5)."""
SPECTRUM_WIDTH_HZ: Final = 10.0
LOWEST_HZ, HIGHEST_HZ = 3.0, 40.0
LEVELS_G: Final = (0.5, 1.0, 2.0, 4.0)
"""Of the fast motion that is carried, one after the other."""
STAGE_S: Final = 7.5
"""Each level so long alone, then as long on the slow motion."""
SETTLING_S: Final = 1.5
"""At the beginning of each stage, which does not count."""
CARRIER_HZ: Final = 0.5
CARRIER_RATIO: Final = 2.0
"""Amplitude of the slow velocity over that of the fast one."""
_RISE_S: Final = 0.5


@dataclass(frozen=True)
class Motion(SplinedMotion):
    """A motion of the tank from rest.

    Attributes
    ----------
    law : callable
        Takes times [s], returns velocities [m/s] without the start.
    """

    law: Callable[[FloatArray], FloatArray]

    def at_knots(self, time_s: FloatArray) -> FloatArray:
        """See `SplinedMotion`."""
        return self.law(time_s) * _smooth(time_s / _RISE_S)


def slow(name: str, duration_s: float, periods_s: tuple[float, float], level_g: tuple[float, float]) -> Motion:
    """A run whose frequency and level go to and fro, as the source's run for training.

    Parameters
    ----------
    name : str
    duration_s : float
    periods_s : tuple of float
        Of frequency and level.
    level_g : tuple of float
        Lowest and highest.
    """

    def law(times: FloatArray) -> FloatArray:
        omega = 2 * math.pi * swing(FREQUENCY_HZ, periods_s[0], times)
        # a smooth minimum: a kink of the level would be a jump of the acceleration
        limit = STROKE_M * omega**2 / GRAVITY_M_PER_S2
        level = (swing(level_g, periods_s[1], times) ** -8.0 + limit**-8) ** (-1 / 8)
        return np.asarray(GRAVITY_M_PER_S2 * level / omega * np.sin(phase_at_knots(omega)))

    return Motion(name, duration_s, law)


def random_on_beam(name: str, duration_s: float, rms_g: float, seed: int) -> Motion:
    """Motion of a tank at the tip of a beam whose root moves at random, prescribed.

    Parameters
    ----------
    name : str
    duration_s : float
    rms_g : float
        Of the tank's acceleration over g.
    seed : int

    Notes
    -----
    Gaussian; spectrum (2.30) of the root around the beam's frequency times |H|² of one mode, H = 1 +
    r²/(1 − r² + 2iζr), r = f/f₁; nothing outside `LOWEST_HZ` … `HIGHEST_HZ`.
    """

    def law(times: FloatArray) -> FloatArray:
        # a period longer than the run: its end differs from its start
        period_s = duration_s + 2.0
        number = np.arange(math.ceil(LOWEST_HZ * period_s), math.floor(HIGHEST_HZ * period_s) + 1)
        frequency = number / period_s
        ratio = frequency / BEAM_HZ
        gain = np.abs(1 + ratio**2 / (1 - ratio**2 + 2j * BEAM_DAMPING_RATIO * ratio))
        size = gain * np.exp(-(((frequency - BEAM_HZ) / SPECTRUM_WIDTH_HZ) ** 2) / 4)
        drawn = np.random.default_rng([seed, 7]).standard_normal((number.size, 2)) @ np.array([1.0, 1.0j]) * size
        drawn *= rms_g * GRAVITY_M_PER_S2 / math.sqrt(0.5 * float(np.sum(np.abs(drawn) ** 2)))
        n = round(period_s * KNOTS_PER_S)
        lines = np.zeros(n // 2 + 1, complex)
        lines[number] = 0.5 * n * drawn / (2j * math.pi * frequency)
        return np.asarray(np.fft.irfft(lines, n)[: times.size])

    return Motion(name, duration_s, law)


def carried(name: str) -> Motion:
    """A fast motion at each of `LEVELS_G`, for one stage alone and for one on a slow motion.

    Parameters
    ----------
    name : str

    Notes
    -----
    v = V (sin φ + s(t) R sin 2πf_s t), V = level g/ω, the same φ̇(t) between 9 and 13 Hz in both stages.
    """

    def law(times: FloatArray) -> FloatArray:
        omega = 2 * math.pi * swing((9.0, 13.0), STAGE_S, times)
        stage = times / STAGE_S
        edges = 2 * STAGE_S * np.arange(1, len(LEVELS_G))
        steps = np.diff(LEVELS_G)[:, None] * _smooth((times[None, :] - edges[:, None]) / _RISE_S)
        speed = GRAVITY_M_PER_S2 * (LEVELS_G[0] + steps.sum(axis=0)) / (2 * math.pi * 11.0)
        within = (stage % 2) * STAGE_S - STAGE_S
        # whole periods of the carrier fit a stage but for its ends, where it is faded in and out
        share = _smooth(within / _RISE_S) * _smooth((STAGE_S - within) / _RISE_S)
        slow_velocity = CARRIER_RATIO * share * np.sin(2 * math.pi * CARRIER_HZ * times)
        return np.asarray(speed * (np.sin(phase_at_knots(omega)) + slow_velocity))

    return Motion(name, 2 * STAGE_S * len(LEVELS_G), law)


def stages(sampling_rate_hz: float, n_samples: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Level of the carried motion at samples, NaN where it settles; and whether it is on the slow motion.

    Parameters
    ----------
    sampling_rate_hz : float
    n_samples : int
    """
    times = np.arange(n_samples) / sampling_rate_hz
    number = np.floor(times / STAGE_S).astype(int)
    within = times - number * STAGE_S
    level = np.array([*LEVELS_G, np.nan])[np.minimum(number // 2, len(LEVELS_G))]
    settled = (within >= SETTLING_S) & (within < STAGE_S - _RISE_S)
    return np.where(settled, level, np.nan), number % 2 == 1


def _smooth(share: FloatArray) -> FloatArray:
    """A smooth step from 0 to 1."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


SLOW: Final = slow("slow", 120.0, (40.0, 11.4), (0.25, 6.0))
SLOW_VALIDATION: Final = slow("slow_validation", 40.0, (23.0, 8.3), (0.25, 6.0))
SMALL: Final = slow("small", 60.0, (20.0, 5.7), (0.1, 1.5))
RANDOM: Final = random_on_beam("random_training", 60.0, 1.0, 100)
RANDOM_VALIDATION: Final = random_on_beam("random_validation", 30.0, 1.0, 101)
RANDOM_TESTS: Final = tuple(
    random_on_beam(f"random_{rms_g:g}g", 60.0, rms_g, seed) for seed, rms_g in enumerate((0.35, 0.7, 1.4))
)
"""Train nothing and choose nothing."""
CARRIED: Final = carried("carried")
"""Trains nothing and chooses nothing."""
