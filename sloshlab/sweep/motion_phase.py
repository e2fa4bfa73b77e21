"""What a sweep did: the phase of the measured motion.

The phase φ is that of the fundamental of the tank's acceleration, ü = a₀ cos φ. It is found in
three steps, none of which needs the sweep law: the dominant frequency of short blocks; complex
demodulation about it over two cycles, which rejects the mean and the harmonics, but of a
subharmonic leaves half; a cubic spline through the demodulated phases. Demodulation is symmetric
in time and therefore has no delay.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.fft import next_fast_len
from scipy.interpolate import CubicSpline

from sloshlab.errors import AnalysisError
from sloshlab.out_of_core import BLOCK_SAMPLES, blocks, empty, release

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# 50 samples per cycle at 20 Hz.
_DEMODULATION_RATE_HZ = 1000.0
"""The motion is averaged down to about this rate before its phase is taken."""
_KNOTS_PER_CYCLE = 1.0
_CYCLES_PER_BLOCK = 8.0
"""Of the spectra that tell the frequency to begin with."""
_BLOCKS_AT_ONCE = 16
"""Blocks overlap by half and are padded to four times their length: those of a long recording come in portions."""
_KNOTS_AT_ONCE = 4096
"""Some minutes of motion."""
_STRONG_LINE = 0.4
"""The fundamental has at least this part of the largest line of a block."""
_LOBE_LINES = 13
"""Lines from the foot of a line to beyond its top, under a Hann window padded to four times its length."""
# The spectrum of a Hann window of two cycles is zero at the distance of the mean and of all harmonics from Ω.
_WINDOW_CYCLES = 2.0
_SMALLEST_RELATIVE_AMPLITUDE = 2e-3
_SMALLEST_SHARE_OF_POWER = 0.1
"""Where the fundamental has less of the power than this, there is noise and no motion."""
_LARGEST_PHASE_JUMP_RAD = 0.7


@dataclass(frozen=True)
class MotionPhase:
    """Phase of the measured motion, ü = a₀ cos φ.

    Attributes
    ----------
    phase : scipy.interpolate.CubicSpline
        φ(t) [rad].
    moving : ndarray of bool, shape (n_knots,)
        Where the motion has a coherent phase; between two knots that have not, there is no sweep.
    knot_s, amplitude : ndarray, shape (n_knots,)
        Times [s] and amplitudes of the fundamental in the units of the motion.
    """

    phase: CubicSpline
    knot_s: FloatArray
    amplitude: FloatArray
    moving: BoolArray

    def moving_interval_s(self) -> tuple[float, float]:
        """First and last time with motion [s]."""
        at = np.flatnonzero(self.moving)
        return float(self.knot_s[at[0]]), float(self.knot_s[at[-1]])

    def cycle_boundaries_s(self) -> FloatArray:
        """Times with φ = 2πn within the interval that moves [s].

        Raises
        ------
        AnalysisError
            If the phase does not increase, which means that no sweep was recorded.
        """
        start, stop = self.moving_interval_s()
        # the spline is not monotonic where the motion is lost for a moment: boundaries start from what rises
        fine = np.unique(np.concatenate([self.knot_s[(self.knot_s >= start) & (self.knot_s <= stop)]]))
        cycles = self.phase(fine) / (2 * np.pi)
        rising = np.concatenate([[True], np.diff(np.maximum.accumulate(cycles)) > 0])
        fine, cycles = fine[rising], cycles[rising]
        n = np.arange(np.ceil(cycles[0]), np.floor(cycles[-1]) + 1)
        times = np.interp(n, cycles, fine)
        frequency = self.phase.derivative()
        # Newton's method on the spline. Linear interpolation between knots alone would miss by the chirp within
        # a cycle. An error δ of a boundary changes the work in δ² only, because the velocity is zero there.
        for _ in range(4):
            times = times - (self.phase(times) - 2 * np.pi * n) / np.maximum(frequency(times), 1e-9)
        times = times[(times >= start) & (times <= stop)]
        if times.size < 3 or not (np.diff(times) > 0).all():
            raise AnalysisError(
                "motion phase",
                got="a motion without a dominant frequency",
                allowed="a harmonic motion whose frequency changes slowly",
                remedy="check that the channel is the tank's motion",
            )
        return np.asarray(times)


def measured_phase(
    motion: FloatArray, usable: BoolArray | None, sampling_rate_hz: float, *, lead_rad: float = 0.0
) -> MotionPhase:
    """Phase of the fundamental of a measured motion.

    Parameters
    ----------
    motion : ndarray, shape (n,)
        Acceleration or velocity of the tank; NaN where lost.
    usable : ndarray of bool, shape (n,), optional
        False where a sample must not be used; None means all that are finite.
    sampling_rate_hz : float
        Sampling rate [Hz].
    lead_rad : float
        Phase by which the acceleration leads the given motion: 0 for an acceleration, π/2 for a
        velocity.

    Returns
    -------
    MotionPhase
        With times counted from the first sample [s].

    Raises
    ------
    AnalysisError
        If there is no motion, or too little of it.
    """
    # times below are those of block means; the offset to the samples is added once, at the end
    decimated, weight, rate_hz, offset_s = _averaged_down(motion, usable, sampling_rate_hz)
    knots, frequency = _dominant_frequency(decimated, weight, rate_hz)
    times, phase = _phase_knots(knots, frequency, decimated.size / rate_hz)
    amplitude = np.empty(0)
    moving = np.empty(0, dtype=np.bool_)
    # Three rounds: a phase that the spline has wrong turns within the window and biases the next angle less each
    # time.
    # the window follows the frequency of the last phase, which the block spectra give only roughly
    for iteration in range(3):
        # over all knots, as the window needs a frequency everywhere; the last spline has the moving ones only
        spline = CubicSpline(times, phase)
        window_s = _WINDOW_CYCLES * 2 * np.pi / np.maximum(spline(times, 1), 1e-6)
        z, power, lost = _demodulated_in_groups(
            decimated, weight, rate_hz, _Knots(times, window_s), _PhaseSpline(spline.c, spline.x)
        )
        amplitude = np.abs(z)
        moving = (amplitude > _SMALLEST_RELATIVE_AMPLITUDE * amplitude.max()) & ~lost
        # noise in the band of the window has an amplitude too, but little of the whole power
        moving &= 0.5 * amplitude**2 > _SMALLEST_SHARE_OF_POWER * power
        correction = _unwrapped(np.angle(z), moving)
        phase = spline(times) + correction
        # the block spectra give the frequency only roughly, so that their knots are not one per cycle
        if iteration == 0:
            times, phase, moving = _respaced(times, phase, moving)
    moving = moving & _coherent(phase, moving)
    if moving.sum() < 4:
        raise AnalysisError(
            "motion phase",
            got="fewer than four cycles of coherent motion",
            allowed="a shaken tank",
            remedy="check that the channel is the tank's motion and that the run was not empty",
        )
    # φ is that of the acceleration in every case: a measured velocity lags it by π/2
    spline = CubicSpline(times[moving] + offset_s, phase[moving] + lead_rad)
    return MotionPhase(spline, times + offset_s, amplitude, moving | _isolated_loss(moving))


def _averaged_down(
    motion: FloatArray, usable: BoolArray | None, sampling_rate_hz: float
) -> tuple[FloatArray, FloatArray, float, float]:
    """Block means at about `_DEMODULATION_RATE_HZ`, weight 0 for blocks with a lost sample."""
    # whole factors: a block mean is symmetric and has no phase error, only the delay of half a block that is
    # returned
    factor = max(1, int(sampling_rate_hz // _DEMODULATION_RATE_HZ))
    n_means = motion.size // factor
    mean, weight = empty(n_means, np.float64), empty(n_means, np.float64)
    n_good, total = 0, 0.0
    for part in blocks(n_means, mean, weight, of=max(BLOCK_SAMPLES // factor, 1)):
        samples = slice(part.start * factor, part.stop * factor)
        # double precision in the sums only, so that a channel of single precision is not copied
        mean[part] = motion[samples].reshape(-1, factor).mean(axis=1, dtype=np.float64)
        good = np.isfinite(mean[part])
        if usable is not None:
            good &= usable[samples].reshape(-1, factor).all(axis=1)
            release(usable[samples])
        weight[part] = good
        n_good, total = n_good + int(good.sum()), total + float(mean[part][good].sum())
        release(motion[samples])
    if n_good < 16:
        raise AnalysisError("motion", got=f"{n_good} usable samples", allowed="at least 16", remedy="record again")
    for part in blocks(n_means, mean, weight):
        mean[part] -= total / n_good
        # zero is the mean by now: lost samples neither add nor take away, and the weights tell that they are lost
        mean[part][weight[part] == 0] = 0.0
    return mean, weight, sampling_rate_hz / factor, (factor - 1) / (2 * sampling_rate_hz)


def _dominant_frequency(motion: FloatArray, weight: FloatArray, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Centres [s] and dominant frequencies [Hz] of blocks of about eight cycles."""
    # long blocks first: how long eight cycles are is not known before a frequency is
    overall = _block_peaks(motion, weight, rate_hz, min(motion.size, 1 << 14))
    typical_hz = float(np.median(overall[1]))
    wanted = next_fast_len(int(max(32, _CYCLES_PER_BLOCK / typical_hz * rate_hz)), real=True)
    n_block = min(motion.size, wanted)
    centres, frequency = _block_peaks(motion, weight, rate_hz, n_block)
    # median of three: a single block in which noise or a harmonic won must not bend the phase
    padded = np.pad(frequency, 1, mode="edge")
    return centres, np.median(np.stack([padded[:-2], frequency, padded[2:]]), axis=0)


def _block_peaks(
    motion: FloatArray, weight: FloatArray, rate_hz: float, n_block: int
) -> tuple[FloatArray, FloatArray]:
    """Centres and frequencies of the largest line of every half-overlapping block that is complete and moves."""
    # half overlapping, because a Hann window hardly sees what lies at the ends of a block
    starts = np.arange(0, max(1, motion.size - n_block + 1), max(1, n_block // 2))
    peaks = []
    for first in range(0, starts.size, _BLOCKS_AT_ONCE):
        together = starts[first : first + _BLOCKS_AT_ONCE]
        peaks.append(_peaks(motion, weight, rate_hz, n_block, together))
        for array in (motion, weight):
            release(array[together[0] : together[-1] + n_block])
    frequency, height = (np.concatenate(part) for part in zip(*peaks, strict=True))
    good = height > _SMALLEST_RELATIVE_AMPLITUDE * height.max()
    if not good.any() or height.max() <= 0:
        raise AnalysisError(
            "motion", got="no oscillation", allowed="a shaken tank", remedy="check the motion channel"
        )
    return ((starts + 0.5 * (n_block - 1)) / rate_hz)[good], frequency[good]


def _peaks(
    motion: FloatArray, weight: FloatArray, rate_hz: float, n_block: int, starts: npt.NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Frequency and height of the largest line of blocks; height 0 where samples are lost."""
    blocks = np.lib.stride_tricks.sliding_window_view(motion, n_block)[starts]
    # a few lost samples, at zero, do not move the largest line
    complete = np.lib.stride_tricks.sliding_window_view(weight, n_block)[starts].mean(axis=1) > 0.9
    blocks = (blocks - blocks.mean(axis=1, keepdims=True)) * np.hanning(n_block)
    # padded, so that the largest line is within an eighth of a line of the frequency
    spectrum = np.abs(np.fft.rfft(blocks, 4 * n_block, axis=1))
    frequency = np.fft.rfftfreq(4 * n_block, 1 / rate_hz)
    # what a Hann window leaves of slow drift lies in the two lowest lines of the unpadded block
    lowest = 2.0 * rate_hz / n_block
    spectrum[:, (frequency < lowest) | (frequency > 0.4 * rate_hz)] = 0.0
    # The fundamental is the first strong line, a harmonic may be the strongest. With the spectrum over f instead,
    # noise below 1 Hz won in signals of large dynamic range.
    first = (spectrum >= _STRONG_LINE * spectrum.max(axis=1, keepdims=True)).argmax(axis=1)
    lobe = np.minimum(first[:, None] + np.arange(_LOBE_LINES), frequency.size - 1)
    rows = np.arange(starts.size)
    peak = lobe[rows, spectrum[rows[:, None], lobe].argmax(axis=1)]
    return frequency[peak], np.where(complete, spectrum[rows, peak], 0.0)


def _phase_knots(centres: FloatArray, frequency: FloatArray, duration_s: float) -> tuple[FloatArray, FloatArray]:
    """One knot per cycle with the phase integrated from the block frequencies."""
    # four steps per cycle of the highest frequency
    step = 0.25 / float(frequency.max())
    fine = np.arange(0.0, duration_s + step, step)
    cycles = np.concatenate([[0.0], np.cumsum(np.interp(fine, centres, frequency))[:-1]]) * step
    return _knot_per_cycle(fine, 2 * np.pi * cycles)


def _knot_per_cycle(times: FloatArray, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    cycles = phase / (2 * np.pi) * _KNOTS_PER_CYCLE
    n = np.arange(np.ceil(cycles[0]), np.floor(cycles[-1]) + 1)
    if n.size < 4:
        raise AnalysisError("motion", got="fewer than four cycles", allowed="a sweep", remedy="record longer")
    return np.interp(n, cycles, times), n / _KNOTS_PER_CYCLE * 2 * np.pi


def _respaced(times: FloatArray, phase: FloatArray, moving: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Knots again one per cycle, now of the demodulated phase."""
    # a knot without motion has a random angle; the phase is carried across it
    smooth = np.interp(times, times[moving], phase[moving]) if moving.any() else phase
    # knots are found by inverting φ(t), which needs a strictly rising phase; the small slope parts equal values
    rising = np.maximum.accumulate(smooth) + 1e-6 * np.arange(smooth.size)
    new_times, _ = _knot_per_cycle(times, rising)
    spline_phase = CubicSpline(times, smooth)(new_times)
    return new_times, np.maximum.accumulate(spline_phase), np.interp(new_times, times, moving) > 0.5


def _unwrapped(angle: FloatArray, moving: BoolArray) -> FloatArray:
    """Angles unwrapped over the moving knots and held between them."""
    at = np.flatnonzero(moving)
    if at.size == 0:
        return np.zeros_like(angle)
    # angles where nothing moves are noise and would add turns
    return np.interp(np.arange(angle.size), at, np.unwrap(angle[at]))


def _coherent(phase: FloatArray, moving: BoolArray) -> BoolArray:
    """False at knots whose phase jumps against both neighbours."""
    second = np.zeros_like(phase)
    # A sweep changes the phase step from one cycle to the next by far less: by 2 per cent of a turn, 0.13 rad,
    # at most within what counts as one step of the frequency. Noise changes it by anything.
    second[1:-1] = phase[2:] - 2 * phase[1:-1] + phase[:-2]
    second[[0, -1]] = second[[1, -2]]
    # a knot without moving neighbours cannot be told from noise
    near_moving = np.convolve(moving, np.ones(3), mode="same") >= 2
    return near_moving & (np.abs(second) < _LARGEST_PHASE_JUMP_RAD)


def _isolated_loss(moving: BoolArray) -> BoolArray:
    """True where the motion stops for a moment only: the phase is carried across lost samples."""
    at = np.flatnonzero(moving)
    inside = np.zeros_like(moving)
    # lost samples make the cycles that they touch unusable, and no others
    inside[at[0] : at[-1] + 1] = True
    return inside & ~moving


class _Knots(NamedTuple):
    """Where the motion is demodulated, and under how long a window."""

    times: FloatArray
    window_s: FloatArray


class _PhaseSpline(NamedTuple):
    """The cubic spline φ(t)."""

    coefficients: FloatArray  # (4, n_pieces), the highest power first
    breaks: FloatArray  # (n_pieces + 1,)


def _demodulated_in_groups(
    motion: FloatArray, weight: FloatArray, rate_hz: float, knots: _Knots, spline: _PhaseSpline
) -> tuple[npt.NDArray[np.complex128], FloatArray, BoolArray]:
    """`_demodulated` at all knots, of which only some have their samples in memory at a time."""
    n = knots.times.size
    z, power, lost = np.empty(n, dtype=np.complex128), np.empty(n), np.empty(n, dtype=np.bool_)
    for part in blocks(n, of=_KNOTS_AT_ONCE):
        z[part], power[part], lost[part] = _demodulated(
            motion, weight, rate_hz, knots, spline, part.start, part.stop
        )
        for array in (motion, weight):
            release(array[: min(int(knots.times[part.stop - 1] * rate_hz), array.size)])
    return z, power, lost


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _demodulated(
    motion: FloatArray,
    weight: FloatArray,
    rate_hz: float,
    knots: _Knots,
    spline: _PhaseSpline,
    first_knot: int,
    stop_knot: int,
) -> tuple[npt.NDArray[np.complex128], FloatArray, BoolArray]:
    """Amplitude, twice the mean of motion·e^{-jφ}, and mean square under a Hann window at each of some knots.

    The third result is True where samples were lost.
    """
    times, window_s, coefficients, breaks = knots.times, knots.window_s, spline.coefficients, spline.breaks
    result = np.zeros(stop_knot - first_knot, dtype=np.complex128)
    power = np.zeros(stop_knot - first_knot)
    lost = np.zeros(stop_knot - first_knot, dtype=np.bool_)
    last_piece = breaks.size - 2
    for k in range(first_knot, stop_knot):
        # symmetric about the knot, hence without delay
        half = 0.5 * window_s[k]
        first = max(0, int(np.ceil((times[k] - half) * rate_hz)))
        last = min(motion.size - 1, int(np.floor((times[k] + half) * rate_hz)))
        piece = max(0, min(last_piece, k))
        total, square, norm, present = 0.0 + 0.0j, 0.0, 0.0, 0.0
        while piece > 0 and breaks[piece] > first / rate_hz:
            piece -= 1
        for i in range(first, last + 1):
            t = i / rate_hz
            while piece < last_piece and breaks[piece + 1] <= t:
                piece += 1
            x = t - breaks[piece]
            # the spline is evaluated here: calling SciPy for every sample of every window costs far more than
            # the sums
            phi = (
                (coefficients[0, piece] * x + coefficients[1, piece]) * x + coefficients[2, piece]
            ) * x + coefficients[3, piece]
            w = 0.5 + 0.5 * np.cos(np.pi * (t - times[k]) / half)
            total += w * weight[i] * motion[i] * (np.cos(phi) - 1j * np.sin(phi))
            square += w * weight[i] * motion[i] ** 2
            norm += w
            present += w * weight[i]
        # The sum of a whole Hann window. Less means that the window reaches beyond the record, where it is no
        # longer symmetric and the phase is biased.
        expected = 0.5 * window_s[k] * rate_hz
        at = k - first_knot
        lost[at] = norm == 0.0 or present < 0.999 * norm or norm < 0.98 * expected
        if norm > 0.0:
            result[at] = 2.0 * total / norm
            power[at] = square / norm
    return result, power, lost
