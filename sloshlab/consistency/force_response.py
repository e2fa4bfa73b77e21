"""Force against acceleration where the liquid moves with the tank: apparent mass, delay, linearity.

With the liquid at rest in the tank F = M ü(t − τ). That holds for a whole run that is empty or frozen, and for the
start of any other: a liquid lies on the floor as long as the tank's acceleration stays above −g, and surface waves
need several cycles to grow. Only a run that begins at rest has such a start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import hilbert

from sloshlab.conditioning.combined_channels import TankSignals
from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.conditioning.quality import sample_statistics
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.out_of_core import blocks

FloatArray = npt.NDArray[np.float64]

_LIFT_OFF: Final = 0.9
"""Share of g at which the start counts as over: just before the liquid leaves the floor."""
_LONGEST_START_CYCLES: Final = 12
"""Surface waves under vertical motion grow by a factor e in some cycles, from the ripple of a liquid at rest."""
_FEWEST_SAMPLES: Final = 64
_AT_REST: Final = 0.25
"""A run begins at rest if its first tenth of the start has less than this part of its largest acceleration."""
_SAMPLES_AT_ONCE: Final = 1 << 16
_LONGEST_RUN_SAMPLES: Final = 60_000
"""Of a still run; more tells nothing more."""


@dataclass(frozen=True)
class ForceResponse:
    """F = M ü(t − τ)(1 + c (ü/a)²) over a stretch in which the liquid moves with the tank.

    Attributes
    ----------
    mass_kg, mass_std_kg : float
        M, with the standard deviation from the correlated residuals.
    delay_s, delay_std_s : float
        τ, positive: force comes later.
    bend, bend_std : float
        c a², the part of the force that is missing (negative) at the largest acceleration a of the stretch.
    stop_s : float
        Where the stretch ends.
    """

    mass_kg: float
    mass_std_kg: float
    delay_s: float
    delay_std_s: float
    bend: float
    bend_std: float
    stop_s: float


def start_response(tank: TankSignals) -> ForceResponse | None:
    """Response in the quiet start of a run; None if the run does not begin at rest or is quiet for too short."""
    stretch = quiet_start(tank.acceleration.values)
    return None if stretch is None else _response(tank, stretch)


def stop_response(tank: TankSignals) -> ForceResponse | None:
    """Response while the motion dies away at the end of a run; None if it does not.

    The liquid still moves then, by itself: what it gives and takes is bounded, not absent.
    """
    acceleration = tank.acceleration.values
    n_there, mean = _mean(acceleration)
    if not n_there:
        return None
    n_after = _n_weak(acceleration[::-1], mean)
    if n_after == acceleration.size:
        return None
    stretch = slice(acceleration.size - n_after, acceleration.size)
    left = np.abs(_moved(acceleration[stretch], mean))
    if left.size < _FEWEST_SAMPLES or left[-max(left.size // 10, 4) :].max() > _AT_REST * left.max():
        return None
    return _response(tank, stretch)


def still_response(tank: TankSignals) -> ForceResponse | None:
    """Response of a run without liquid motion, of its first 60 000 samples at most."""
    return _response(tank, slice(0, min(tank.acceleration.size, _LONGEST_RUN_SAMPLES)))


def quiet_start(acceleration: npt.NDArray[np.floating]) -> slice | None:
    """Samples from the beginning until the liquid may have begun to move; None where it may have moved before.

    Parameters
    ----------
    acceleration : ndarray, shape (n_samples,)
        Of the tank [m/s²], NaN where lost.
    """
    n_there, mean = _mean(acceleration)
    if n_there < _FEWEST_SAMPLES:
        return None
    stop = _cycles_end(acceleration[: _n_weak(acceleration, mean)], mean)
    if stop < _FEWEST_SAMPLES:
        return None
    largest = _largest(acceleration[:stop], mean)
    beginning = _largest(acceleration[: max(stop // 10, 4)], mean)
    # a run that was already in motion when the recorder started has liquid that is in motion
    if largest == 0 or beginning > _AT_REST * largest:
        return None
    return slice(0, stop)


def _mean(acceleration: npt.NDArray[np.floating]) -> tuple[int, np.float64]:
    """How many samples are there, and their mean."""
    n, _, _, mean, _ = sample_statistics(acceleration)
    return n, np.float64(mean)


def _largest(acceleration: npt.NDArray[np.floating], mean: np.float64) -> float:
    """Largest magnitude about the mean; 0 without a sample."""
    parts = blocks(acceleration.size, acceleration)
    return max((float(np.abs(_moved(acceleration[part], mean)).max()) for part in parts), default=0.0)


def _moved(acceleration: npt.NDArray[np.floating], mean: np.float64) -> FloatArray:
    """Acceleration about the mean in double precision, zero where lost."""
    return np.where(np.isfinite(acceleration), acceleration - mean, 0.0)


def _n_weak(acceleration: npt.NDArray[np.floating], mean: np.float64) -> int:
    """Samples before the first at which the liquid may leave the floor."""
    # in blocks: most runs lift the liquid early, and what comes after is not looked at
    for part in blocks(acceleration.size, acceleration, of=_SAMPLES_AT_ONCE):
        strong = np.flatnonzero(np.abs(_moved(acceleration[part], mean)) > _LIFT_OFF * GRAVITY_M_PER_S2)
        if strong.size:
            return int(part.start + strong[0])
    return acceleration.size


def _cycles_end(acceleration: npt.NDArray[np.floating], mean: np.float64) -> int:
    """Sample at which the motion has gone through the longest start that is allowed; its end if it does not."""
    # a hysteresis of a tenth: noise at rest does not count as cycles
    level = 0.1 * _largest(acceleration, mean)
    n_cycles, is_above, is_fresh = 0, True, True
    for part in blocks(acceleration.size, acceleration):
        moved = _moved(acceleration[part], mean)
        above, below = moved > level, moved < -level
        # only where the motion rises above the level, or falls below −level, does anything change
        risen = above & ~np.concatenate([[is_above], above[:-1]])
        fallen = below & ~np.concatenate([[False], below[:-1]])
        is_above = bool(above[-1])
        for i in np.flatnonzero(risen | fallen).tolist():
            if fallen[i]:
                is_fresh = True
            elif is_fresh:
                # rises that follow a fall, one per cycle, and the first; counted from the sample before each
                n_cycles, is_fresh = n_cycles + 1, False
                if n_cycles > _LONGEST_START_CYCLES:
                    return int(part.start) + i - 1
    return acceleration.size


def _response(tank: TankSignals, stretch: slice) -> ForceResponse | None:
    acceleration, step_s = tank.acceleration.values, sampling_step_s(tank.acceleration)
    force = np.asarray(tank.force.values[stretch], dtype=np.float64)
    motion = np.asarray(acceleration[stretch], dtype=np.float64)
    jerk = np.gradient(motion, step_s)
    there = np.isfinite(force + motion + jerk)
    if there.sum() < _FEWEST_SAMPLES:
        return None
    waves = _wave_columns(acceleration, stretch)
    force, motion, jerk = force[there], motion[there] - motion[there].mean(), jerk[there]
    largest = float(np.abs(motion).max())
    if largest == 0:
        return None
    linear = np.column_stack([motion, jerk, np.ones(motion.size), waves[there]])
    cubic = np.column_stack([linear, largest * (motion / largest) ** 3])
    # the bend from a fit of its own: with it, mass and delay would be known ten times worse
    solution, std = _least_squares(linear, force, motion)
    bent, bent_std = _least_squares(cubic, force, motion)
    omega = float(np.std(jerk) / np.std(motion))
    if solution[0] <= 0 or omega == 0:
        return None
    # F = M cos ωτ ü − M sin(ωτ)/ω u⃛ at the frequency of the stretch
    mass = float(math.hypot(solution[0], solution[1] * omega))
    time = tank.acceleration["time"].values[stretch]
    return ForceResponse(
        mass_kg=mass,
        mass_std_kg=float(std[0]),
        delay_s=math.atan2(-float(solution[1]) * omega, float(solution[0])) / omega,
        delay_std_s=float(std[1]) / mass,
        bend=float(bent[-1]) / mass,
        bend_std=float(bent_std[-1]) / mass,
        stop_s=float(time[-1]),
    )


def _wave_columns(acceleration: npt.NDArray[np.floating], stretch: slice) -> FloatArray:
    """Waves at half and three halves of the frequency of the motion, as strong as it, shape (n_samples, 4).

    Faraday waves answer a vertical motion at these frequencies first. They are no part of F = M ü, and over few
    cycles they are not orthogonal to it.
    """
    n = stretch.stop - stretch.start
    # longer than the stretch by as much on both sides, where there is more: the transform is wrong at its ends
    first = max(stretch.start - n, 0)
    longer = np.asarray(acceleration[first : stretch.stop + n], dtype=np.float64)
    moved = np.where(np.isfinite(longer), longer - np.nanmean(longer), 0.0)
    analytic = hilbert(moved)[stretch.start - first : stretch.stop - first]
    phase, size = np.unwrap(np.angle(analytic)), np.abs(analytic)
    orders = [wave(order * phase) for order in (0.5, 1.5) for wave in (np.cos, np.sin)]
    return np.asarray(size[:, None] * np.stack(orders, axis=1))


def _least_squares(columns: FloatArray, values: FloatArray, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solution and its standard deviations, robust against correlation over a period.

    Newey & West, 10.2307/1913610.
    """
    # each column over its length: a jerk is a hundred times a motion; what is not independent gets nothing
    lengths = np.linalg.norm(columns, axis=0)
    lengths[lengths == 0] = 1.0
    columns = columns / lengths
    inverse = np.linalg.pinv(columns.T @ columns, hermitian=True)
    solution = inverse @ (columns.T @ values)
    scores = columns * (values - columns @ solution)[:, None]
    spread = scores.T @ scores
    n_lags = min(_period(motion), scores.shape[0] // 3)
    for lag in range(1, n_lags + 1):
        product = scores[lag:].T @ scores[:-lag]
        spread += (1 - lag / (n_lags + 1)) * (product + product.T)
    # few periods tell little of their own scatter
    shortage = scores.shape[0] / max(scores.shape[0] - columns.shape[1] * n_lags / 2, 1.0)
    variance = np.maximum(np.diag(inverse @ spread @ inverse), 0.0) * max(shortage, 1.0)
    return solution / lengths, np.sqrt(variance) / lengths


def _period(motion: FloatArray) -> int:
    crossings = int(np.count_nonzero(np.diff(np.signbit(motion))))
    return max(2, min(2 * motion.size // max(crossings, 1), 2000))
