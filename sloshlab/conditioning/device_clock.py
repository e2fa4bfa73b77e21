"""How a device's sample counter runs against the clock of the computer that reads it.

A block of samples arrives some time after its last sample was taken. That latency is never negative
and has no upper bound: buffers, schedulers and buses only ever add to it. The counter is therefore
fitted to the *lower* envelope of the arrivals, which no latency spike can move; what the shortest
way through the buffers costs cannot be known from arrivals and stays in the offset.
"""

from __future__ import annotations

import enum
import itertools
import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

LARGEST_REAL_TIME_DRIFT: Final = 0.05
"""A counter further from its nominal rate than this share was not sampled in real time."""

_N_SEGMENTS = 32
_PAIRS_PER_SEGMENT = 4
_FEWEST_SEGMENTS = 4
_N_DRAWS = 600
_SHAPES = (1.0, 1.5, 2.0, 3.0, 5.0)
_SPREAD_QUANTILE = 0.6
_SAFETY = 1.3
_CONFIDENCE = 0.95


class ClockStatus(enum.Enum):
    """What the fit of a device clock is worth; the text is the explanation."""

    FITTED = "the counter was fitted to the arrivals"
    NOT_REAL_TIME = "not real time: the device was played faster or slower, host times mean nothing"
    UNDETERMINED = "too few arrivals to know the rate of the counter"


@dataclass(frozen=True)
class DeviceClock:
    """Host time of each sample: ``first_sample_s + period_s · counter`` after `host_origin_ns`.

    Attributes
    ----------
    status : ClockStatus
        Only a fitted clock may be used to place samples.
    n_pairs : int
        Arrivals used.
    span_s : float
        From the first to the last arrival [s].
    host_origin_ns : int
        Host monotonic clock [ns] from which `first_sample_s` counts.
    first_sample_s : float
        When the sample with counter 0 was taken, the shortest latency included [s].
    period_s : float
        Host seconds per sample.
    drift_ppm : float
        How much faster than nominal the device samples; negative when slower.
    offset_error_s, drift_error_ppm : float
        Half widths of the 95 % intervals: of the fitted host time at the worse end of the run, and of the
        drift. They hold for latencies that are as short now and then in every part of the run.
    latency_median_s, latency_95_s, latency_max_s : float
        Arrivals above the envelope: half of them, 95 % and all are earlier than this [s].
    residual_rms_s : float
        RMS distance of the earliest arrivals of the run's parts from the line [s].
    """

    status: ClockStatus
    n_pairs: int
    span_s: float
    host_origin_ns: int
    first_sample_s: float
    period_s: float
    drift_ppm: float
    offset_error_s: float
    drift_error_ppm: float
    latency_median_s: float
    latency_95_s: float
    latency_max_s: float
    residual_rms_s: float

    def host_s(self, counter: float) -> float:
        """Host time of a sample [s after `host_origin_ns`]."""
        return self.first_sample_s + self.period_s * counter

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and texts; None for what is not finite, as JSON wants it."""
        plain = {**asdict(self), "status": self.status.name.lower()}
        return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in plain.items()}


def fitted_device_clock(
    counters: npt.ArrayLike, host_monotonic_ns: npt.ArrayLike, sampling_rate_hz: float
) -> DeviceClock:
    """Offset and rate of a sample counter from the arrivals of its blocks.

    Parameters
    ----------
    counters : array_like of int, shape (n_pairs,)
        Counter of the last sample of each block.
    host_monotonic_ns : array_like of int, shape (n_pairs,)
        When the block had been read [ns].
    sampling_rate_hz : float
        Nominal rate of the counter.

    Returns
    -------
    DeviceClock

    Raises
    ------
    AnalysisError
        If the two differ in length, there is none, or the rate is not positive.

    Notes
    -----
    Of all lines a + b·counter below every arrival the one with the smallest mean distance is taken: the
    edge of the lower convex hull over the mean counter [1]_. Its error is simulated: the earliest arrivals
    of 32 parts of the run are taken for draws of a Weibull law (the limit law of minima), its scale from
    their median and its shape from their quartiles, so that parts in which the host was busy throughout do
    not matter. Arrivals that lie exactly on the host's own grid for the whole run (a block period that is a
    multiple of a polling interval) show the host's rate instead of the device's, and nothing in them tells.

    References
    ----------
    .. [1] Moon, Skelly, Towsley: Estimation and removal of clock skew from network delay measurements,
       INFOCOM 1999, doi:10.1109/INFCOM.1999.749287.

    Examples
    --------
    A device that runs 100 ppm fast, read without any latency:

    >>> counters = np.arange(0, 5120, 16)
    >>> arrivals = np.round(counters / (512 * 1.0001) * 1e9).astype(np.int64)
    >>> round(fitted_device_clock(counters, arrivals, 512.0).drift_ppm, 1)
    100.0
    """
    counter, arrival, origin_ns = _checked_pairs(counters, host_monotonic_ns, sampling_rate_hz)
    nominal_s = 1.0 / sampling_rate_hz
    # one counter only: a time, but no rate
    if counter[0] == counter[-1]:
        earliest = float((arrival - nominal_s * counter).min())
        return _undetermined(counter.size, origin_ns, earliest, nominal_s)
    first_s, period_s = _lower_line(counter, arrival)
    # never negative by construction; the shortest latency itself is part of `first_s` and cannot be known
    latency = arrival - (first_s + period_s * counter)
    offset_error, period_error, residual = _errors(counter, latency)
    rate_ratio = nominal_s / period_s if period_s > 0 else math.inf
    median, high = np.quantile(latency, [0.5, 0.95])
    return DeviceClock(
        status=_status(rate_ratio, period_error / nominal_s),
        n_pairs=int(counter.size),
        span_s=float(arrival.max() - arrival.min()),
        host_origin_ns=origin_ns,
        first_sample_s=first_s,
        period_s=period_s,
        drift_ppm=1e6 * (rate_ratio - 1),
        offset_error_s=offset_error,
        drift_error_ppm=1e6 * period_error / nominal_s,
        latency_median_s=float(median),
        latency_95_s=float(high),
        latency_max_s=float(latency.max()),
        residual_rms_s=residual,
    )


def _checked_pairs(
    counters: npt.ArrayLike, host_monotonic_ns: npt.ArrayLike, sampling_rate_hz: float
) -> tuple[FloatArray, FloatArray, int]:
    """Sorted by counter; host times in seconds after the earliest, exact before they become floats."""
    counter = np.asarray(counters, dtype=np.int64)
    host_ns = np.asarray(host_monotonic_ns, dtype=np.int64)
    if counter.ndim != 1 or counter.shape != host_ns.shape or counter.size == 0 or not sampling_rate_hz > 0:
        raise AnalysisError(
            "clock of a device",
            got=f"{counter.size} counters, {host_ns.size} host times, {sampling_rate_hz:g} Hz",
            allowed="one host time per counter, at least one, and a rate > 0",
        )
    # by counter, not by arrival: late blocks have their place, and of equal counters the earliest comes first
    order = np.lexsort((host_ns, counter))
    origin_ns = int(host_ns.min())
    # a monotonic clock in nanoseconds has more digits than a float; its difference to the first has not
    arrival = np.asarray((host_ns[order] - origin_ns) * 1e-9, dtype=np.float64)
    return counter[order].astype(np.float64), arrival, origin_ns


def _undetermined(n_pairs: int, origin_ns: int, first_s: float, period_s: float) -> DeviceClock:
    return DeviceClock(
        ClockStatus.UNDETERMINED, n_pairs, 0.0, origin_ns, first_s, period_s,
        drift_ppm=0.0, offset_error_s=math.inf, drift_error_ppm=math.inf,
        latency_median_s=math.nan, latency_95_s=math.nan, latency_max_s=math.nan, residual_rms_s=math.nan,
    )  # fmt: skip


def _status(rate_ratio: float, relative_error: float) -> ClockStatus:
    # before the rate is judged: a rate that is not known must not be called wrong
    if relative_error > LARGEST_REAL_TIME_DRIFT:
        return ClockStatus.UNDETERMINED
    if abs(rate_ratio - 1) > LARGEST_REAL_TIME_DRIFT:
        return ClockStatus.NOT_REAL_TIME
    return ClockStatus.FITTED


def _lower_line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Intercept and slope of the edge of the lower convex hull over the mean of `x` (sorted)."""
    # counters of a long run have many digits: everything about the mean
    mean = float(x.mean())
    left, right = _edge_over(x - mean, y)
    slope = float((y[right] - y[left]) / (x[right] - x[left]))
    return float(y[left] - slope * x[left]), slope


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _edge_over(x: FloatArray, y: FloatArray) -> tuple[int, int]:
    """Both ends of the lower hull's edge over x = 0, by Andrew's monotone chain."""
    # linear in the number of arrivals, which are sorted; all lines below all points touch the lower hull
    hull = np.empty(x.size, dtype=np.int64)
    n = 0
    for i in range(x.size):
        if n > 0 and x[i] == x[hull[n - 1]]:
            continue  # equal counters come sorted by arrival: the first is the lower one
        while n > 1:
            a, b = hull[n - 2], hull[n - 1]
            if (x[b] - x[a]) * (y[i] - y[a]) > (y[b] - y[a]) * (x[i] - x[a]):
                break
            n -= 1
        hull[n] = i
        n += 1
    k = 1
    while k < n - 1 and x[hull[k]] < 0:
        k += 1
    return hull[k - 1], hull[k]


def _errors(counter: FloatArray, latency: FloatArray) -> tuple[float, float, float]:
    """95 % half widths of the time at the worse end [s] and of the period [s], and the residual RMS [s]."""
    places, minima = _earliest_per_segment(counter, latency)
    span = counter[-1] - counter[0]
    if places.size < _FEWEST_SEGMENTS:
        # too few parts for a law of minima: the whole spread of the latencies stands in
        spread = float(latency.max())
        return spread, 2 * spread / span, float(np.sqrt((minima**2).mean()))
    ends = np.array([counter[0], counter[-1]]) - counter.mean()
    shape, scale = _lower_tail(places, minima)
    middle, slope = _lower_lines(places, scale * _weibull(shape, places.size))
    at_ends = np.abs(middle[:, None] + slope[:, None] * ends).max(axis=1)
    # the shape is only estimated and arrivals in bursts are no independent draws: hence the safety factor
    offset_error, slope_error = (_SAFETY * float(np.quantile(x, _CONFIDENCE)) for x in (at_ends, np.abs(slope)))
    return offset_error, slope_error, float(np.sqrt((minima**2).mean()))


def _lower_tail(places: FloatArray, minima: FloatArray) -> tuple[float, float]:
    """Shape and scale of the Weibull law whose draws, fitted alike, leave minima spread like these.

    The line rests on two of the minima, so that they say less than their number suggests; simulating
    the fit with each shape takes that into account.
    """
    spread, middle = _spread_and_middle(minima[None, :])
    candidates = []
    for shape in _SHAPES:
        draws = _weibull(shape, places.size)
        height, slope = _lower_lines(places, draws)
        spreads, middles = _spread_and_middle(draws - height[:, None] - slope[:, None] * places)
        candidates.append((float(np.quantile(spreads, _SPREAD_QUANTILE)), shape, float(np.median(middles))))
    # a narrow spread high above the line means that the shortest latency is rarely met
    possible = [candidate for candidate in candidates if spread[0] <= candidate[0]] or candidates[:1]
    _, shape, unit_middle = possible[-1]
    return shape, float(middle[0]) / unit_middle


def _spread_and_middle(minima: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Interquartile range over median, and median, of each row."""
    low, middle, high = np.quantile(minima, [0.25, 0.5, 0.75], axis=1)
    return np.divide(high - low, middle, out=np.full_like(middle, np.inf), where=middle > 0), middle


def _weibull(shape: float, n_segments: int) -> FloatArray:
    # a seed of its own: the same arrivals always give the same error
    return np.random.default_rng(0).weibull(shape, (_N_DRAWS, n_segments))


def _earliest_per_segment(counter: FloatArray, latency: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places (about the mean counter) and values of the smallest latency in each part of the run."""
    n_segments = min(_N_SEGMENTS, max(1, counter.size // _PAIRS_PER_SEGMENT))
    edges = np.linspace(counter[0], counter[-1], n_segments + 1)
    bounds = np.unique(np.append(np.searchsorted(counter, edges[:-1]), counter.size))
    lowest = np.array([start + int(latency[start:stop].argmin()) for start, stop in itertools.pairwise(bounds)])
    return counter[lowest] - counter.mean(), latency[lowest]


def _lower_lines(places: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Height over place 0 and slope of the lower hull's edge there, for each row of `values`."""
    left, right = np.flatnonzero(places <= 0), np.flatnonzero(places > 0)
    if left.size == 0 or right.size == 0:
        left, right = np.arange(places.size - 1), np.arange(places.size - 1, places.size)
    i, j = (index.ravel() for index in np.meshgrid(left, right))
    distance = places[j] - places[i]
    # the hull over 0 is the lowest of all chords that span 0
    heights = (values[:, i] * places[j] - values[:, j] * places[i]) / distance
    lowest = heights.argmin(axis=1)
    rows = np.arange(values.shape[0])
    slope = (values[rows, j[lowest]] - values[rows, i[lowest]]) / distance[lowest]
    return np.asarray(heights[rows, lowest]), np.asarray(slope)
