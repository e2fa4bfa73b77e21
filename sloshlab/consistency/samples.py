"""Samples that are numbers and yet were not measured: held, filled, spiked, cut off.

Each channel is compared with its own signal on both sides, so that nothing need be known of sensor or motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from sloshlab.conditioning.clipping import clipped_samples, clipping
from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.conditioning.quality import LARGEST_CLIPPED_FRACTION, sample_statistics
from sloshlab.consistency.finding import Action, BoolArray, Finding
from sloshlab.consistency.sample_scan import (
    PREDICTION_ERROR,
    QUIETEST_STRETCH,
    SHORTEST_HOLD,
    ScannedChannel,
    combined,
    nowhere,
    places,
    prediction_error,
    widened,
)
from sloshlab.order_statistics import median, quantile_of_sorted
from sloshlab.out_of_core import blocks, empty, release, zeros
from sloshlab.recording import channels

FloatArray = npt.NDArray[np.float64]

_HOLD_MARGIN = 3.0
"""A sine holds one step of its converter at its crest; three times as long it cannot."""
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
_AND_NOT: Final = np.greater
"""Of truth values: the first and not the second."""
WHITE_GAIN: Final = float(np.sqrt((PREDICTION_ERROR**2).sum()))


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
    if recording.sizes["time"] < 8 * QUIETEST_STRETCH:
        return findings, wrong
    rate_hz = 1.0 / sampling_step_s(recording)
    # every check is one of proportions
    largest = {name: _largest_finite(recording[name].values) for name in channels(recording)}
    scanned = {name: ScannedChannel(recording[name].values, rate_hz, at) for name, at in largest.items() if at > 0}
    time = recording["time"].values
    for name in scanned if names is None else [name for name in names if name in scanned]:
        explained: BoolArray | None = None
        for check, suspicious in _suspicious(recording[name], scanned):
            if not suspicious.any():
                continue
            # a flat top does not change, what does not change has no noise either, and steps at both ends
            samples = suspicious if explained is None else combined(_AND_NOT, suspicious, widened(explained, 9))
            explained = samples if explained is None else combined(np.logical_or, explained, samples)
            if check in checks and samples.any():
                findings.append(_found(check, name, samples, time))
                wrong[name] = combined(np.logical_or, wrong[name], samples) if name in wrong else samples
        release(recording[name].values)
    return findings, wrong


def _suspicious(channel: xr.DataArray, scanned: Mapping[str, ScannedChannel]) -> Iterator[tuple[str, BoolArray]]:
    """Every check with the samples that it finds wrong."""
    own = scanned[str(channel.name)]
    yield "cut off", _cut_off(channel)
    yield "held samples", held_samples(own)
    yield "filled samples", filled_samples(own)
    yield "spikes", widened(_own_spikes(str(channel.name), scanned), 3)
    yield "repeated samples", repeated_samples(own)


def _largest_finite(values: npt.NDArray[np.floating]) -> float:
    """Magnitude of the largest value that is a number, 0 if none is."""
    largest = 0.0
    for part in blocks(values.size, values):
        # NaN loses against any number, and nothing is copied
        of_part = float(np.fmax(np.fmax.reduce(values[part]), -np.fmin.reduce(values[part])))
        if not math.isfinite(of_part):
            of_part = float(np.max(np.abs(values[part]), where=np.isfinite(values[part]), initial=0.0))
        largest = max(largest, of_part)
    return largest


def _found(check: str, name: str, samples: BoolArray, time: FloatArray) -> Finding:
    at = places(samples)
    n_places = 1 + int(np.count_nonzero(np.diff(at) > 1))
    text = f"{at.size} samples in {n_places} places: {SAMPLE_CHECKS[check]}"
    # as of samples at a stated limit: few cost the cycles that they touch, many cost the run
    too_many = check == "cut off" and at.size > LARGEST_CLIPPED_FRACTION * samples.size
    action = Action.REFUSED if too_many else Action.MASKED
    return Finding(check, (name,), text, action, float(time[at[0]]), float(time[at[-1]]))


def _own_spikes(name: str, scanned: Mapping[str, ScannedChannel]) -> BoolArray:
    """True at spikes of a channel that are large and that no other channel feels."""
    own = scanned[name]
    spiked = spikes(own)
    at = places(spiked)
    if not at.size:
        return spiked
    *_, deviation = sample_statistics(own.values)
    smallest = _SMALLEST_SPIKE * deviation / own.largest
    # spikes that are near each other are looked at together
    for group in np.split(at, np.flatnonzero(np.diff(at) > own.n_block) + 1):
        first, stop = max(int(group[0]) - 2, 0), min(int(group[-1]) + 3, own.size)
        felt = np.zeros(stop - first, dtype=np.bool_)
        # a blow is felt by more than one sensor, a disturbed sample by one
        for other, channel in scanned.items():
            if other != name:
                felt |= np.abs(channel.standardised(first, stop)) > _FELT_SIGMA
        before = max(first - 2, 0)
        error = prediction_error(own.part(before, min(stop + 2, own.size)))[first - before :][: stop - first]
        spiked[first:stop] &= ~widened(felt, 5) & (np.abs(error) > smallest)
    return spiked


def _cut_off(channel: xr.DataArray) -> BoolArray:
    found = clipping(channel)
    values = channel.values
    if not found.is_suspected:
        return nowhere(values.size)
    _, lowest, highest, _, _ = sample_statistics(values)
    # what the stated range explains is counted as clipped elsewhere
    clipped = clipped_samples(channel)
    extreme: BoolArray = empty(values.size, np.bool_)
    for part in blocks(values.size, values, clipped, extreme):
        extreme[part] = ((values[part] == highest) | (values[part] == lowest)) & ~clipped[part]
    return extreme


def held_samples(channel: ScannedChannel) -> BoolArray:
    """True in runs of equal samples that are longer than the signal on both sides can stand still.

    Notes
    -----
    A sine of amplitude A and frequency ω stays within one step q of its converter for 2 arccos(1 − q/A)/ω at its
    crest. A and ω are those of the second before and of the second after, whichever is slower; q is the smallest
    change between samples that is there.
    """
    bounds, n = channel.bounds, channel.n_block
    found = []
    for start, stop in bounds.long_runs.tolist():
        sides = ((max(0, start - n), start), (stop, min(stop + n, channel.size)))
        # the side that is too slow for a hold spares the other
        if all(stop - start > _HOLD_MARGIN * _longest_hold(channel.part(*side), bounds.step) for side in sides):
            found.append(slice(start, stop))
    if not found:
        return nowhere(channel.size)
    held: BoolArray = zeros(channel.size, np.bool_)
    for run in found:
        held[run] = True
    return held


def repeated_samples(channel: ScannedChannel) -> BoolArray:
    """True at samples that repeat the one before, where a channel does so regularly although it moves.

    A converter that is read faster than it converts, or a slower channel that was filled up to the common rate.
    """
    none = nowhere(channel.size)
    if channel.bounds.n_repeated < _REPEATED_SHARE * channel.size:
        return none
    change = np.abs(np.diff(channel.part(0, channel.size)))
    moving = change[np.isfinite(change) & (change > 0)]
    if moving.size == 0:
        return none
    # equal neighbours are no wonder where the signal changes by a step of the converter or two
    repeats = float(np.median(moving)) > _REPEATED_STEPS * float(moving.min())
    return np.concatenate([[False], change == 0]) if repeats else none


def _longest_hold(values: FloatArray, step: float) -> float:
    """Samples for which a signal like this can stay within one step; infinite if it is at rest or too short."""
    values = values[np.isfinite(values)]
    if values.size < 2 * SHORTEST_HOLD:
        return math.inf
    # the range first, which costs a tenth of quantiles
    if float(values.max() - values.min()) < 8 * step:
        return math.inf
    ascending = np.sort(values)
    amplitude = 0.5 * (quantile_of_sorted(ascending, 0.95) - quantile_of_sorted(ascending, 0.05))
    change = median(np.abs(np.diff(values)))
    # no faster than its own noise lets it seem: a channel at rest that only flickers may well stand still
    if amplitude < 4 * step or change <= 0:
        return math.inf
    omega = change / (0.7071 * amplitude)
    return 2 * math.acos(max(-1.0, 1 - step / amplitude)) / omega


def filled_samples(channel: ScannedChannel) -> BoolArray:
    """True where a channel that has noise before and after has none: a gap closed by a line or a curve."""
    bounds, n, size = channel.bounds, channel.n_block, channel.size
    # the quietest place is not as quiet as that often: most channels end here
    n_of_part = np.minimum(n, size - n * np.arange(bounds.loudest_power.size))
    n_below = n_of_part[_MADE_UP_SHARE**2 * bounds.loudest_power < bounds.quietest_power.min()].sum()
    if n_below > _OFTEN * size + 1:
        return nowhere(size)
    error = prediction_error(channel.part(0, size))
    # NaN neither hides nor makes a stretch: it counts as noise
    power = np.where(np.isfinite(error), error**2, np.finfo(np.float64).max)
    finite = np.where(np.isfinite(error), power, 0.0)
    typical = float(np.median(finite))
    # the steps of a converter alone leave 0.4 of a step: only a channel with noise beyond them can lack it
    if not math.sqrt(typical) > _BEYOND_STEPS * bounds.step:
        return nowhere(size)
    largest = maximum_filter1d(power, QUIETEST_STRETCH)
    # nowhere near as quiet as the channel often is: a modulated motion has calm moments of its own
    quiet: BoolArray = largest < _MADE_UP_SHARE**2 * float(np.quantile(largest, _OFTEN))
    if not quiet.any():
        return quiet
    usual = uniform_filter1d(np.minimum(finite, 9 * typical), n)
    # and than the quieter side: before a motion starts and after it stops nothing is compared
    beside = np.minimum(np.roll(usual, n), np.roll(usual, -n))
    beside[:n] = beside[-n:] = 0.0
    # sums that run along a signal leave their rounding where it is zero
    beside[beside < _ROUNDING * np.max(usual)] = 0.0
    quiet &= largest < _MADE_UP_SHARE**2 * beside
    # back to all samples of the stretches that were seen at their middle; the error reaches over two to each side
    return widened(quiet, QUIETEST_STRETCH + 4)


def spikes(channel: ScannedChannel) -> BoolArray:
    """True at single samples that their four neighbours do not predict, shape (n_samples,).

    One wrong sample among good ones leaves the prediction errors 1, −4, 6, −4, 1 in a row; a blow that an
    anti-aliasing filter has let through is wider and leaves another pattern.
    """
    # the error of five predictions in a row is at most that many times the largest of them
    gain = float(np.abs(PREDICTION_ERROR).sum() / (PREDICTION_ERROR**2).sum())
    stretches = channel.loud_stretches(_SPIKE_SIGMA / gain)
    if not stretches:
        return nowhere(channel.size)
    found: BoolArray = zeros(channel.size, np.bool_)
    for start, stop in stretches:
        # the pattern is five samples wide, and the largest of five is sought
        first, last = max(start - 4, 0), min(stop + 4, channel.size)
        found[start:stop] = _fitting_the_pattern(channel.standardised(first, last))[start - first :][
            : stop - start
        ]
    return found


def _fitting_the_pattern(standardised: FloatArray) -> BoolArray:
    """True where standardised prediction errors are those of one wrong sample."""
    pattern_power = float((PREDICTION_ERROR**2).sum())
    size = np.convolve(standardised, PREDICTION_ERROR[::-1], mode="same") / pattern_power
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
