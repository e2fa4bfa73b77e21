"""Journals of made-up devices, for tests of what is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from acquisition.recorder.assembly import AssemblyOptions, AssemblySummary, assemble
from acquisition.recorder.journal import JournalWriter, read_journal
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End
from acquisition.sources.interface import SourceInfo
from sloshlab.recording import read_recording

RATE_HZ = 512.0
ORIGIN_NS = 5_000_000_000_000
UTC_NS = 1_790_000_000_000_000_000
STREAM = 77
ATTRIBUTES = {"run_id": "run", "experiment": "other", "configuration": "frozen"}

FORCE = Channel("force_cell_1", "force", "N", 16, 0.5, range_min=-10_000.0, range_max=10_000.0)
ACCELERATION = Channel("acceleration_roof_1", "acceleration", "m s-2", 16, 0.25)


def device(
    *channels: Channel, groups: tuple[tuple[int, ...], ...] = (), name: str = "daq", **more: Any
) -> SourceInfo:
    chosen = channels or (FORCE, ACCELERATION)
    return SourceInfo(name, f"sim:{name}", more.pop("rate_hz", RATE_HZ), chosen,
                      groups or (tuple(range(len(chosen))),), **more)  # fmt: skip


def ramp(start: int, stop: int, n_channels: int = 2) -> np.ndarray:
    """Counts that tell their own place: channel k of sample i is i + 1000·k, plus a toggling bit."""
    i = np.arange(start, stop)[:, None]
    return (i + 1000 * np.arange(n_channels)).astype(np.int32)


def block(
    start: int, stop: int, *, group: int = 0, stream: int = STREAM, counts: np.ndarray | None = None,
    n_channels: int = 2, late_s: float = 0.0, ticks: int | None = None,
) -> Block:  # fmt: skip
    """Samples `start` … `stop` − 1, read 1 ms after the last was taken."""
    ns = round((stop / RATE_HZ + 1e-3 + late_s) * 1e9)
    values = ramp(start, stop, n_channels) if counts is None else counts
    return Block(group, stream, start, values, ticks, ORIGIN_NS + ns, UTC_NS + ns)


def blocks(n_samples: int, n_each: int = 16, **more: Any) -> list[Delivery]:
    return [block(k, min(k + n_each, n_samples), **more) for k in range(0, n_samples, n_each)]


@dataclass
class Made:
    summary: AssemblySummary
    recording: xr.Dataset
    raw: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def flags(self) -> str:
        return "\n".join(self.summary.flags)

    @property
    def lines(self) -> str:
        return "\n".join(self.summary.lines)

    @property
    def quality(self) -> np.ndarray:
        return self.recording["quality"].values

    @property
    def losses(self) -> list[list[int | None]]:
        return self.summary.record["losses"]["rows"]


def write(
    path: Path,
    infos: Sequence[SourceInfo],
    deliveries: Sequence[tuple[int, Delivery]],
    *,
    attributes: Mapping[str, Any] | None = None,
    is_closed: bool = True,
) -> None:
    """A journal with these deliveries in this order."""
    journal = JournalWriter(path, {"attributes": dict(ATTRIBUTES, **(attributes or {}))}, infos)
    for source, delivery in deliveries:
        journal.append(source, delivery)
    if is_closed:
        journal.close()
    else:
        journal.abandon()


def made(
    folder: Path,
    deliveries: Sequence[Delivery | tuple[int, Delivery]],
    *infos: SourceInfo,
    options: AssemblyOptions | None = None,
    **more: Any,
) -> Made:
    """The recording that these deliveries become, read back; counts as they are on disk in `raw`."""
    import netCDF4

    numbered = [delivery if isinstance(delivery, tuple) else (0, delivery) for delivery in deliveries]
    path = folder / "run.journal"
    path.unlink(missing_ok=True)
    write(path, infos or [device()], numbered, **more)
    with read_journal(path) as journal:
        summary = assemble(journal, folder / "run.nc", options)
    with netCDF4.Dataset(folder / "run.nc") as source:
        source.set_auto_maskandscale(False)
        raw = {name: variable[:] for name, variable in source.variables.items()}
    return Made(summary, read_recording(folder / "run.nc"), raw)


def ended(deliveries: Sequence[Delivery], n_samples: int | None, stream: int = STREAM) -> list[Delivery]:
    return [*deliveries, End(stream, n_samples)]
