"""Repeated releases of one structure, pooled over the amplitude of acceleration.

A chaotic liquid never decays twice alike: the scatter between repeats, not the noise of one record, is what a
second laboratory would see. Each repeat is averaged within bins of amplitude, then the repeats are averaged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student_t

from sloshlab.errors import AnalysisError
from sloshlab.modal.instantaneous_damping import CONFIDENCE, InstantaneousDamping

FloatArray = npt.NDArray[np.float64]

BINS_PER_DECADE: Final = 8


@dataclass(frozen=True)
class PooledDamping:
    """Damping and frequency against amplitude over several repeats.

    Attributes
    ----------
    acceleration_amplitude_m_per_s2 : ndarray, shape (n_bins,)
        Geometric middles of the bins that at least one repeat has values in, rising.
    damping_ratio, frequency_hz : ndarray, shape (n_bins,)
        Mean over the repeats of their means within the bin.
    damping_ratio_std, frequency_hz_std : ndarray, shape (n_bins,)
        Standard deviation from repeat to repeat; NaN with one repeat.
    n_repeats : ndarray of int, shape (n_bins,)
        Repeats with values in the bin.
    """

    acceleration_amplitude_m_per_s2: FloatArray
    damping_ratio: FloatArray
    damping_ratio_std: FloatArray
    frequency_hz: FloatArray
    frequency_hz_std: FloatArray
    n_repeats: npt.NDArray[np.int64]

    @property
    def damping_ratio_interval(self) -> FloatArray:
        """Ends of the 90 % intervals of the mean ζ over repeats (Student), shape (2, n_bins)."""
        return self._interval(self.damping_ratio, self.damping_ratio_std)

    @property
    def frequency_interval_hz(self) -> FloatArray:
        """Ends of the 90 % intervals of the mean frequency over repeats [Hz], shape (2, n_bins)."""
        return self._interval(self.frequency_hz, self.frequency_hz_std)

    def _interval(self, mean: FloatArray, std: FloatArray) -> FloatArray:
        # a single repeat has no scatter: NaN goes through
        n = np.maximum(self.n_repeats, 2)
        half = student_t.ppf(0.5 + CONFIDENCE / 2, n - 1) * std / np.sqrt(n)
        return np.stack([mean - half, mean + half])


def pooled_damping(
    readings: Sequence[InstantaneousDamping], *, bins_per_decade: int = BINS_PER_DECADE
) -> PooledDamping:
    """Pool readings of repeated decays by one method.

    Parameters
    ----------
    readings : sequence of InstantaneousDamping
        One per repeat; only values that are trusted are used, weighted by 1/std² within a repeat.
    bins_per_decade : int
        Bins of the logarithm of the amplitude.

    Returns
    -------
    PooledDamping

    Raises
    ------
    AnalysisError
        If no repeat has a value that may be used.
    """
    used = [
        (
            np.round(bins_per_decade * np.log10(reading.acceleration_amplitude_m_per_s2[reading.used])).astype(
                np.int64
            ),
            reading.damping_ratio[reading.used],
            reading.damping_ratio_std[reading.used],
            reading.frequency_hz[reading.used],
            reading.frequency_hz_std[reading.used],
        )
        for reading in readings
    ]
    # bins of the logarithm: a decay passes amplitudes at a constant ratio per cycle
    bins = np.unique(np.concatenate([part[0] for part in used])) if used else np.array([], dtype=np.int64)
    if not bins.size:
        raise AnalysisError(
            "pooled decays", got=f"{len(readings)} decays without a value that may be used", allowed="at least one"
        )
    # first within each repeat, then over repeats: values of one release share its liquid and are not independent
    damping = np.array([_bin_means(bins, index, value, std) for index, value, std, _, _ in used])
    frequency = np.array([_bin_means(bins, index, value, std) for index, _, _, value, std in used])
    return PooledDamping(
        acceleration_amplitude_m_per_s2=10.0 ** (bins / bins_per_decade),
        damping_ratio=np.nanmean(damping, axis=0),
        damping_ratio_std=_scatter(damping),
        frequency_hz=np.nanmean(frequency, axis=0),
        frequency_hz_std=_scatter(frequency),
        n_repeats=np.isfinite(damping).sum(axis=0),
    )


def mean_at_common_amplitudes(a: InstantaneousDamping, b: InstantaneousDamping) -> tuple[float, float]:
    """Mean ζ of two decays over the bins of the first that lie within the amplitudes of the second.

    The second is interpolated over the logarithm of the amplitude; NaN where they have no amplitude in common.
    """
    first, second = pooled_damping([a]), pooled_damping([b])
    at, known = (np.log(pooled.acceleration_amplitude_m_per_s2) for pooled in (first, second))
    common = (at >= known.min()) & (at <= known.max())
    if not common.any():
        return float("nan"), float("nan")
    of_second = np.interp(at[common], known, second.damping_ratio)
    return float(first.damping_ratio[common].mean()), float(of_second.mean())


@dataclass(frozen=True)
class DampingDeviation:
    """A model's ζ beside the mean of repeated measurements, at common amplitudes.

    Attributes
    ----------
    amplitude_m_per_s2, measured, model : ndarray, shape (n_amplitudes,)
        Amplitudes, rising, and ζ at each.
    is_known : ndarray of bool, shape (n_amplitudes,)
        Where the repeats agree well enough with each other.
    """

    amplitude_m_per_s2: FloatArray
    measured: FloatArray
    model: FloatArray
    is_known: npt.NDArray[np.bool_]

    @property
    def relative(self) -> FloatArray:
        """Relative deviation of the model's ζ, shape (n_amplitudes,)."""
        return np.asarray(self.model / self.measured - 1.0)

    @property
    def largest(self) -> float:
        """Largest relative deviation without its sign, where ζ is known; NaN if nowhere."""
        known = self.relative[self.is_known]
        return float(np.abs(known).max()) if known.size else float("nan")

    @property
    def rms(self) -> float:
        """Root of the mean square of the relative deviation, where ζ is known; NaN if nowhere."""
        known = self.relative[self.is_known]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def damping_deviation(
    measured: PooledDamping, model: PooledDamping, *, fewest_repeats: int, largest_scatter: float
) -> DampingDeviation | None:
    """Compare where both have values, the model's ζ taken as linear in the logarithm of the amplitude.

    Parameters
    ----------
    measured, model : PooledDamping
    fewest_repeats : int
        Of the measurement, at an amplitude that is compared.
    largest_scatter : float
        Half a 90 % interval of the measured mean over ζ, up to which ζ counts as known.

    Returns
    -------
    DampingDeviation or None
        None without a common amplitude.
    """
    half = 0.5 * np.diff(measured.damping_ratio_interval, axis=0)[0] / np.abs(measured.damping_ratio)
    amplitude, own = measured.acceleration_amplitude_m_per_s2, model.acceleration_amplitude_m_per_s2
    inside = (amplitude >= own.min()) & (amplitude <= own.max() * (1 + 1e-9))
    inside &= measured.n_repeats >= fewest_repeats
    if not inside.any():
        return None
    modelled = np.interp(np.log(amplitude[inside]), np.log(own), model.damping_ratio)
    known = half[inside] <= largest_scatter
    return DampingDeviation(amplitude[inside], measured.damping_ratio[inside], modelled, known)


def _bin_means(
    bins: npt.NDArray[np.int64], index: npt.NDArray[np.int64], value: FloatArray, std: FloatArray
) -> FloatArray:
    """Weighted mean per bin, NaN where a repeat has no value."""
    # one value with next to no error must not decide its bin alone
    floor = max(1e-3 * float(np.median(std)), 1e-12) if std.size else 1.0
    weight = 1 / np.maximum(std, floor) ** 2
    place = np.searchsorted(bins, index)
    total = np.bincount(place, weight, bins.size)
    summed = np.bincount(place, weight * value, bins.size)
    return np.asarray(np.where(total > 0, summed / np.where(total > 0, total, 1.0), np.nan))


def _scatter(values: FloatArray) -> FloatArray:
    """Standard deviation over the repeats, NaN with fewer than two."""
    n = np.isfinite(values).sum(axis=0)
    mean = np.nanmean(values, axis=0)
    squares = np.nansum((values - mean) ** 2, axis=0)
    return np.asarray(np.where(n > 1, np.sqrt(squares / np.maximum(n - 1, 1)), np.nan))
