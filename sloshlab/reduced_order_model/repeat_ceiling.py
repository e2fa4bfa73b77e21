"""How well any model of the motion can do: the force of one repeat of a run against that of another.

Two runs with the same motion differ by what the motion does not decide. A model that knows the mean over all
repeats misses each by that scatter alone; one repeat put in place of another misses it by √2 of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.conditioning.resampling import resampled
from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.fit_quality import FitQuality, fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.sweep.motion_phase import measured_phase

FloatArray = NDArray[np.float64]

FREQUENCY_TOLERANCE: Final = 0.01
SPEED_TOLERANCE: Final = 0.05
"""Cycles are compared whose frequencies and speeds differ by less than these shares."""
_SMALLEST_MATCHED_SHARE: Final = 0.5


@dataclass(frozen=True)
class MatchedRepeats:
    """One run and the force of another one at the same places of the same cycles.

    Attributes
    ----------
    force_n, other_force_n : ndarray, shape (n,)
        On the grid of the model's rate of the first run; both NaN outside matched cycles.
    cycle : ndarray of int, shape (n,)
        Number of the cycle of the first run, −1 outside.
    cycle_frequency_hz : ndarray, shape (n_cycles,)
    names : tuple of str
        Of both runs.
    """

    force_n: FloatArray
    other_force_n: FloatArray
    cycle: NDArray[np.int64]
    cycle_frequency_hz: FloatArray
    names: tuple[str, str]

    def fit(self) -> FitQuality:
        """How well the other force tells this one."""
        return fit_quality(self.force_n, self.other_force_n)

    def fit_of_ideal_model(self) -> FitQuality:
        """How well the mean of very many repeats would: its error is 1/√2 of that of one repeat."""
        # two repeats differ by √2 of the scatter of one
        half = self.force_n + (self.other_force_n - self.force_n) / math.sqrt(2)
        return fit_quality(self.force_n, half)

    def rms_by_cycle(self, values: FloatArray) -> FloatArray:
        """Root mean square of values on the same grid within each cycle; NaN for those not matched."""
        used = (self.cycle >= 0) & np.isfinite(values) & np.isfinite(self.force_n)
        n = self.cycle_frequency_hz.size
        counts = np.bincount(self.cycle[used], minlength=n)
        squares = np.bincount(self.cycle[used], values[used] ** 2, minlength=n)
        return np.sqrt(np.where(counts > 0, squares / np.maximum(counts, 1), np.nan))


def matched_repeats(reference: LiquidSignals, other: LiquidSignals, sampling_rate_hz: float) -> MatchedRepeats:
    """Bring the force of a repeat to the cycles of another run.

    Parameters
    ----------
    reference, other : LiquidSignals
        As recorded, with the same motion.
    sampling_rate_hz : float
        Rate, and so the band, in which forces are compared; not above those of the runs.

    Raises
    ------
    AnalysisError
        If less than half of the cycles have the same frequency and speed.

    Notes
    -----
    Cycles are counted by the phase of the acceleration. Cycle n of one run is paired with the cycle of the other
    that is nearest in time; within a cycle, places correspond by their share of its duration. The other force is
    interpolated there in the band of the wanted rate.
    """
    edges, others = _boundaries_s(reference), _boundaries_s(other)
    shift = _shift(edges, others)
    n = np.arange(max(0, -shift), min(edges.size, others.size - shift))
    if n.size < 2:
        raise _not_repeats(reference, other, "no cycles at the same times")
    # only where the motion is the same does the difference of the forces tell what the motion does not decide
    alike = _alike(reference, other, edges[n], others[n + shift])
    if not alike.mean() > _SMALLEST_MATCHED_SHARE:
        raise _not_repeats(reference, other, f"{100 * alike.mean():.0f} % of the cycles have the same motion")
    own = reference.at_rate(sampling_rate_hz)
    time_s = np.arange(own.dynamic_force_n.size) / sampling_rate_hz
    cycle = np.searchsorted(edges[n], time_s, side="right") - 1
    cycle[(cycle < 0) | (cycle >= n.size - 1)] = -1
    cycle[~alike[cycle]] = -1
    # cycle by cycle: compared at equal times, a drift of the shaker would count as scatter of the liquid
    positions = np.interp(time_s, edges[n], others[n + shift]) * other.sampling_rate_hz
    ratio = sampling_rate_hz / other.sampling_rate_hz
    # limited to the model's band: what no model of this rate can say is not held against it
    force = resampled(other.dynamic_force_n, positions, rate_ratio=ratio)
    known = (cycle >= 0) & np.isfinite(force) & np.isfinite(own.dynamic_force_n)
    return MatchedRepeats(
        np.where(known, own.dynamic_force_n, np.nan),
        np.where(known, force, np.nan),
        np.where(known, cycle, -1),
        1 / np.diff(edges[n]),
        (reference.name, other.name),
    )


def _boundaries_s(run: LiquidSignals) -> FloatArray:
    return measured_phase(run.acceleration_m_per_s2, None, run.sampling_rate_hz).cycle_boundaries_s()


def _shift(edges: FloatArray, others: FloatArray) -> int:
    """What to add to the number of a cycle to get that of the other run nearest in time."""
    middle = edges.size // 2
    return int(np.abs(others - edges[middle]).argmin()) - middle


def _alike(
    reference: LiquidSignals, other: LiquidSignals, edges: FloatArray, others: FloatArray
) -> NDArray[np.bool_]:
    """Whether cycles have the same frequency and the same speed, half the difference of its extremes."""
    frequency = np.abs(np.diff(edges) / np.diff(others) - 1) < FREQUENCY_TOLERANCE
    speed, of_other = _speeds(reference, edges), _speeds(other, others)
    return np.asarray(frequency & (np.abs(of_other / np.maximum(speed, 1e-12) - 1) < SPEED_TOLERANCE))


def _speeds(run: LiquidSignals, edges: FloatArray) -> FloatArray:
    place = np.clip(np.rint(edges * run.sampling_rate_hz).astype(int), 0, run.velocity_m_per_s.size - 1)
    highest = np.maximum.reduceat(run.velocity_m_per_s, place)[:-1]
    lowest = np.minimum.reduceat(run.velocity_m_per_s, place)[:-1]
    return np.asarray(0.5 * (highest - lowest))


def _not_repeats(reference: LiquidSignals, other: LiquidSignals, got: str) -> AnalysisError:
    return AnalysisError(
        f"{reference.name} and {other.name}",
        got=got,
        allowed="repeats of one motion",
        remedy="compare runs of one law",
    )
