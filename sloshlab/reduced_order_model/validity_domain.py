"""Domain of validity of a model: frequencies and speeds of its training runs, and when a motion leaves them.

A cycle runs from one rise of the velocity through zero to the next. It has a frequency and a speed, half the
difference of its extremes; ū, and the acceleration in g, follow from both for motion of one frequency.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError

FloatArray = NDArray[np.float64]
BINS_PER_OCTAVE: Final = 6
MARGIN: Final = 1.1
"""A cycle may be a tenth weaker or stronger than those of the training."""
_QUIET: Final = 1e-3
"""Crossings count where the velocity has been beyond this share of its largest value in between."""


@dataclass(frozen=True)
class MotionCycles:
    """Cycles of a motion; arrays of shape (n_cycles,).

    Attributes
    ----------
    start_s, frequency_hz, speed_m_per_s : ndarray
    """

    start_s: FloatArray
    frequency_hz: FloatArray
    speed_m_per_s: FloatArray

    @property
    def acceleration_g(self) -> FloatArray:
        """v Ω/g."""
        return self.speed_m_per_s * 2 * math.pi * self.frequency_hz / GRAVITY_M_PER_S2


def motion_cycles(velocity_m_per_s: ArrayLike, sampling_rate_hz: float) -> MotionCycles:
    """Return the cycles of a motion; none across a gap.

    Parameters
    ----------
    velocity_m_per_s : array_like, shape (n,)
        NaN where not known.
    sampling_rate_hz : float

    Examples
    --------
    >>> time = np.arange(1000) / 1000
    >>> cycles = motion_cycles(0.3 * np.sin(2 * np.pi * 10 * time - 1), 1000.0)
    >>> cycles.frequency_hz.round(3).tolist()[:2], cycles.speed_m_per_s.round(3).tolist()[:2]
    ([10.0, 10.0], [0.3, 0.3])
    """
    velocity = np.asarray(velocity_m_per_s, np.float64)
    known = np.nan_to_num(velocity)
    # noise about zero would make cycles of a sample or two
    quiet = _QUIET * float(np.max(np.abs(known), initial=0.0))
    state = np.where(known > quiet, 1, np.where(known < -quiet, -1, 0))
    marked = np.flatnonzero(state)
    rises = np.flatnonzero((state[marked[1:]] == 1) & (state[marked[:-1]] == -1))
    before, after = marked[rises], marked[rises + 1]
    # a rise may take several samples near zero; a straight line through its ends places it
    place = before - known[before] * (after - before) / (known[after] - known[before])
    if place.size < 2:
        return MotionCycles(*(np.zeros(0) for _ in range(3)))
    edges = after
    top = np.maximum.reduceat(known, edges)[:-1]
    bottom = np.minimum.reduceat(known, edges)[:-1]
    # a cycle with a gap has unknown extremes
    lost = np.add.reduceat(np.isnan(velocity).astype(int), edges)[:-1] > 0
    cycles = MotionCycles(place[:-1] / sampling_rate_hz, sampling_rate_hz / np.diff(place), 0.5 * (top - bottom))
    return MotionCycles(*(values[~lost] for values in vars(cycles).values()))


@dataclass(frozen=True)
class Excursion:
    """A stretch of a motion that the training never saw.

    Attributes
    ----------
    start_s, stop_s : float
    reason : str
        ``frequency``, ``too weak`` or ``too strong``.
    frequency_hz, speed_m_per_s : float
        Of the cycle that is farthest out.
    """

    start_s: float
    stop_s: float
    reason: str
    frequency_hz: float
    speed_m_per_s: float


@dataclass(frozen=True)
class ValidityDomain:
    """Weakest and strongest cycle of the training at each frequency.

    Attributes
    ----------
    first_bin : int
        Bin k holds frequencies 2^(k/6) … 2^((k+1)/6) Hz.
    weakest_m_per_s, strongest_m_per_s : tuple of float
        Of the bins from the first on; NaN where nothing was seen.
    """

    first_bin: int
    weakest_m_per_s: tuple[float, ...]
    strongest_m_per_s: tuple[float, ...]

    @classmethod
    def of(cls, motions: Sequence[MotionCycles]) -> ValidityDomain:
        """Return the domain of some training motions.

        Raises
        ------
        AnalysisError
            If there is not one cycle.
        """
        frequency = np.concatenate([motion.frequency_hz for motion in motions] or [np.zeros(0)])
        speed = np.concatenate([motion.speed_m_per_s for motion in motions] or [np.zeros(0)])
        if not frequency.size:
            raise AnalysisError("training runs", got="not one cycle", remedy="train on runs that move")
        bins = _bins(frequency)
        first, last = int(bins.min()), int(bins.max())
        inside = [speed[bins == k] for k in range(first, last + 1)]
        return cls(
            first,
            tuple(float(speeds.min()) if speeds.size else math.nan for speeds in inside),
            tuple(float(speeds.max()) if speeds.size else math.nan for speeds in inside),
        )

    def facts(self) -> dict[str, Any]:
        """Return what `of_facts` makes it again from; None stands where nothing was seen."""
        return {
            "first_bin": self.first_bin,
            **{
                name: [None if math.isnan(v) else v for v in getattr(self, name)]
                for name in ("weakest_m_per_s", "strongest_m_per_s")
            },
        }

    @classmethod
    def of_facts(cls, facts: Mapping[str, Any]) -> ValidityDomain:
        """Make a domain of what `facts` gave."""
        limits = (
            tuple(math.nan if v is None else float(v) for v in facts[name])
            for name in ("weakest_m_per_s", "strongest_m_per_s")
        )
        return cls(int(facts["first_bin"]), *limits)

    def excursions(self, cycles: MotionCycles) -> list[Excursion]:
        """Return the stretches of a motion outside, in their order.

        Parameters
        ----------
        cycles : MotionCycles
        """
        reasons, depth = self._judged(cycles)
        changes = np.flatnonzero(reasons[1:] != reasons[:-1]) + 1
        found = []
        for part in np.split(np.arange(reasons.size), changes):
            if part.size and reasons[part[0]]:
                worst = part[int(np.argmax(depth[part]))]
                found.append(
                    Excursion(
                        float(cycles.start_s[part[0]]),
                        float(cycles.start_s[part[-1]] + 1 / cycles.frequency_hz[part[-1]]),
                        str(reasons[part[0]]),
                        float(cycles.frequency_hz[worst]),
                        float(cycles.speed_m_per_s[worst]),
                    )
                )
        return found

    def _judged(self, cycles: MotionCycles) -> tuple[NDArray[np.str_], FloatArray]:
        """Why each cycle is outside, empty if it is not, and how far."""
        place = _bins(cycles.frequency_hz) - self.first_bin
        n = len(self.weakest_m_per_s)
        seen = (place >= 0) & (place < n)
        place = np.clip(place, 0, n - 1)
        weakest, strongest = (np.array(v)[place] for v in (self.weakest_m_per_s, self.strongest_m_per_s))
        seen &= np.isfinite(weakest)
        above = cycles.speed_m_per_s / (strongest * MARGIN)
        below = weakest / np.maximum(cycles.speed_m_per_s * MARGIN, 1e-300)
        reasons = np.where(above > 1, "too strong", np.where(below > 1, "too weak", ""))
        # judged last: where no training had this frequency, weak and strong have no meaning
        reasons = np.where(seen, reasons, "frequency")
        return reasons, np.where(seen, np.maximum(above, below), cycles.speed_m_per_s)


def _bins(frequency_hz: FloatArray) -> NDArray[np.int64]:
    octaves = np.log2(np.maximum(frequency_hz, 1e-6))
    return np.asarray(np.floor(BINS_PER_OCTAVE * octaves), np.int64)
