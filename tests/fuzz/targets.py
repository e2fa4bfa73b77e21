"""Everything that reads what somebody else wrote: good files to damage, and how each is read."""

from __future__ import annotations

import dataclasses
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

TESTS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TESTS / "unit" / "acquisition" / "files"))
import import_scenarios  # noqa: E402

from acquisition.files import describe_source, import_recording  # noqa: E402
from acquisition.files.can_database import read_layout  # noqa: E402
from acquisition.files.can_database_text import dbc_text  # noqa: E402
from acquisition.files.channel_map import SourceSection, read_channel_map  # noqa: E402
from acquisition.recorder.journal import JournalWriter, read_journal  # noqa: E402
from acquisition.samples.channel import Channel  # noqa: E402
from acquisition.samples.delivery import Block, End  # noqa: E402
from acquisition.sources.interface import SourceInfo  # noqa: E402
from acquisition.wire.can_layout import device_database  # noqa: E402
from sloshlab.errors import SloshlabError  # noqa: E402
from sloshlab.recording import read_recording, write_recording  # noqa: E402
from sloshlab.rig import Rig  # noqa: E402

_RIG = """[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.078
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
name = "water"
"""


@dataclass(frozen=True)
class Target:
    """A file name, good contents, and a reader of a file of that name; `prepare` writes what stands beside it."""

    file_name: str
    good: Callable[[Path], list[bytes]]
    read: Callable[[Path], Any]
    prepare: Callable[[Path], Any] = lambda folder: None


def _of_scenario(scenario: import_scenarios.Scenario) -> Target:
    def read(path: Path) -> None:
        both(lambda: describe_source(path), lambda: import_recording([path], path.parent / "map.toml"))

    return Target(
        scenario.file_name,
        lambda folder: [scenario.write(folder)[0].read_bytes()],
        read,
        lambda folder: scenario.write(folder),
    )


def both(*actions: Callable[[], Any]) -> None:
    """All actions, a refusal by one of them included; the last refusal is raised again."""
    refusal: SloshlabError | None = None
    for action in actions:
        try:
            action()
        except SloshlabError as error:
            refusal = error
    if refusal is not None:
        raise refusal


def _mf4_files(folder: Path) -> list[bytes]:
    """With and without compression, invalidation bits and a conversion, and two groups."""
    from asammdf import MDF, Signal

    n = import_scenarios.N_SAMPLES
    counts, times = np.arange(n, dtype=np.uint8), import_scenarios.TIME_S
    signals = [
        Signal(import_scenarios.FORCE_KN, times, unit="kN", name="F"),
        Signal(import_scenarios.ACCELERATION, times, unit="m/s^2", name="a"),
        Signal(counts, times, name="u", invalidation_bits=counts % 3 == 0),
        Signal(counts, times, name="scaled", conversion={"a": 2.0, "b": 1.0}),
    ]
    contents = []
    for compression in (0, 1, 2):
        with MDF(version="4.10") as target:
            target.append(signals)
            target.append(signals[2:])
            target.save(folder / "good.mf4", overwrite=True, compression=compression)
        contents.append((folder / "good.mf4").read_bytes())
    return contents


def _scenario(name: str) -> import_scenarios.Scenario:
    return next(scenario for scenario in import_scenarios.SCENARIOS if scenario.name == name)


def _read_database(path: Path) -> None:
    log = path.parent / "run.asc"
    both(lambda: describe_source(log, SourceSection(database=str(path))), lambda: read_layout(path))


def _databases(folder: Path) -> list[bytes]:
    channels = [Channel("force_cell_1", "force", "N", 32), Channel("acceleration_roof_1", "acceleration", "m s-2")]
    layout = device_database("daq", 1000.0, 1e6, channels)
    return [import_scenarios.DATABASE.encode(), dbc_text(layout).encode("cp1252")]


def _read_journal(path: Path) -> None:
    with read_journal(path) as journal:
        for entries in journal.entries.values():
            for k in range(len(entries)):
                journal.counts(entries[k])


def _journals(folder: Path) -> list[bytes]:
    channels = tuple(Channel(f"acceleration_beam_{k}", "acceleration", "m s-2") for k in range(3))
    info = SourceInfo("bus", "can:x", 1000.0, channels, ((0, 1), (2,)))
    with JournalWriter(folder / "good.journal", {"run_id": "fuzz"}, [info], overwrite=True) as writer:
        for counter in range(0, 60, 6):
            for group, n_channels in enumerate((2, 1)):
                counts = np.arange(6 * n_channels, dtype=np.int32).reshape(6, n_channels)
                writer.append(0, Block(group, 3, counter, counts, counter, counter, counter))
        writer.append(0, End(3, 60))
    return [(folder / "good.journal").read_bytes()]


def _recordings(folder: Path) -> list[bytes]:
    n = 240
    values = np.round(np.sin(np.arange(n)), 2)
    run = xr.Dataset(
        {
            "force_cell_1": ("time", values, {"units": "N", "quantity": "force", "range_max": 10.0}),
            "acceleration_roof_1": ("time", values, {"units": "m s-2", "quantity": "acceleration"}),
            "quality": ("time", np.zeros(n, np.uint8)),
        },
        coords={"time": ("time", np.arange(n) / 100.0, {"units": "s"})},
        attrs={
            "sloshlab_format": "1",
            "run_id": "fuzzed",
            "experiment": "other",
            "configuration": "sloshing",
            "rig": "rig.toml",
            "sampling_rate_hz": 100.0,
            "start_time_utc": "2026-01-31T12:00:00Z",
        },
    )
    counts = {"dtype": "int16", "scale_factor": 0.01, "_FillValue": np.int16(-32768)}
    write_recording(run, folder / "good.nc", encoding={"acceleration_roof_1": counts})
    return [(folder / "good.nc").read_bytes()]


def _maps(folder: Path) -> list[bytes]:
    return [scenario.write(folder)[1].read_bytes() for scenario in import_scenarios.SCENARIOS]


TARGETS: dict[str, Target] = {
    **{scenario.name: _of_scenario(scenario) for scenario in import_scenarios.SCENARIOS},
    "mf4": dataclasses.replace(_of_scenario(_scenario("mf4")), good=_mf4_files),
    "recording": Target("run.nc", _recordings, read_recording),
    "database": Target("rig.dbc", _databases, _read_database, lambda folder: _scenario("can asc").write(folder)),
    "map": Target("map.toml", _maps, read_channel_map),
    "rig": Target("rig.toml", lambda folder: [_RIG.encode()], Rig.from_toml),
    "journal": Target("run.journal", _journals, _read_journal),
}


@cache
def good_contents(name: str) -> tuple[bytes, ...]:
    """What is damaged for a target."""
    with tempfile.TemporaryDirectory() as folder:
        return tuple(TARGETS[name].good(Path(folder)))
