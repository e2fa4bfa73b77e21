"""A free decay read three ways: logarithmic decrement, envelope and local sine fit, all shown.

Stages: release found, signal from there on, local sine fit (which also measures the noise), envelope, decrement;
what overlaps the release transient is marked.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.errors import AnalysisError
from sloshlab.modal.envelope import envelope
from sloshlab.modal.instantaneous_damping import InstantaneousDamping, Trust
from sloshlab.modal.local_sine_fit import DecayNoise, local_sine_fit
from sloshlab.modal.log_decrement import log_decrement
from sloshlab.modal.release import Release, find_release

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FreeDecay:
    """Three readings of one free decay.

    Attributes
    ----------
    release : Release
        Where the decay begins and its transient ends.
    log_decrement, envelope, local_sine_fit : InstantaneousDamping
        Times count from the first sample of the record.
    noise : DecayNoise
        What the sine fits leave, in the units of the signal.
    """

    release: Release
    log_decrement: InstantaneousDamping
    envelope: InstantaneousDamping
    local_sine_fit: InstantaneousDamping
    noise: DecayNoise

    @property
    def readings(self) -> tuple[InstantaneousDamping, ...]:
        """The three readings."""
        return (self.log_decrement, self.envelope, self.local_sine_fit)

    def to_dataset(self) -> dict[str, xr.Dataset]:
        """One data set per method, by the method's name; their times differ."""
        return {reading.method: reading.to_dataset() for reading in self.readings}


def analyse_free_decay(
    signal: FloatArray,
    sampling_rate_hz: float,
    *,
    frequency_range_hz: tuple[float, float] | None = None,
    n_cycles: int = 4,
    motion: Literal["acceleration", "displacement"] = "acceleration",
    filter_edge_s: float = 0.0,
) -> FreeDecay:
    """Instantaneous damping and frequency of a free decay by three methods.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        One modal coordinate or a channel in which one mode rules; acceleration [m/s²] or displacement [m].
    sampling_rate_hz : float
        Samples per second.
    frequency_range_hz : tuple of float, optional
        Where the mode is looked for; default: the largest line.
    n_cycles : int
        Cycles per stretch of the envelope and of the sine fit, at least 2; the decrement is taken from peak to
        peak. Longer stretches have shorter intervals and blur what changes with amplitude.
    motion : {"acceleration", "displacement"}
        What the signal is; amplitudes of displacement are turned into acceleration with (2πf)².
    filter_edge_s : float
        How far from the ends of the record a filter that the signal went through is felt; what reaches there is
        marked as edge.

    Returns
    -------
    FreeDecay

    Raises
    ------
    AnalysisError
        If the amplitude does not fall, the frequency lies outside the range, or there are gaps or too few cycles.
    """
    if not (np.isfinite(sampling_rate_hz) and sampling_rate_hz > 0) or n_cycles < 2:
        raise AnalysisError(
            "free decay",
            got=f"sampling rate {sampling_rate_hz} Hz, {n_cycles} cycles per stretch",
            allowed="a rate above 0, at least 2 cycles",
        )
    release = find_release(signal, sampling_rate_hz, frequency_range_hz=frequency_range_hz)
    first, last = (round(at * sampling_rate_hz) for at in (release.release_s, release.rest_s))
    # to the end of the motion only: what dry friction holds has no extrema and no phase
    part = np.asarray(signal, dtype=np.float64)[first : last + 1]
    frequency = release.frequency_hz
    # first, because it measures the noise that the other two readings use
    by_fit, noise = local_sine_fit(part, sampling_rate_hz, frequency_hz=frequency, n_cycles=n_cycles)
    # judged by the sine fit, whose stretches do not overlap: its errors are independent
    _refuse_without_decay(by_fit)
    _refuse_other_frequency(by_fit, frequency_range_hz)
    by_envelope = envelope(part, sampling_rate_hz, frequency_hz=frequency, noise=noise, n_cycles=n_cycles)
    by_peaks = log_decrement(part, sampling_rate_hz, frequency_hz=frequency, noise=noise)
    # how far a value looks to each side; a decrement is read from peak to peak
    half_s = 0.5 * n_cycles / frequency
    n_edge = round(filter_edge_s * sampling_rate_hz)
    inner = n_edge / sampling_rate_hz, (np.size(signal) - 1 - n_edge) / sampling_rate_hz
    readings = [
        _completed(reading, release, reach, motion, inner)
        for reading, reach in ((by_peaks, 0.5 / frequency), (by_envelope, half_s), (by_fit, half_s))
    ]
    shifted = dataclasses.replace(noise, time_s=noise.time_s + release.release_s)
    return FreeDecay(release, readings[0], readings[1], readings[2], shifted)


def _completed(
    reading: InstantaneousDamping,
    release: Release,
    reach_s: float,
    motion: str,
    inner_s: tuple[float, float],
) -> InstantaneousDamping:
    """Times from the record's first sample, amplitudes of acceleration, values in the transient marked."""
    time = reading.time_s + release.release_s
    amplitude = reading.acceleration_amplitude_m_per_s2
    if motion == "displacement":
        amplitude = amplitude * (2 * np.pi * reading.frequency_hz) ** 2
    # a stretch that begins within the transient is marked, not only one whose middle lies there
    in_transient = time - reach_s < release.transient_end_s - 1e-9
    in_transient &= release.transient_end_s > release.release_s
    trust = reading.trust
    if inner_s[0] > 0:
        at_edge = (time - reach_s < inner_s[0]) | (time + reach_s > inner_s[1])
        trust = np.where(at_edge & reading.used, str(Trust.EDGE), trust)
    return dataclasses.replace(
        reading,
        time_s=time,
        acceleration_amplitude_m_per_s2=amplitude,
        # values are marked and never dropped
        trust=np.where(in_transient, str(Trust.RELEASE), trust),
    )


def _refuse_without_decay(reading: InstantaneousDamping) -> None:
    """A decay falls: the weighted mean of ζ is above zero by more than its interval."""
    clear = reading.used
    amplitude = reading.acceleration_amplitude_m_per_s2
    if clear.sum() >= 1:
        weight = 1 / np.maximum(reading.damping_ratio_std[clear], 1e-12) ** 2
        mean = float((weight * reading.damping_ratio[clear]).sum() / weight.sum())
        if mean > reading.coverage_factor[0] / np.sqrt(weight.sum()):
            return
    raise AnalysisError(
        "free decay",
        got=f"an amplitude of {amplitude[0]:.4g} at the beginning and {amplitude[-1]:.4g} at the end",
        allowed="an amplitude that falls",
        remedy="check that nothing drives the structure, and the mode's frequency range",
    )


def _refuse_other_frequency(reading: InstantaneousDamping, frequency_range_hz: tuple[float, float] | None) -> None:
    """Where a mode is not excited lies the foot of another one, to whose frequency the fit converges."""
    low, high = frequency_range_hz or (0.0, np.inf)
    # the median, as single stretches may have followed another mode
    seen = float(np.median(reading.frequency_hz[reading.used]))
    if not low <= seen <= high:
        raise AnalysisError(
            "free decay",
            got=f"{seen:.4g} Hz",
            allowed=f"{low:.4g} … {high:.4g} Hz, where the mode is looked for",
            remedy="check the frequencies that the rig states, or the mode's frequency range",
        )
