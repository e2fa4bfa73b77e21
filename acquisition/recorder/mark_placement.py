"""Where marks lie among the samples.

A mark has a moment of this computer's clock. Its place follows from the fitted clock of the first device; a person
is slower than any error of that.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from acquisition.recorder.mark import Mark
from acquisition.recorder.placement import SourcePlacement
from sloshlab.conditioning.device_clock import ClockStatus


def place_of(mark: Mark, base: SourcePlacement) -> float | None:
    """Place of a mark among the samples of the first device, in samples; None if it lies outside of them.

    Parameters
    ----------
    mark : Mark
    base : SourcePlacement
        Of the first device.
    """
    place = _by_clock(mark.host_monotonic_ns, base)
    if place is None:
        place = _by_arrivals(mark.host_monotonic_ns, base)
    return place if place is not None and -0.5 <= place <= base.n_samples - 0.5 else None


def _by_clock(host_ns: int, base: SourcePlacement) -> float | None:
    """By the fitted line of the stream that ran at that moment, or had run last."""
    found = None
    for stream in base.streams:
        clock = stream.clock
        if clock.status is not ClockStatus.FITTED:
            return None
        counter = ((host_ns - clock.host_origin_ns) * 1e-9 - clock.first_sample_s) / clock.period_s
        if found is None or counter >= stream.first_counter:
            found = stream.first_index + counter - stream.first_counter
    return found


def _by_arrivals(host_ns: int, base: SourcePlacement) -> float | None:
    """By what had arrived at that moment: of a device that was not read in real time nothing else is known."""
    entries = [group for group in base.groups if len(group.entries)]
    if not entries:
        return None
    group = entries[0]
    ends = group.index + group.entries.n_samples - 1
    order = np.argsort(group.entries.host_monotonic_ns, kind="stable")
    arrivals = group.entries.host_monotonic_ns[order] - host_ns
    reached = np.maximum.accumulate(ends[order])
    return float(np.interp(0.0, arrivals.astype(np.float64), reached.astype(np.float64)))


def packed_marks(marks: Sequence[tuple[float, str]]) -> str:
    """The attribute `marks` of a recording: JSON, a time and a text each, in order of time."""
    rows = [{"time_s": round(time_s, 6), "text": text} for time_s, text in sorted(marks)]
    return json.dumps(rows, ensure_ascii=False)
