"""Two devices, their blocks, and what a journal of them holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.recorder.journal import Journal, JournalWriter, read_journal
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, End, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo

DAQ = SourceInfo(
    "daq",
    "serial:/dev/ttyUSB0",
    1000.0,
    (
        Channel(
            "force_cell_1", "force", "N", 24, 1e-5, 0.1, missing_count=-(2**23), range_min=-20.0, range_max=20.0
        ),
        Channel("force_cell_2", "force", "N", 24, 2e-5, sensor_serial="Ä 17", block_from="shaker"),
    ),
    ((0, 1),),
    clock_hz=1e6,
)

BUS = SourceInfo(
    "bus",
    "can:virtual",
    500.0,
    tuple(Channel(f"acceleration_roof_{k}", "acceleration", "m s-2") for k in (1, 2, 3)),
    ((0, 2), (1,)),
)

DAQ_BY_HAND = {
    "device": "daq",
    "url": "serial:/dev/ttyUSB0",
    "sampling_rate_hz": 1000.0,
    "clock_hz": 1e6,
    "groups": [[0, 1]],
    "channels": [
        {"name": "force_cell_1", "quantity": "force", "units": "N", "bits": 24, "scale_factor": 1e-5,
         "add_offset": 0.1, "missing_count": -8388608, "range_min": -20.0, "range_max": 20.0, "noise_std": None,
         "x_m": None, "block_from": None, "block_to": None, "sensor_serial": None},
        {"name": "force_cell_2", "quantity": "force", "units": "N", "bits": 24, "scale_factor": 2e-5,
         "add_offset": 0.0, "missing_count": None, "range_min": None, "range_max": None, "noise_std": None,
         "x_m": None, "block_from": "shaker", "block_to": None, "sensor_serial": "Ä 17"},
    ],
}  # fmt: skip


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000

    def __call__(self) -> int:
        return self.now_ns


def block(
    counter: int, counts: list | np.ndarray, *, group: int = 0, stream: int = 7, **times: int | None
) -> Block:
    values = np.asarray(counts, np.int32)
    known = {"clock_ticks": 5 * counter, "host_monotonic_ns": 10**6 * counter, "host_utc_ns": 10**18 + counter}
    return Block(group, stream, counter, values, **{**known, **times})


def entries_of(journal: Journal) -> list:
    return [
        journal.entries[place][k] for place in sorted(journal.entries) for k in range(len(journal.entries[place]))
    ]


def blocks_of(journal: Journal) -> dict[tuple[int, int, int, int], list]:
    """What a journal holds: counts by (source, group, stream, counter)."""
    return {
        (entry.source, entry.group, entry.stream, entry.counter): journal.counts(entry).tolist()
        for entry in entries_of(journal)
    }


def read_blocks(path: Path) -> dict[tuple[int, int, int, int], list]:
    with read_journal(path) as journal:
        return blocks_of(journal)


def small_journal(path: Path) -> tuple[bytes, list[tuple[int, tuple[int, int, int, int], list]]]:
    """A small journal; its bytes and, per samples block, where it ends, its key and its counts."""
    written = []
    with JournalWriter(path, {"a": 1}, [DAQ, BUS]) as writer:
        for counter, counts in ((0, [[1, 2], [3, 4]]), (2, [[5, 6]]), (9, [[70000, -8], [9, 10], [11, 12]])):
            writer.append(0, block(counter, counts))
            written.append((writer.n_bytes, (0, 0, 7, counter), counts))
            writer.append(1, block(counter, [[counter]], group=1, stream=1))
            written.append((writer.n_bytes, (1, 1, 1, counter), [[counter]]))
            writer.append(0, Trouble(TroubleKind.OVERRUN, "x", 1, 5))
        writer.append(0, End(7, 12))
    return path.read_bytes(), written
