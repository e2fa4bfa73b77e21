"""What an import did, for people and for programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import xarray as xr


@dataclass(frozen=True)
class MappedChannel:
    """One channel and where it came from.

    `factor` and `offset` turn the number in the file into SI, sign included. `n_not_a_number` are
    samples for which the file has no number, `n_clipped` those at a limit of the range.
    """

    channel: str
    source: str
    column: str
    units_in_file: str | None
    units_read: str
    units: str
    factor: float
    offset: float
    sign: int
    delay_compensated_s: float
    n_samples: int
    n_not_a_number: int
    n_clipped: int
    minimum: float
    maximum: float


@dataclass(frozen=True)
class ImportReport:
    """Everything mapped, left out, clipped, missing and suspicious."""

    sources: tuple[dict[str, Any], ...]
    mapped: tuple[MappedChannel, ...]
    left_out: tuple[str, ...]
    traps: tuple[str, ...]
    sampling_rate_hz: float
    n_samples: int
    n_lost: int
    n_clipped: int

    @property
    def is_flagged(self) -> bool:
        """Whether samples were lost or clipped."""
        return self.n_lost > 0 or self.n_clipped > 0

    def lines(self) -> list[str]:
        """The report for people, one fact per line."""
        text = [
            f"source {source['name']}: {source['format']}, {source['n_columns']} columns"
            for source in self.sources
        ]
        duration_s = self.n_samples / self.sampling_rate_hz
        text.append(f"{self.n_samples} samples at {self.sampling_rate_hz:.9g} Hz, {duration_s:.6g} s")
        for channel in self.mapped:
            stated = f"file says {channel.units_in_file!r}, " if channel.units_in_file else ""
            extra = f", {channel.n_clipped} clipped" if channel.n_clipped else ""
            extra += f", {channel.n_not_a_number} without a number" if channel.n_not_a_number else ""
            extra += (
                f", {channel.delay_compensated_s:g} s delay compensated" if channel.delay_compensated_s else ""
            )
            text.append(
                f"mapped {channel.channel} <- {channel.column!r} ({stated}read as {channel.units_read}, "
                f"× {channel.factor:.9g}): {channel.minimum:.6g} … {channel.maximum:.6g} {channel.units}{extra}"
            )
        text.append(f"lost: {self.n_lost} of {self.n_samples} samples; clipped: {self.n_clipped}")
        text.extend(f"left out: {name}" for name in self.left_out)
        text.extend(f"trap: {trap}" for trap in self.traps)
        return text

    def to_dict(self) -> dict[str, Any]:
        """The report for programs: plain types only."""
        return asdict(self)


@dataclass(frozen=True)
class ImportResult:
    """A recording, the report on how it came about, and how it is best stored.

    `encoding` is for `sloshlab.recording.write_recording`: channels whose file kept raw counts and
    scaling apart are stored so again.
    """

    recording: xr.Dataset
    report: ImportReport
    encoding: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
