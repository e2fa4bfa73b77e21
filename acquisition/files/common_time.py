"""One time base for columns that were sampled with one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.column_lookup import NamedTable, Selected
from acquisition.files.table import FloatArray
from acquisition.files.time_base import Grid, uniform_grid
from sloshlab.errors import ChannelMapError, RecordingError

_START_IS_OLD_STEPS = 2.0**31
"""Beyond so many steps from zero float64 seconds no longer hold a step to 1e-6: time then starts anew."""


def of_one_rate(selected: list[Selected], settings: SourceSection, tables: Sequence[NamedTable]) -> list[Selected]:
    """Columns with the rate of the first, refitted where theirs is the same within the jitter that is allowed.

    Raises
    ------
    ChannelMapError
        If one has another rate.
    """
    rate = selected[0].grid.rate_hz
    jitter = settings.jitter_allowed_steps or max(named.table.jitter_allowed_steps for named in tables)
    aligned = []
    for column in selected:
        # over the whole length: rates that differ by little drift apart by steps in a long run
        if abs(column.grid.rate_hz / rate - 1) * column.grid.n_points <= 1e-6:
            aligned.append(column)
            continue
        # two messages of one device have one rate, though their rounded stamps may suggest two
        grid = _refitted(column, rate, jitter)
        if grid is None:
            raise ChannelMapError(
                f"channels.{column.channel}: sampling rate",
                got=f"{column.grid.rate_hz:.9g} Hz beside {rate:.9g} Hz of {selected[0].channel}",
                allowed="one rate per recording",
                remedy="map the channels of each rate in an import of their own, or resample before",
            )
        aligned.append(replace(column, grid=grid))
    return aligned


def _refitted(selected: Selected, rate: float, jitter: float) -> Grid | None:
    if selected.column.time_s is None or abs(selected.grid.rate_hz / rate - 1) > 0.01:
        return None
    try:
        return uniform_grid(
            selected.column.time_s,
            name=selected.channel,
            rate_hz=rate,
            resolution_s=selected.column.time_resolution_s,
            jitter_allowed_steps=jitter,
        )
    except RecordingError:
        return None


@dataclass(frozen=True)
class CommonTime:
    """The time axis of the recording and where each selected column begins on it."""

    start_s: float
    rate_hz: float
    n_points: int
    first_points: tuple[int, ...]
    offsets_s: tuple[float, ...]
    traps: tuple[str, ...]

    def times(self) -> FloatArray:
        """Seconds, shape (n_points,)."""
        return self.start_s + np.arange(self.n_points) / self.rate_hz


def common_time(selected: Sequence[Selected], jitter_allowed_steps: float) -> CommonTime:
    """One time axis for all selected columns.

    Raises
    ------
    ChannelMapError
        If columns begin a fraction of a step apart.
    """
    rate = selected[0].grid.rate_hz
    start = min(column.grid.start_s for column in selected)
    first_points, offsets, traps = [], [], []
    for column in selected:
        steps = (column.grid.start_s - start) * rate
        if not np.isfinite(steps):
            raise ChannelMapError(
                f"channels.{column.channel}: time",
                got=f"a start at {column.grid.start_s:.6g} s, of others at {start:.6g} s",
                allowed="columns that overlap in time",
            )
        whole = int(np.rint(steps))
        offset = (steps - whole) / rate
        allowed = jitter_allowed_steps + column.grid.resolution_s * rate
        if abs(steps - whole) > allowed:
            raise ChannelMapError(
                f"channels.{column.channel}: time",
                got=f"a start {steps:.6g} steps after the first channel's",
                allowed=f"whole steps of {1 / rate:.6g} s",
                remedy="state delay_s, import it by itself, or resample before",
            )
        if abs(steps - whole) > 1e-6:
            traps.append(f"{column.channel}: sampled {offset:.3g} s off the common grid; not compensated")
        first_points.append(whole)
        offsets.append(offset)
    n_points = max(first + column.grid.n_points for first, column in zip(first_points, selected, strict=True))
    n_given = max(column.column.values.size for column in selected)
    # files of different days would make a recording that consists of gaps
    if n_points > 4 * n_given + 16:
        raise ChannelMapError(
            "channels: time",
            got=f"{n_points} points for {n_given} samples",
            allowed="columns that overlap in time",
        )
    if abs(start) * rate > _START_IS_OLD_STEPS:
        traps.append(f"time counts from the first sample, which the source puts at {start:.9g} s")
        start = 0.0
    return CommonTime(start, rate, n_points, tuple(first_points), tuple(offsets), tuple(traps))
