"""Cross spectra of channels around the dominant frequency, block by block.

Each channel is averaged down to some hundred samples per second, cut into blocks, Hann-windowed and
transformed. Every step is linear and the same for all channels, so that ratios of spectra are those
of the signals; noise counts only with the few lines around the dominant frequency. With the
time dependence e^{+jωt} a channel that comes τ later than the reference has the phase −ωτ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.conditioning.gaps import require_channels, sampling_step_s
from sloshlab.errors import AnalysisError
from sloshlab.out_of_core import blocks

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

# more than twice the highest frequency that is looked for
_LOWEST_RATE_HZ = 400.0
_BLOCK_S = 1.0
_BLOCKS_AT_ONCE = 16
"""Whose spectra are in memory together."""
_LINES_BESIDE = 2
"""To each side of the largest line: a Hann window spreads a sine over so many."""
_FEWEST_SAMPLES_PER_BLOCK = 32


@dataclass(frozen=True)
class BlockSpectra:
    """Spectra of one or more channels against a reference x, per block.

    Attributes
    ----------
    names : tuple of str
        The channels y.
    middle_s : ndarray, shape (n_blocks,)
        Middles of the blocks, from the first sample.
    omega_rad_per_s : ndarray, shape (n_blocks,)
        Power-weighted mean frequency of the lines used.
    power : ndarray, shape (n_blocks,)
        Σ|X|² over the lines used, in (units of x)², common scale.
    cross : ndarray, shape (n_names, n_blocks), complex
        Σ Y X*; y = G x(t − τ) gives G e^{−jωτ} Σ|X|².
    own_power : ndarray, shape (n_names, n_blocks)
        Σ|Y|².
    """

    names: tuple[str, ...]
    middle_s: FloatArray
    omega_rad_per_s: FloatArray
    power: FloatArray
    cross: ComplexArray
    own_power: FloatArray

    def ratio(self, index: int, delay_s: float) -> float:
        """Real factor G of y = G x(t − τ) over all blocks, its sign kept; NaN without signal."""
        # the delay is turned back first: the real part of a turned phasor would be short by cos ωτ
        aligned = (self.cross[index] * np.exp(1j * self.omega_rad_per_s * delay_s)).real
        power = float(self.power.sum())
        return float(aligned.sum()) / power if power > 0 else float("nan")

    def ratio_std(self, index: int, delay_s: float) -> float:
        """Standard deviation of `ratio` from the scatter of the blocks; NaN with a single block."""
        if self.power.size < 2:
            return float("nan")
        aligned = (self.cross[index] * np.exp(1j * self.omega_rad_per_s * delay_s)).real
        # blocks are taken as independent; their scatter contains noise and whatever differs along the run
        residual = aligned - self.ratio(index, delay_s) * self.power
        return float(np.sqrt((residual**2).sum()) / self.power.sum())


def block_spectra(
    recording: xr.Dataset,
    names: Sequence[str],
    reference: FloatArray,
    *,
    frequency_range_hz: tuple[float, float] = (1.0, 150.0),
) -> BlockSpectra:
    """Spectra of channels against a reference around the reference's dominant frequency.

    Parameters
    ----------
    recording : xarray.Dataset
        Holds the channels.
    names : sequence of str
        Channels y.
    reference : ndarray, shape (n_samples,)
        The signal x, for example one acceleration, NaN where lost.
    frequency_range_hz : tuple of float
        Where the dominant frequency is sought.

    Returns
    -------
    BlockSpectra
        Blocks of one second (shorter in recordings of less than eight seconds) in which no sample is lost.

    Raises
    ------
    AnalysisError
        If no block is free of lost samples, or the recording is too short.
    """
    require_channels(recording, names)
    step_s = sampling_step_s(recording)
    duration_s = step_s * reference.size
    factor = max(1, int(1.0 / (step_s * _LOWEST_RATE_HZ)))
    # at least eight blocks, or their scatter says nothing
    per_block = round(min(_BLOCK_S, duration_s / 8) / (step_s * factor))
    if per_block < _FEWEST_SAMPLES_PER_BLOCK:
        raise AnalysisError(
            "length of the recording",
            got=f"{duration_s:.3g} s at {1 / step_s:.6g} Hz",
            allowed=f"≥ {8 * _FEWEST_SAMPLES_PER_BLOCK * factor * step_s:.3g} s",
            remedy="record longer",
        )
    signals = [reference, *(recording[name].values for name in names)]
    line_hz = 1.0 / (per_block * factor * step_s)
    n_of_block = per_block * factor
    n = reference.size // n_of_block * n_of_block
    parts = []
    for part in blocks(n, *signals, of=_BLOCKS_AT_ONCE * n_of_block):
        spectra = np.stack([_spectra(signal[part], factor, per_block) for signal in signals])
        parts.append(_part(spectra, line_hz, frequency_range_hz))
    whole = np.concatenate([part.whole for part in parts]) if parts else np.zeros(0, dtype=np.bool_)
    if not whole.any():
        raise AnalysisError(
            f"channels {', '.join(names)}",
            got="lost samples in every block",
            allowed=f"at least {per_block * factor * step_s:.3g} s without a lost sample",
            remedy="record again",
        )
    return BlockSpectra(
        names=tuple(names),
        middle_s=np.asarray((np.flatnonzero(whole) + 0.5) / line_hz, dtype=np.float64),
        omega_rad_per_s=np.concatenate([part.omega_rad_per_s for part in parts]),
        power=np.concatenate([part.power for part in parts]),
        cross=np.concatenate([part.cross for part in parts], axis=1),
        own_power=np.concatenate([part.own_power for part in parts], axis=1),
    )


class _Part(NamedTuple):
    """Some blocks in a row: which are whole, and the results of these."""

    whole: BoolArray
    omega_rad_per_s: FloatArray
    power: FloatArray
    cross: ComplexArray
    own_power: FloatArray


def _part(spectra: ComplexArray, line_hz: float, frequency_range_hz: tuple[float, float]) -> _Part:
    """From spectra of the reference and of the channels, shape (1 + n_names, n_blocks, n_lines)."""
    # a block with a lost sample in any channel is left out for all, so that ratios compare the same motion
    whole = np.asarray(np.isfinite(spectra).all(axis=(0, 2)))
    spectra = spectra[:, whole]
    lines = _lines_around_maximum(spectra[0], line_hz, frequency_range_hz)
    # the same lines in all channels, those of the reference
    x, *others = (np.take_along_axis(spectrum, lines, axis=1) for spectrum in spectra)
    x_power = np.abs(x) ** 2
    power = x_power.sum(axis=1)
    weighted = (x_power * lines).sum(axis=1)
    mean_line = np.divide(weighted, power, out=np.zeros_like(power), where=power > 0)
    shape = (len(others), power.size)
    return _Part(
        whole=whole,
        omega_rad_per_s=2 * np.pi * line_hz * mean_line,
        power=power,
        cross=np.array([(y * x.conj()).sum(axis=1) for y in others], dtype=np.complex128).reshape(shape),
        own_power=np.array([(np.abs(y) ** 2).sum(axis=1) for y in others], dtype=np.float64).reshape(shape),
    )


def delay_s(spectra: BlockSpectra, index: int) -> tuple[float, float]:
    """Delay of channel `index` behind the reference and its standard deviation [s].

    Least squares of the phases −ωτ over the blocks, weighted by the reference's power, after the
    common sign is taken off. Unambiguous below half a period of the highest frequency.

    Returns
    -------
    tuple of float
        τ (positive: the channel comes later than the reference) and its standard deviation from the scatter of
        the blocks (NaN with a single block).
    """
    cross, omega, weight = spectra.cross[index], spectra.omega_rad_per_s, spectra.power
    # a sensor mounted upside down is half a period off at every frequency, which is no delay
    sign = 1.0 if cross.real.sum() >= 0 else -1.0
    lag = -np.angle(sign * cross)
    # a phase tells the delay in proportion to its frequency
    moment = float((weight * omega**2).sum())
    if moment <= 0:
        return float("nan"), float("nan")
    delay = float((weight * omega * lag).sum() / moment)
    if omega.size < 2:
        return delay, float("nan")
    residual = lag - omega * delay
    return delay, float(np.sqrt(((weight * omega * residual) ** 2).sum()) / moment)


def _spectra(values: npt.NDArray[np.floating], factor: int, per_block: int) -> ComplexArray:
    """Hann-windowed spectra of the averaged-down signal, shape (n_blocks, n_lines)."""
    n_blocks = values.size // (factor * per_block)
    coarse = np.empty(n_blocks * per_block)
    _averaged(values, factor, coarse)
    blocks = coarse.reshape(n_blocks, per_block)
    # static weight and offsets would leak into the lowest lines
    blocks -= blocks.mean(axis=1, keepdims=True)
    # periodic, so that a whole number of periods falls on three lines exactly
    window = np.hanning(per_block + 1)[:-1]
    return np.asarray(np.fft.rfft(blocks * window, axis=1), dtype=np.complex128)


def _lines_around_maximum(
    spectra: ComplexArray, line_hz: float, frequency_range_hz: tuple[float, float]
) -> npt.NDArray[np.int64]:
    """Per block the largest line in the range and its neighbours, shape (n_blocks, 5)."""
    n_lines = spectra.shape[1]
    low = max(1, round(frequency_range_hz[0] / line_hz))
    high = min(n_lines - _LINES_BESIDE - 1, round(frequency_range_hz[1] / line_hz))
    largest = low + np.abs(spectra[:, low : high + 1]).argmax(axis=1)
    beside = np.arange(-_LINES_BESIDE, _LINES_BESIDE + 1)
    return np.asarray(np.clip(largest[:, None] + beside, 0, n_lines - 1), dtype=np.int64)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _averaged(values: npt.NDArray[np.float64], factor: int, coarse: FloatArray) -> None:
    """Means of `factor` samples in a row; NaN where one of them is."""
    for block in range(coarse.size):
        # a plain sum hands NaN on, and a block mean has no phase error against that of another channel
        total = 0.0
        for i in range(block * factor, (block + 1) * factor):
            total += values[i]
        coarse[block] = total / factor
