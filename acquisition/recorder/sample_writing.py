"""Second reading: counts and values of all sources into the recording, with their flags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.recorder.placed_samples import Stretch
from acquisition.recorder.recording_file import SAMPLES_PER_CHUNK, RecordingFile
from acquisition.recorder.recording_plan import Part
from acquisition.recorder.survey import clipping_counts, has_reading, stretches
from sloshlab.conditioning.resampling import half_width, resampled
from sloshlab.recording import CLIPPED, LOST, OUT_OF_ORDER, STUCK

# bounds the memory of an assembly: ten minutes of 8 channels at 51.2 kHz take 331 MB, most of it libraries
VALUES_AT_ONCE: Final = 1 << 22
_NEAREST_SAMPLES = 2
FlagArray = NDArray[np.uint8]


def samples_at_once(n_channels: int, rate_ratio: float = 1.0) -> int:
    """Samples per stretch, so that memory does not grow with channels; whole chunks where possible."""
    n = int(VALUES_AT_ONCE / (max(1, n_channels) * max(1.0, rate_ratio)))
    # whole chunks, as each is compressed once and never read again
    return max(1024, n // SAMPLES_PER_CHUNK * SAMPLES_PER_CHUNK or n)


def write_samples(
    file: RecordingFile,
    parts: Sequence[Part],
    n_samples: int,
    time_base: tuple[float, int],
    advance: Callable[[int], None] = lambda n_samples: None,
) -> dict[str, int]:
    """Write all samples; `advance` is called with their number after each stretch.

    Parameters
    ----------
    file : RecordingFile
    parts : sequence of Part
    n_samples : int
    time_base : tuple of (float, int)
        Samples per second, and the number of the first sample counted from time 0.
    advance : callable

    Returns
    -------
    dict of str to int
        Lost values on the time base, by channel.
    """
    lost: dict[str, int] = {}
    rate_hz, origin = time_base
    ratio = max(part.placement.info.sampling_rate_hz / rate_hz for part in parts)
    n_each = samples_at_once(max(len(part.channels) for part in parts), ratio)
    for start, stop in stretches(n_samples, n_each):
        file.put("time", start, np.arange(start + origin, stop + origin) / rate_hz)
        quality = np.zeros(stop - start, np.uint8)
        for part in parts:
            write = _put_counts if part.alignment.is_on_base else _put_values
            quality |= write(file, part, (start, stop), rate_hz, lost)
        file.put("quality", start, quality)
        advance(stop - start)
    for part in parts:
        if not part.alignment.is_on_base:
            _write_own_counts(file, part)
    return lost


def _put_counts(
    file: RecordingFile, part: Part, places: tuple[int, int], rate_hz: float, lost: dict[str, int]
) -> FlagArray:
    """Counts on the time base, and the flags of the samples."""
    start, stop = places
    stretch = part.samples.read(start - part.shift, stop - part.shift)
    read = has_reading(stretch, part.placement.info)
    for column, name in enumerate(part.names):
        file.put(name, start, _filled(part, stretch, read, column))
        lost[name] = lost.get(name, 0) + int(np.count_nonzero(~read[:, column]))
    return _flags(part, stretch, read)


def _write_own_counts(file: RecordingFile, part: Part) -> None:
    for start, stop in stretches(part.placement.n_samples, samples_at_once(len(part.channels))):
        stretch = part.samples.read(start, stop)
        read = has_reading(stretch, part.placement.info)
        for column, name in enumerate(part.names):
            file.put(f"counts_{name}", start, _filled(part, stretch, read, column))
        file.put(f"quality_{part.label}", start, _flags(part, stretch, read))


def _filled(part: Part, stretch: Stretch, read: NDArray[np.bool_], column: int) -> NDArray[Any]:
    dtype, fill = part.stored[column]
    counts = stretch.counts[:, column].astype(dtype)
    # after the change of type: the fill value may not fit into 32 bits
    counts[~read[:, column]] = fill
    return counts


def _put_values(
    file: RecordingFile, part: Part, places: tuple[int, int], rate_hz: float, lost: dict[str, int]
) -> FlagArray:
    """Values of another clock on the time base, and the flags of the samples next to each instant."""
    start, stop = places
    own_places = (np.arange(start, stop) / rate_hz - part.alignment.start_s) / part.alignment.step_s
    rate_ratio = part.alignment.step_s * rate_hz
    # so that the kernel of the first and last instants of a stretch is complete
    reach = half_width(rate_ratio) + 2
    first = max(0, int(np.floor(own_places[0])) - reach)
    last = min(part.placement.n_samples, int(np.ceil(own_places[-1])) + reach)
    stretch = part.samples.read(first, max(first, last))
    read = has_reading(stretch, part.placement.info)
    quality = _flags_at(_flags(part, stretch, read), own_places - first)
    for column, (name, channel) in enumerate(zip(part.names, part.channels, strict=True)):
        samples = stretch.counts[:, column] * channel.scale_factor + channel.add_offset
        # a value whose kernel touches a lost sample is lost, too: nothing is interpolated over gaps
        samples[~read[:, column]] = np.nan
        values = resampled(samples, own_places - first, rate_ratio=rate_ratio).astype(np.float32)
        is_lost = np.isnan(values)
        # by the values: around one lost sample 48 instants are lost
        quality[is_lost] |= LOST
        lost[name] = lost.get(name, 0) + int(np.count_nonzero(is_lost))
        file.put(name, start, values)
    return quality


def _flags_at(flags: FlagArray, places: NDArray[np.float64]) -> FlagArray:
    """Flags of the samples nearest to each place; lost is left to the values."""
    found = np.zeros(places.size, np.uint8)
    if not flags.any():
        return found
    nearest = np.floor(places).astype(np.int64)
    for step in range(1 - _NEAREST_SAMPLES, _NEAREST_SAMPLES + 1):
        inside = (nearest + step >= 0) & (nearest + step < flags.size)
        found[inside] |= flags[nearest[inside] + step]
    return np.asarray(found & ~np.uint8(LOST), dtype=np.uint8)


def _flags(part: Part, stretch: Stretch, read: NDArray[np.bool_]) -> FlagArray:
    flags = np.zeros(len(stretch.counts), np.uint8)
    flags[~read.all(axis=1)] |= LOST
    flags[stretch.late] |= OUT_OF_ORDER
    for column, (channel, survey) in enumerate(zip(part.channels, part.survey.channels, strict=True)):
        if survey.n_clipped:
            low, high = clipping_counts(channel)
            counts = stretch.counts[:, column]
            flags[read[:, column] & ((counts <= low) | (counts >= high))] |= CLIPPED
        if survey.stuck:
            flags[_inside(survey.stuck, stretch.start, flags.size) & read[:, column]] |= STUCK
    return flags


def _inside(intervals: Sequence[tuple[int, int]], start: int, n: int) -> NDArray[np.bool_]:
    """Which of `n` places from `start` on lie in one of the intervals."""
    bounds = np.clip(np.array(intervals, np.int64) - start, 0, n)
    change = np.bincount(bounds[:, 0], minlength=n + 1) - np.bincount(bounds[:, 1], minlength=n + 1)
    return np.asarray(np.cumsum(change[:n]) > 0)
