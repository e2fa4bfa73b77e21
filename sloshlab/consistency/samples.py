"""Samples that are numbers and yet were not measured: held, filled, spiked, cut off.

Each channel is compared with its own signal on both sides, so that nothing need be known of sensor or motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from sloshlab.conditioning.clipping import clipped_samples, clipping
from sloshlab.conditioning.gaps import run_bounds, sampling_step_s
from sloshlab.conditioning.quality import LARGEST_CLIPPED_FRACTION
from sloshlab.consistency.finding import Action, BoolArray, Finding
from sloshlab.recording import channels

FloatArray = npt.NDArray[np.float64]

_NEIGHBOURHOOD_S = 1.0
"""To each side of a stretch, what its signal is compared with."""
_HOLD_MARGIN = 3.0
"""A sine holds one step of its converter at its crest; three times as long it cannot."""
_SHORTEST_HOLD = 12
"""Random motion of several modes stands still for half as long by chance, once in some minutes."""
_QUIETEST_STRETCH = 24
"""Samples over which the noise of a channel must vanish before it is called made up."""
_MADE_UP_SHARE = 0.02
"""Of the noise of the neighbourhood; what is computed from few points has none."""
_BEYOND_STEPS = 0.3
"""Median prediction error over a step: 0.63 with noise of 0.6 steps, 0.17 or less without noise."""
_OFTEN = 0.1
"""Share of a channel that may be filled before its quiet stretches pass for its habit."""
_SPIKE_SIGMA = 12.0
"""Of the prediction from four neighbours."""
_REPEATED_SHARE = 0.3
"""Every second sample would be 0.5; parts at rest or lost may be without."""
_REPEATED_STEPS = 8
_SMALLEST_SPIKE = 0.5
"""Of the RMS of a channel: a smaller one changes the work of a cycle of n samples by 1/n of the reactive power."""
_LARGEST_STANDARDISED = 1e6
_ROUNDING = 1e-9
_BEND: Final = np.array([1.0, -2.0, 1.0])
_FELT_SIGMA = 5.0
"""Of the prediction error of another channel: it felt something at the same instant."""
_SPIKE_SHAPE = 0.9
"""Share of the error of five predictions in a row that one wrong sample explains."""
SAMPLE_CHECKS: Final = {
    "cut off": "cut off at the channel's own extreme, with no range stated",
    "held samples": "the value does not change while the signal on both sides does",
    "filled samples": "no noise, as of computed values",
    "spikes": "single values that no neighbour and no other sensor knows of",
    "repeated samples": "each value stands several times: sampled slower than stated",
}
"""What is examined, and what a finding means."""
# The error of the cubic through four neighbours, as a filter of the samples.
_PREDICTION_ERROR: Final = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
WHITE_GAIN: Final = float(np.sqrt((_PREDICTION_ERROR**2).sum()))


def prediction_error(values: FloatArray) -> FloatArray:
    """Each sample minus the cubic through its four neighbours, shape (n,); zero at the two ends.

    For white noise its standard deviation is 1.394 times that of the noise; a sine of n samples per period leaves
    (2π/n)⁴/6 of its amplitude.
    """
    error = np.zeros_like(values)
    error[2:-2] = np.convolve(values, _PREDICTION_ERROR, mode="valid")
    return error


def examined_samples(
    recording: xr.Dataset, names: Sequence[str] | None = None, *, checks: Sequence[str] = tuple(SAMPLE_CHECKS)
) -> tuple[list[Finding], dict[str, BoolArray]]:
    """What is wrong with single samples of the channels.

    Parameters
    ----------
    recording : xarray.Dataset
        In SI units, NaN where lost.
    names : sequence of str, optional
        Channels to examine, all by default.
    checks : sequence of str
        Which of `SAMPLE_CHECKS`, all by default.

    Returns
    -------
    findings : list of Finding
        Masked ones; a channel with too many samples cut off is refused.
    wrong : dict of str to ndarray of bool, shape (n_samples,)
        By channel, the samples they are about; only channels that have any.
    """
    findings: list[Finding] = []
    wrong: dict[str, BoolArray] = {}
    if recording.sizes["time"] < 8 * _QUIETEST_STRETCH:
        return findings, wrong
    rate_hz = 1.0 / sampling_step_s(recording)
    over_largest = {name: _over_its_largest(recording[name]) for name in channels(recording)}
    signals = {name: values for name, values in over_largest.items() if values is not None}
    errors = {name: standardised_errors(values, rate_hz) for name, values in signals.items()}
    time = recording["time"].values
    for name in signals if names is None else [name for name in names if name in signals]:
        # a blow is felt by more than one sensor, a disturbed sample by one
        spiked = spikes(errors[name])
        if spiked.any():
            spiked &= ~_felt_elsewhere(name, errors)
            spiked &= np.abs(prediction_error(signals[name])) > _SMALLEST_SPIKE * np.nanstd(signals[name])
        of_check = {
            "cut off": _cut_off(recording[name]),
            "held samples": held_samples(signals[name], rate_hz),
            "filled samples": filled_samples(signals[name], rate_hz),
            "spikes": _widened(spiked, 3),
            "repeated samples": repeated_samples(signals[name]),
        }
        explained = np.zeros(time.size, dtype=np.bool_)
        for check, suspicious in of_check.items():
            # a flat top does not change, what does not change has no noise either, and steps at both ends
            samples = suspicious & ~_widened(explained, 9)
            explained |= samples
            if check in checks and samples.any():
                findings.append(_found(check, name, samples, time))
                wrong[name] = wrong.get(name, np.zeros(samples.size, dtype=np.bool_)) | samples
    return findings, wrong


def _over_its_largest(channel: xr.DataArray) -> FloatArray | None:
    """Values over the largest of them, as every check is one of proportions; None where nothing was measured."""
    values = np.asarray(channel.values, dtype=np.float64)
    largest = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
    return values / largest if largest > 0 else None


def _found(check: str, name: str, samples: BoolArray, time: FloatArray) -> Finding:
    at = np.flatnonzero(samples)
    text = f"{at.size} samples in {len(run_bounds(samples, True))} places: {SAMPLE_CHECKS[check]}"
    # as of samples at a stated limit: few cost the cycles that they touch, many cost the run
    too_many = check == "cut off" and at.size > LARGEST_CLIPPED_FRACTION * samples.size
    action = Action.REFUSED if too_many else Action.MASKED
    return Finding(check, (name,), text, action, float(time[at[0]]), float(time[at[-1]]))


def _felt_elsewhere(name: str, errors: Mapping[str, FloatArray]) -> BoolArray:
    others = [np.abs(error) > _FELT_SIGMA for other, error in errors.items() if other != name]
    return _widened(np.logical_or.reduce(others), 5) if others else np.zeros(errors[name].size, dtype=np.bool_)


def _widened(mask: BoolArray, n: int) -> BoolArray:
    """True where any of n samples about each is, the one more of an even n being before it."""
    wide = mask.copy()
    # most masks of most runs are empty
    if mask.any():
        for k in range(1, n // 2 + 1):
            wide[k:] |= mask[:-k]
        for k in range(1, n - n // 2):
            wide[:-k] |= mask[k:]
    return wide


def _cut_off(channel: xr.DataArray) -> BoolArray:
    found = clipping(channel)
    values = channel.values
    if not found.is_suspected:
        return np.zeros(values.size, dtype=np.bool_)
    # what the stated range explains is counted as clipped elsewhere
    extreme = (values == np.nanmax(values)) | (values == np.nanmin(values))
    return np.asarray(extreme & ~clipped_samples(channel))


def held_samples(values: FloatArray, rate_hz: float) -> BoolArray:
    """True in runs of equal samples that are longer than the signal on both sides can stand still.

    Notes
    -----
    A sine of amplitude A and frequency ω stays within one step q of its converter for 2 arccos(1 − q/A)/ω at its
    crest. A and ω are those of the second before and of the second after, whichever is slower; q is the smallest
    change between samples that is there.
    """
    equal = np.concatenate([[False], values[1:] == values[:-1]])
    held = np.zeros(values.size, dtype=np.bool_)
    bounds = run_bounds(equal, True)
    long_runs = bounds[bounds[:, 1] - bounds[:, 0] + 1 >= _SHORTEST_HOLD] - (1, 0)
    if not long_runs.size:
        return held
    changes = np.abs(np.diff(values))
    step = float(np.min(changes[changes > 0], initial=math.inf))
    n = round(_NEIGHBOURHOOD_S * rate_hz)
    for start, stop in long_runs.tolist():
        sides = values[max(0, start - n) : start], values[stop : stop + n]
        # the side that is too slow for a hold spares the other
        if all(stop - start > _HOLD_MARGIN * _longest_hold(side, step) for side in sides):
            held[start:stop] = True
    return held


def repeated_samples(values: FloatArray) -> BoolArray:
    """True at samples that repeat the one before, where a channel does so regularly although it moves.

    A converter that is read faster than it converts, or a slower channel that was filled up to the common rate.
    """
    change = np.abs(np.diff(values))
    repeated = np.concatenate([[False], change == 0])
    none = np.zeros(values.size, dtype=np.bool_)
    if repeated.mean() < _REPEATED_SHARE:
        return none
    moving = change[np.isfinite(change) & (change > 0)]
    if moving.size == 0:
        return none
    # equal neighbours are no wonder where the signal changes by a step of the converter or two
    return repeated if float(np.median(moving)) > _REPEATED_STEPS * float(moving.min()) else none


def _longest_hold(values: FloatArray, step: float) -> float:
    """Samples for which a signal like this can stay within one step; infinite if it is at rest or too short."""
    values = values[np.isfinite(values)]
    if values.size < 2 * _SHORTEST_HOLD:
        return math.inf
    low, high = np.quantile(values, (0.05, 0.95))
    amplitude = 0.5 * float(high - low)
    change = float(np.median(np.abs(np.diff(values))))
    # no faster than its own noise lets it seem: a channel at rest that only flickers may well stand still
    if amplitude < 4 * step or change <= 0:
        return math.inf
    omega = change / (0.7071 * amplitude)
    return 2 * math.acos(max(-1.0, 1 - step / amplitude)) / omega


def filled_samples(values: FloatArray, rate_hz: float) -> BoolArray:
    """True where a channel that has noise before and after has none: a gap closed by a line or a curve."""
    error = prediction_error(values)
    # NaN neither hides nor makes a stretch: it counts as noise
    power = np.where(np.isfinite(error), error**2, np.finfo(np.float64).max)
    finite = np.where(np.isfinite(error), power, 0.0)
    typical = float(np.median(finite))
    # the steps of a converter alone leave 0.4 of a step: only a channel with noise beyond them can lack it
    changes = np.abs(np.diff(values))
    step = float(np.min(changes[changes > 0], initial=math.inf))
    if not math.sqrt(typical) > _BEYOND_STEPS * step:
        return np.zeros(values.size, dtype=np.bool_)
    largest = maximum_filter1d(power, _QUIETEST_STRETCH)
    # nowhere near as quiet as the channel often is: a modulated motion has calm moments of its own
    quiet: BoolArray = largest < _MADE_UP_SHARE**2 * float(np.quantile(largest, _OFTEN))
    if not quiet.any():
        return quiet
    n = round(_NEIGHBOURHOOD_S * rate_hz)
    usual = uniform_filter1d(np.minimum(finite, 9 * typical), n)
    # and than the quieter side: before a motion starts and after it stops nothing is compared
    beside = np.minimum(np.roll(usual, n), np.roll(usual, -n))
    beside[:n] = beside[-n:] = 0.0
    # sums that run along a signal leave their rounding where it is zero
    beside[beside < _ROUNDING * np.max(usual)] = 0.0
    quiet &= largest < _MADE_UP_SHARE**2 * beside
    # back to all samples of the stretches that were seen at their middle; the error reaches over two to each side
    return _widened(quiet, _QUIETEST_STRETCH + 4)


def standardised_errors(values: FloatArray, rate_hz: float) -> FloatArray:
    """Prediction errors over their usual size around, shape (n,); zero beside lost samples."""
    there = np.isfinite(values)
    error = prediction_error(np.where(there, values, 0.0))
    error[_widened(~there, 9)] = 0.0
    n = max(round(_NEIGHBOURHOOD_S * rate_hz), 5)
    # the median of |e| is 0.6745 σ of a normal distribution
    standardised = 0.6745 * error / _usual_size(error, n)
    # beside a stretch without any noise everything is a spike, by any factor
    return np.asarray(np.clip(standardised, -_LARGEST_STANDARDISED, _LARGEST_STANDARDISED))


def spikes(standardised: FloatArray) -> BoolArray:
    """True at single samples that their four neighbours do not predict.

    One wrong sample among good ones leaves the prediction errors 1, −4, 6, −4, 1 in a row; a blow that an
    anti-aliasing filter has let through is wider and leaves another pattern.

    Parameters
    ----------
    standardised : ndarray, shape (n_samples,)
        Of `standardised_errors`.
    """
    pattern_power = float((_PREDICTION_ERROR**2).sum())
    size = np.convolve(standardised, _PREDICTION_ERROR[::-1], mode="same") / pattern_power
    large = np.abs(size) > _SPIKE_SIGMA
    if not large.any():
        return large
    power = np.convolve(standardised**2, np.ones(5), mode="same")
    explained = size**2 * pattern_power
    # a bend of the signal, as of a drive that changes its slope, leaves 1, −2, 1, which is nearly the same
    bend = np.convolve(standardised, _BEND, mode="same") ** 2 / (_BEND**2).sum()
    found = large & (explained > _SPIKE_SHAPE * power) & (explained > bend)
    # the largest of its surroundings only: its tails fit the pattern less
    return np.asarray(found & (np.abs(size) >= maximum_filter1d(np.abs(size), 5)))


def _usual_size(error: FloatArray, n: int) -> FloatArray:
    """Root of the median of e² in blocks of n, of the largest of three blocks in a row; one value per sample."""
    n_blocks = max(error.size // n, 1)
    medians = np.median((error[: n_blocks * n].reshape(n_blocks, -1)) ** 2, axis=1)
    wide = maximum_filter1d(medians, 3, mode="nearest")
    # a channel without any noise has its rounding
    size = np.sqrt(np.maximum(wide, np.finfo(np.float64).tiny))
    n_of_block = np.full(n_blocks, max(error.size // n_blocks, 1))
    n_of_block[-1] += error.size - n_of_block.sum()
    return np.repeat(size, n_of_block)
