"""From time stamps to a uniform grid: rounding is recognised, gaps stay gaps, jitter is an error."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.files.table import FloatArray, simplest_decimal_between
from sloshlab.errors import RecordingError

LARGEST_LOST_FRACTION: Final = 0.5
"""A grid of which a larger part than this would be gaps is refused."""

_FINEST_DECIMALS = 12
# a wrong stamp may lie years ahead
_LARGEST_INDEX = 2**40
_MOST_GAPS = 200_000
# one or two longer steps are lost samples; more, in a regular pattern, may be rounding alone
_FEWEST_ODD_STEPS = 3
_HALF = 0.5 * 1.01
"""Rounding moves a stamp by half a unit."""


@dataclass(frozen=True)
class Grid:
    """Where samples lie on a uniform grid.

    Attributes
    ----------
    start_s : float
        Time of grid point 0 [s].
    rate_hz : float
        Points per second.
    index : ndarray of int64, shape (n,)
        Grid point of each sample, increasing.
    worst_deviation_steps : float
        Largest distance of a time stamp from its grid point [steps].
    resolution_s : float
        Coarseness of the time stamps [s].
    """

    start_s: float
    rate_hz: float
    index: NDArray[np.int64]
    worst_deviation_steps: float = 0.0
    resolution_s: float = 0.0

    @property
    def n_points(self) -> int:
        """Grid points from the first sample to the last."""
        return int(self.index[-1]) + 1

    @property
    def n_missing(self) -> int:
        """Grid points without a sample."""
        return self.n_points - self.index.size


def stored_resolution(time_s: FloatArray) -> float:
    """Coarseness of time stamps [s]: a power of ten if all are multiples of it, else float spacing.

    Examples
    --------
    >>> stored_resolution(np.array([0.0, 0.333, 0.667, 1.0]))
    0.001
    """
    largest = float(np.abs(time_s).max())
    spacing = float(np.spacing(largest))
    for decimals in range(_FINEST_DECIMALS + 1):
        unit = 10.0**-decimals
        # finer decimals cannot be told from the spacing of the floats themselves
        if unit < 8 * spacing:
            break
        if np.abs(time_s - np.round(time_s, decimals)).max() <= 2 * spacing:
            return unit
    return 2 * spacing


def uniform_grid(
    time_s: FloatArray,
    *,
    name: str,
    rate_hz: float | None = None,
    resolution_s: float = 0.0,
    jitter_allowed_steps: float = 1e-6,
) -> Grid:
    """Place time stamps on a uniform grid.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Time stamps [s].
    name : str
        Of the source, for messages.
    rate_hz : float, optional
        The rate, where it is known; otherwise the simplest decimal number that explains every
        time stamp within its resolution.
    resolution_s : float
        Coarseness of the stamps [s]; 0 finds it from the numbers.
    jitter_allowed_steps : float
        Deviation that is accepted beyond the coarseness [steps].

    Returns
    -------
    Grid

    Raises
    ------
    RecordingError
        If time is lost, runs backwards, or is not uniform.

    Examples
    --------
    >>> grid = uniform_grid(np.array([0.0, 0.33, 0.67, 1.0, 1.67]), name="text")
    >>> grid.rate_hz, grid.index.tolist()
    (3.0, [0, 1, 2, 3, 5])
    """
    _check_stamps(time_s, name)
    resolution = resolution_s or stored_resolution(time_s)
    offset = time_s - time_s[0]
    found = _whole_steps(offset, rate_hz, resolution) or _all_samples_present(
        offset, rate_hz, resolution, jitter_allowed_steps
    )
    rate, index = found or _with_gaps(offset, rate_hz, resolution, name)
    worst = _half_range(offset, index, rate)
    if worst > _HALF * resolution + jitter_allowed_steps / rate:
        at = int(np.abs(offset - index / rate).argmax())
        raise RecordingError(
            f"{name}: time is not uniform",
            got=f"jitter of {worst * rate:.3g} steps ({worst:.3g} s) near sample {at + 1} for {rate:.9g} Hz",
            allowed=f"≤ {jitter_allowed_steps:g} steps beyond the {resolution:.1g} s to which time is written",
            remedy="state sampling_rate_hz if it is known, or jitter_allowed_steps, or resample",
        )
    n_points = int(index[-1]) + 1
    if n_points - index.size > LARGEST_LOST_FRACTION * n_points:
        raise RecordingError(
            f"{name}: gaps",
            got=f"{n_points - index.size} of {n_points} samples missing at {rate:.6g} Hz",
            allowed=f"at most {LARGEST_LOST_FRACTION:.0%}",
            remedy="import the parts as separate runs, or state sampling_rate_hz",
        )
    return Grid(float(time_s[0]), rate, index, worst * rate, resolution)


def _check_stamps(time_s: FloatArray, name: str) -> None:
    if time_s.size < 2:
        raise RecordingError(f"{name}: time", got=f"{time_s.size} samples", allowed="≥ 2 samples")
    if not np.isfinite(time_s).all():
        at = int(np.argmin(np.isfinite(time_s)))
        raise RecordingError(
            f"{name}: time",
            got=f"no number at sample {at + 1}",
            allowed="a time for every sample",
            remedy="use sampling_rate_hz in [source] if the samples are uniform",
        )
    steps = np.diff(time_s)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0))
        raise RecordingError(
            f"{name}: time",
            got=f"a step back from {time_s[at]:.9g} s to {time_s[at + 1]:.9g} s after sample {at + 1}",
            allowed="increasing time",
            remedy="two records may follow each other in one file: import them as separate runs",
        )
    if time_s[-1] == time_s[0]:
        raise RecordingError(f"{name}: time", got="one time for all samples", allowed="increasing time")


def _half_range(offset: FloatArray, index: NDArray[np.int64], rate: float) -> float:
    """Largest distance of the stamps from the best-placed uniform grid of that rate [s]."""
    residual = offset - index / rate
    return 0.5 * float(residual.max() - residual.min())


def _whole_steps(
    offset: FloatArray, rate_hz: float | None, resolution: float
) -> tuple[float, NDArray[np.int64]] | None:
    """The grid of the smallest step, if every step is a whole multiple of it.

    A longer step is a gap. Only a regular pattern of at least `_FEWEST_ODD_STEPS` longer steps that
    rounding alone explains is left to the other readings: 900 Hz written to a millisecond looks so.
    """
    steps = np.diff(offset)
    unit = float(steps.min())
    if unit <= 0 or offset[-1] > _LARGEST_INDEX * unit:
        return None
    counts = np.rint(steps / unit)
    spacing = float(np.spacing(np.abs(offset).max()))
    # stamps that are written as coarsely as the step cannot show whether a step is a whole multiple
    noise = resolution if resolution < 0.01 * unit else 0.0
    if np.abs(steps - counts * unit).max() > 1e-6 * unit + 8 * spacing + 2 * noise:
        return None
    index = np.concatenate([[0], np.cumsum(counts.astype(np.int64))])
    rate = _simplest_rate(offset, index, noise or 4 * spacing)
    if rate_hz is not None:
        return (rate_hz, index) if abs(rate / rate_hz - 1) <= 1e-6 else None
    if (counts > 1).sum() >= _FEWEST_ODD_STEPS and _all_samples_present(offset, None, resolution, 0.0):
        return None
    return rate, index


def _all_samples_present(
    offset: FloatArray, rate_hz: float | None, resolution: float, jitter: float
) -> tuple[float, NDArray[np.int64]] | None:
    index = np.arange(offset.size, dtype=np.int64)
    rate = rate_hz or _simplest_rate(offset, index, resolution)
    fits = _half_range(offset, index, rate) <= _HALF * resolution + jitter / rate
    return (rate, index) if fits else None


def _with_gaps(
    offset: FloatArray, rate_hz: float | None, resolution: float, name: str
) -> tuple[float, NDArray[np.int64]]:
    """Runs without a gap are consecutive; each run starts where the mean of its stamps says."""
    steps = np.diff(offset)
    typical = 1 / rate_hz if rate_hz else _typical_step(steps, resolution)
    # beyond what rounding of both ends of a step can do
    edges = np.concatenate([[0], np.flatnonzero(steps > 1.5 * typical + resolution) + 1, [offset.size]])
    if edges.size > _MOST_GAPS:
        raise RecordingError(
            f"{name}: time is not uniform", got=f"{edges.size - 2} gaps", allowed=f"≤ {_MOST_GAPS}"
        )
    _require_countable(float(offset[-1]) / typical, float(steps.max()), name)
    # from the longest run without a gap: the typical step is too coarse to count across gaps
    longest = int(np.diff(edges).argmax())
    run = offset[edges[longest] : edges[longest + 1]]
    rate = rate_hz or 1 / typical
    # a run of one and the same stamp says nothing about the rate
    if rate_hz is None and run.size > 2 and run[-1] > run[0]:
        rate = _simplest_rate(run - run[0], np.arange(run.size), resolution)
    _require_countable(float(offset[-1]) * rate, float(steps.max()), name)
    index = np.arange(offset.size, dtype=np.int64)
    for first, last in itertools.pairwise(edges):
        # the mean of a run is known more finely than its stamps are written
        phase = float(np.mean(offset[first:last] - np.arange(last - first) / rate)) * rate
        index[first:last] += round(phase) - first
    index -= index[0]
    if (np.diff(index) < 1).any():
        raise RecordingError(
            f"{name}: time is not uniform",
            got=f"steps between {steps.min():.3g} and {steps.max():.3g} s",
            allowed="uniform time, with gaps of whole steps",
            remedy="state the right sampling_rate_hz; samples out of order or sent twice must be sorted out first",
        )
    return rate_hz or _simplest_rate(offset, index, resolution), index


def _require_countable(n_steps: float, longest_s: float, name: str) -> None:
    if not n_steps <= _LARGEST_INDEX:
        raise RecordingError(f"{name}: time", got=f"a gap of {longest_s:.3g} s", allowed="a shorter gap")


def _typical_step(steps: FloatArray, resolution: float) -> float:
    median = float(np.median(steps[steps > 0]))
    return float(np.mean(steps[steps <= 1.5 * median + 1.01 * resolution]))


def _simplest_rate(offset: FloatArray, index: NDArray[np.int64], resolution: float) -> float:
    """The simplest rate that agrees with the last time stamp within the resolution."""
    duration, n_steps = float(offset[-1]), int(index[-1])
    mean = n_steps / duration
    if not 0 < resolution < duration:
        return mean
    simplest = simplest_decimal_between(n_steps / (duration + resolution), n_steps / (duration - resolution))
    before, after = _half_range(offset, index, mean), _half_range(offset, index, simplest)
    # the simple number only where the stamps fit it as well: a real rate need not be a round one
    return simplest if after <= max(before, _HALF * resolution) else mean
