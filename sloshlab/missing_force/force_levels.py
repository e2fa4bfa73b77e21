"""Amplitude dependence of a latent force: work per cycle, onset, orders of the excitation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, hilbert, sosfiltfilt

from sloshlab.missing_force.force_regression import Stretch
from sloshlab.missing_force.latent_force import LatentForce

FloatArray = NDArray[np.float64]
_CYCLES: Final = 3
"""Of a window."""
_FEWEST_SAMPLES: Final = 8
"""In a window: shorter ones do not sample a cycle."""
_N_DRAWS: Final = 120
_LEAST_SPAN: Final = 1.6
"""Ratio of the amplitudes of the middle 80 %, from which their exponent is told."""
_LEAST_FREQUENCY_SPAN: Final = 1.25
"""The same of the frequencies."""
_SIGNIFICANT: Final = 2.0
"""Work over its doubt by the tolerance of the damping, from which its sign is certain."""
_N_LEVELS: Final = 6
"""Classes of equal population, in which an onset is sought."""
_NOISE_ONLY: Final = 1.35
"""RMS over noise up to which nothing but noise is there."""
_AT_REST: Final = 0.03
"""Share of the largest level below which a place counts as at rest."""
_NARROW: Final = 0.6
"""Share of the power about one frequency, from which a motion has a single one."""
ORDERS: Final = (0.5, 1.0, 1.5, 2.0, 3.0)
"""Frequencies over that of the motion."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Means over windows of three cycles, each an array of shape (n,).

    Attributes
    ----------
    level_g : ndarray
        Amplitude of the acceleration.
    amplitude_m : ndarray
    omega : ndarray
        Frequency [rad/s].
    power_w : ndarray
        Mean of force times velocity; negative where it takes energy.
    force_rms_n, velocity_m_per_s : ndarray
        Root mean squares.
    work_j, work_doubt_j : ndarray
        Dissipated per cycle, and what the block's own damping may make of it (one standard deviation).
    stretch : ndarray of int
        Which stretch each window is of.
    """

    level_g: FloatArray
    amplitude_m: FloatArray
    omega: FloatArray
    power_w: FloatArray
    force_rms_n: FloatArray
    velocity_m_per_s: FloatArray
    work_j: FloatArray
    work_doubt_j: FloatArray
    stretch: NDArray[np.int64]


def windows(parts: Sequence[Stretch], forces: Sequence[FloatArray], own_damping: float) -> Windows:
    """Cut stretches into windows of three cycles; those at rest are left out.

    Parameters
    ----------
    parts : sequence of Stretch
    forces : sequence of ndarray
        Beyond the block's own stiffness and mass, per stretch.
    own_damping : float
        Standard deviation of the block's own damping [N s/m].
    """
    rows = []
    for number, (part, beyond) in enumerate(zip(parts, forces, strict=True)):
        cycles = float(part.time_s[-1] - part.time_s[0]) * float(np.median(part.omega)) / (2 * np.pi)
        n = int(min(max(1.0, cycles / _CYCLES), max(1, part.time_s.size // _FEWEST_SAMPLES)))
        for piece in np.array_split(np.arange(part.time_s.size), n):
            v, a, force = part.v[piece], part.a[piece], part.force_n[piece]
            rms_v, rms_a = float(np.sqrt(np.mean(v**2))), float(np.sqrt(np.mean(a**2)))
            # Exact for a harmonic motion.
            omega = max(rms_a / max(rms_v, 1e-300), 1e-12)
            period = 2 * np.pi / omega
            power = float(np.mean(force * v))
            rows.append(
                (
                    float(part.level_g[piece].mean()), np.sqrt(2) * rms_v / omega, omega, power,
                    float(np.sqrt(np.mean(beyond[piece] ** 2))), rms_v, -power * period,
                    own_damping * rms_v**2 * period, number,
                )
            )  # fmt: skip
    table = np.array(rows).T
    moves = table[0] > _AT_REST * table[0].max()
    level, amplitude, omega, power, force, velocity, work, doubt, number = table[:, moves]
    return Windows(level, amplitude, omega, power, force, velocity, work, doubt, number.astype(np.int64))


Estimate = tuple[float, float, float]


@dataclass(frozen=True)
class WorkExponents:
    """W ∝ amplitude^p frequency^q.

    Attributes
    ----------
    amplitude, frequency : tuple of value, low, high; or None
    why : dict
        What forbids an answer.
    """

    amplitude: Estimate | None
    frequency: Estimate | None
    why: dict[str, str]


def work_exponents(found: Windows, generator: np.random.Generator) -> WorkExponents:
    """Exponents of amplitude and frequency in the dissipated work per cycle, by weighted regression of logarithms.

    Parameters
    ----------
    found : Windows
    generator : Generator
        Draws stretches for the intervals.
    """
    doubt = np.maximum(found.work_doubt_j, 0.05 * np.abs(found.work_j))
    sure = found.work_j > _SIGNIFICANT * doubt
    # Only windows whose work is beyond doubt have a logarithm that means something; where fewer than half have,
    # those that are left are a biased choice.
    if sure.sum() < 12 or sure.mean() < 0.5:
        few = "too few cycles take energy beyond doubt"
        return WorkExponents(None, None, {"amplitude": few, "frequency": few})
    logs = [np.log(values[sure]) for values in (found.work_j, found.amplitude_m, found.omega)]
    weight = found.work_j[sure] / np.hypot(doubt[sure], 0.2 * found.work_j[sure])
    spans = [_span(log) for log in logs[1:]]
    free = [span > np.log(least) for span, least in zip(spans, (_LEAST_SPAN, _LEAST_FREQUENCY_SPAN), strict=True)]
    why = {"amplitude": "the amplitudes are too alike", "frequency": "the frequencies are too alike"}
    if not any(free):
        return WorkExponents(None, None, why)
    columns = np.stack(
        [np.ones(logs[0].size), *[log for log, is_free in zip(logs[1:], free, strict=True) if is_free]], axis=1
    )
    stretch = found.stretch[sure]
    names = np.unique(stretch)

    def slopes(chosen: NDArray[np.int64]) -> FloatArray:
        # Whole stretches are drawn: windows of one decay follow each other and are not independent.
        rows = np.concatenate([np.flatnonzero(stretch == name) for name in chosen])
        w = weight[rows, None]
        return np.asarray(np.linalg.lstsq(columns[rows] * w, logs[0][rows] * w[:, 0], rcond=None)[0][1:])

    value = slopes(names)
    draws = np.array([slopes(generator.choice(names, names.size)) for _ in range(_N_DRAWS)])
    low, high = np.quantile(draws, (0.05, 0.95), axis=0)
    estimates: list[Estimate | None] = []
    at = 0
    for is_free in free:
        if not is_free:
            estimates.append(None)
            continue
        estimates.append((float(value[at]), float(min(low[at], value[at])), float(max(high[at], value[at]))))
        at += 1
    return WorkExponents(estimates[0], estimates[1], why)


def _span(logs: FloatArray) -> float:
    low, high = np.quantile(logs, (0.1, 0.9))
    return float(high - low)


def onset(
    parts: Sequence[Stretch], own: FloatArray, noise_n: float, generator: np.random.Generator
) -> tuple[float, float, float, bool] | None:
    """The level up to which the block's own parameters alone describe the force.

    Parameters
    ----------
    parts : sequence of Stretch
    own : ndarray, shape (3,)
        Tolerances of the block's own parameters.
    noise_n : float
    generator : Generator

    Returns
    -------
    value, low, high : float
        Level [g].
    at_lowest : bool
        Whether the force is there at the smallest level already.
        None where the levels are too alike.
    """
    everywhere = np.concatenate([part.level_g for part in parts])
    moves = everywhere > _AT_REST * everywhere.max()
    level = everywhere
    force = np.concatenate([part.force_n for part in parts])
    motion = np.concatenate([part.own for part in parts]) * np.where(own > 0, 4 * own, 0.0)
    if _span(np.log(level[moves])) < np.log(_LEAST_SPAN):
        return None
    # Classes of equal population: in a decay most samples are small, and equal widths would leave the upper ones
    # empty.
    edges = np.quantile(level[moves], np.linspace(0, 1, _N_LEVELS + 1))

    def reached(rows: NDArray[np.int64]) -> int:
        """How many of the lowest classes hold noise only."""
        count = 0
        for upper in range(1, _N_LEVELS + 1):
            inside = rows[moves[rows] & (level[rows] <= edges[upper])]
            if inside.size < 8:
                return count
            # The block's own numbers are fitted to the lower levels alone, so that what sets in above cannot
            # hide in them.
            squares = motion[inside].T @ motion[inside]
            independent = max(4.0, inside.size / 30)
            lift = inside.size / independent * float(np.var(force[inside]))
            lift = max(lift, 1e-9 * float(np.trace(squares)), 1e-30)
            numbers = np.linalg.solve(squares + lift * np.eye(3), motion[inside].T @ force[inside])
            top = inside[level[inside] > edges[upper - 1]]
            rest = force[top] - motion[top] @ numbers
            # A draw of stretches may have none of a level, which then tells nothing.
            if top.size and np.sqrt(np.mean(rest**2)) > _NOISE_ONLY * noise_n:
                return count
            count = upper
        return count

    starts = np.cumsum([0, *[part.level_g.size for part in parts]])
    blocks = [np.arange(a, b) for a, b in pairwise(starts)]
    best = reached(np.arange(level.size))
    draws = []
    for _ in range(_N_DRAWS // 4):
        chosen = generator.integers(0, len(blocks), len(blocks))
        draws.append(reached(np.concatenate([blocks[int(i)] for i in chosen])))
    low, high = np.quantile(draws, (0.05, 0.95))
    above = min(best + 1, _N_LEVELS)
    value = float(edges[best]) if best == 0 else float(0.5 * (edges[best] + edges[above]))
    return (
        value,
        float(edges[int(min(low, best))]),
        float(edges[min(int(max(high, best)) + 1, _N_LEVELS)]),
        best == 0,
    )


def orders(
    forces: Sequence[LatentForce], beyond: Sequence[FloatArray], generator: np.random.Generator
) -> dict[float, Estimate] | None:
    """Share of the force's variance at multiples of the frequency of the motion, resampled over its phase.

    Parameters
    ----------
    forces : sequence of LatentForce
    beyond : sequence of ndarray
        The force beyond the block's own parameters, in stretches, as many of each run as of any other.
    generator : Generator

    Returns
    -------
    dict of order to (value, low, high), or None where no run has a single frequency.
    """
    per_run = len(beyond) // len(forces)
    shares = []
    for number, force in enumerate(forces):
        series = np.concatenate(beyond[number * per_run : (number + 1) * per_run])
        found = _shares_of_orders(force, series)
        if found is not None:
            shares += found
    if len(shares) < 2:
        return None
    table = np.array(shares)
    weight = table[:, -1:]

    def share(rows: NDArray[np.int64]) -> FloatArray:
        return np.asarray((table[rows, :-1] * weight[rows]).sum(axis=0) / weight[rows].sum())

    n = len(shares)
    value = share(np.arange(n))
    draws = np.array([share(generator.integers(0, n, n)) for _ in range(_N_DRAWS)])
    low, high = np.quantile(draws, (0.05, 0.95), axis=0)
    return {order: (float(value[i]), float(low[i]), float(high[i])) for i, order in enumerate(ORDERS)}


def _shares_of_orders(latent_force: LatentForce, series: FloatArray) -> list[FloatArray] | None:
    """Per piece of the run: shares of the orders, and the power that they are shares of."""
    v, a = latent_force.motion[:, 1], latent_force.motion[:, 2]
    rate = latent_force.run.attributes.sampling_rate_hz
    omega = float(a.std() / max(v.std(), 1e-300))
    moves = np.flatnonzero(np.abs(v) > _AT_REST * np.abs(v).max())
    if not moves.size:
        return None
    # Where the motion has come to rest there is no phase to resample over.
    v, series = v[: moves[-1] + 1], series[: moves[-1] + 1]
    main = omega / (2 * np.pi)
    if main < 4 * rate / v.size or 1.6 * main > 0.45 * rate:
        return None
    narrow = sosfiltfilt(butter(3, (main / 1.6, 1.6 * main), "bandpass", fs=rate, output="sos"), v)
    if np.mean(narrow**2) < _NARROW * np.mean(v**2):
        return None
    phase = np.unwrap(np.angle(hilbert(narrow)))
    # A phase that runs backwards is one of several frequencies.
    if np.mean(np.diff(phase) <= 0) > 0.02:
        return None
    # Interpolation needs places that grow.
    phase = np.maximum.accumulate(phase)
    per_cycle = max(16, min(256, int(rate / main)))
    turns = np.arange(phase[0], phase[-1], 2 * np.pi / per_cycle)
    resampled = np.interp(turns, phase, series)
    # An even number, so that half orders fall on lines of the transform.
    n_cycles = 8
    pieces = [resampled[i : i + n_cycles * per_cycle] for i in range(0, resampled.size, n_cycles * per_cycle)]
    found = []
    window = np.hanning(n_cycles * per_cycle)
    for piece in pieces:
        if piece.size < window.size:
            continue
        power = np.abs(np.fft.rfft(window * (piece - piece.mean()))) ** 2
        total = float(power[1:].sum())
        if total <= 0:
            continue
        # Three lines: the main lobe of a Hann window.
        lines = [float(power[round(n_cycles * order) - 1 : round(n_cycles * order) + 2].sum()) for order in ORDERS]
        found.append(np.array([*[line / total for line in lines], total]))
    return found or None


def constant_part(
    parts: Sequence[FloatArray], generator: np.random.Generator
) -> tuple[float, float, float, float]:
    """Mean of a force with its 90 % interval, and its RMS."""
    means = np.array([part.mean() for part in parts])
    draws = [float(means[generator.integers(0, means.size, means.size)].mean()) for _ in range(_N_DRAWS)]
    low, high = np.quantile(draws, (0.05, 0.95))
    return float(means.mean()), float(low), float(high), float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
