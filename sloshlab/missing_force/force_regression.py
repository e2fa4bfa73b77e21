"""Ridge regressions of a latent force on its motion, cross-validated on stretches of runs.

Features are a restoring force surface (Chebyshev polynomials of displacement and velocity), memory, and time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.missing_force.latent_force import STRUCTURE, LatentForce

FloatArray = NDArray[np.float64]
DEGREE: Final = 5
"""Of the Chebyshev polynomials, in both motions together."""
_SHARP: Final = (0.05, 0.008)
"""Widths of the steps at velocity reversal, over the largest velocity."""
_N_STRETCHES: Final = 24
"""Of each run."""
_PLAY_RADII: Final = (0.1, 0.3)
"""Over the largest displacement."""
_FORGETTING_CYCLES: Final = 4.0
"""Time constant of the level that is remembered."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a run.

    Attributes
    ----------
    run : int
    time_s, force_n, x, v, a : ndarray, shape (n,)
        Displacement, velocity and acceleration of the place in SI units.
    first : ndarray, shape (n,)
        What the force is a function of beside the velocity: x of a structure, a of a tank.
    level_g, omega : ndarray, shape (n,)
        Amplitude of the acceleration and frequency [rad/s] over the cycle about each sample.
    play : ndarray, shape (n, n_plays)
        Of x, by play operators: features of rate-independent memory.
    recent_level : ndarray, shape (n,)
        Mean square of the acceleration over the last cycles, over that of now.
    """

    run: int
    time_s: FloatArray
    force_n: FloatArray
    x: FloatArray
    v: FloatArray
    a: FloatArray
    first: FloatArray
    level_g: FloatArray
    omega: FloatArray
    play: FloatArray
    recent_level: FloatArray

    @property
    def own(self) -> FloatArray:
        """Motions that a block's own stiffness, damping and mass act on, shape (n, 3)."""
        return np.stack([self.x, self.v, self.a], axis=1)


def stretches(forces: Sequence[LatentForce]) -> list[Stretch]:
    """Cut runs into parts that are resampled as wholes for intervals (block bootstrap).

    Parameters
    ----------
    forces : sequence of LatentForce
        Of one place.
    """
    largest = max((float(np.abs(force.motion[:, 0]).max()) for force in forces), default=1.0)
    found = []
    for number, force in enumerate(forces):
        x, v, a = force.motion.T
        rate = force.run.attributes.sampling_rate_hz
        omega = float(a.std() / max(v.std(), 1e-300))
        cycle = max(4, round(min(2 * np.pi / max(omega, 1e-300) * rate, x.size)))  # a run may not move at all
        # Over whole cycles: squares ripple at twice the frequency of the motion, and levels must not.
        running = (uniform_filter1d(part**2, cycle, mode="nearest") for part in (a, v))
        # running sums fall below zero by rounding after a motion has stopped
        power_a, power_v = (np.maximum(power, 0.0) for power in running)
        level = np.sqrt(2 * power_a) / GRAVITY_M_PER_S2
        local = np.sqrt(power_a / np.maximum(power_v, 1e-300))
        play = np.stack([_play_operator(x, share * largest) for share in _PLAY_RADII], axis=1)
        recent_level = _recent_level(power_a, _FORGETTING_CYCLES * cycle)
        first = x if force.place == STRUCTURE else a
        columns = (force.time_s, force.force_n, x, v, a, first, level, local, play, recent_level)
        for part in np.array_split(np.arange(x.size), _N_STRETCHES):
            found.append(Stretch(number, *(column[part] for column in columns)))
    return found


def _play_operator(x: FloatArray, radius: float) -> FloatArray:
    """Stop operator, x less its play of this radius: bounded by the radius, it remembers the last reversal."""
    out, place = np.empty_like(x), x[0]
    low, high = x - radius, x + radius
    for i in range(x.size):
        place = min(max(place, low[i]), high[i])
        out[i] = x[i] - place
    return out


def _recent_level(power: FloatArray, samples: float) -> FloatArray:
    from scipy.signal import lfilter

    keep = np.exp(-1 / samples)
    before, _ = lfilter([1 - keep], [1.0, -keep], power, zi=[keep * power[0]])
    return np.asarray(before / np.maximum(before + power, 1e-300))


@dataclass(frozen=True)
class Scales:
    """Largest values, to make features dimensionless."""

    first: float
    velocity: float
    force: float
    time_s: float

    @classmethod
    def of(cls, parts: Sequence[Stretch]) -> Scales:
        """Of all stretches."""
        return cls(
            max(float(np.abs(part.first).max()) for part in parts) or 1.0,
            max(float(np.abs(part.v).max()) for part in parts) or 1.0,
            float(np.sqrt(np.mean(np.concatenate([part.force_n for part in parts]) ** 2))) or 1.0,
            max(float(part.time_s[-1]) for part in parts) or 1.0,
        )


PARITIES: Final = ("even in both", "odd in the first", "odd in the velocity", "odd in both")


def state_features(stretch: Stretch, scales: Scales) -> tuple[FloatArray, NDArray[np.int64]]:
    """T_i(p) T_j(q) with i + j ≤ 5, tanh(q/0.05), tanh(q/0.008), and the parity of each: an index into `PARITIES`.

    T_1(p) alone is left to the block's own stiffness and mass.
    """
    p, q = stretch.first / scales.first, stretch.v / scales.velocity
    first, second = (_chebyshev(part) for part in (p, q))
    # Two steps at reversal beside the polynomials, which follow no step.
    columns = [np.tanh(q / width) for width in _SHARP]
    parity = [2] * len(columns)
    for i in range(DEGREE + 1):
        for j in range(DEGREE + 1 - i):
            if (i, j) == (1, 0):
                continue
            columns.append(first[i] * second[j])
            parity.append(i % 2 + 2 * (j % 2))
    return np.stack(columns, axis=1), np.array(parity, np.int64)


def _chebyshev(values: FloatArray) -> list[FloatArray]:
    found = [np.ones_like(values), values]
    for _ in range(DEGREE - 1):
        found.append(2 * values * found[-1] - found[-2])
    return found


def memory_features(stretch: Stretch, scales: Scales) -> FloatArray:
    """Play operators of x, and friction and damping that depend on the level of the last cycles."""
    q = stretch.v / scales.velocity
    sharp = np.tanh(q / _SHARP[0])
    plays = stretch.play / np.maximum(np.abs(stretch.play).max(axis=0), 1e-300)
    late = stretch.recent_level[:, None] * np.stack([q, sharp, stretch.first / scales.first], axis=1)
    return np.concatenate([plays, late], axis=1)


def time_features(stretch: Stretch, scales: Scales) -> FloatArray:
    """Linear features, growing along the run."""
    t = stretch.time_s / scales.time_s
    linear = np.stack([stretch.first / scales.first, stretch.v / scales.velocity, np.ones_like(t)], axis=1)
    return np.asarray(t[:, None] * linear)


@dataclass(frozen=True, eq=False)
class NormalSums:
    """Normal equations of one stretch: sums of products."""

    xx: FloatArray
    xy: FloatArray
    yy: float
    n: int


def normal_sums(features: FloatArray, force: FloatArray) -> NormalSums:
    """Sums of products of features and force."""
    return NormalSums(features.T @ features, features.T @ force, float(force @ force), force.size)


def ridge_regression(
    parts: Sequence[NormalSums], prior: FloatArray, columns: NDArray[np.int64] | slice = slice(None)
) -> FloatArray:
    """Coefficients by ridge regression.

    Parameters
    ----------
    parts : sequence of NormalSums
    prior : ndarray, shape (n_features,)
        Standard deviations of the coefficients over that of what is not explained.
    columns : optional
        Those that are used; the others are zero.
    """
    xx = np.sum([part.xx for part in parts], axis=0)
    xy = np.sum([part.xy for part in parts], axis=0)
    chosen = np.arange(xy.size)[columns]
    found = np.zeros(xy.size)
    # Ridge regression is a Gaussian prior on the coefficients. Features of a nearly harmonic motion are so
    # correlated that there is no stable solution without one.
    lift = np.diag(1 / prior[chosen] ** 2)
    found[chosen] = np.linalg.solve(xx[np.ix_(chosen, chosen)] + lift, xy[chosen])
    return found


def residual_sum_of_squares(parts: Sequence[NormalSums], numbers: FloatArray) -> float:
    """Residual sum of squares of a regression."""
    total = 0.0
    for part in parts:
        # From sums alone, so that a bootstrap needs no residuals; by rounding it may be less than zero.
        total += part.yy - 2 * float(numbers @ part.xy) + float(numbers @ part.xx @ numbers)
    return max(total, 0.0)
