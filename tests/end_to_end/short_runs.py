"""Short runs of the virtual laboratory, ways to spoil them, and what a refusal must look like."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from progress_lines import without_progress

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run, write_virtual_run
from pipelines.command_line import run
from sloshlab.rig import Rig

DURATION_S = 48.0
RATE_HZ = 512.0
INPUT_IS_BAD, USAGE, DONE_BUT_FLAGGED, INTERRUPTED = 1, 2, 3, 130


def short_run(*, fill_level: float = 0.5, **settings: Any) -> xr.Dataset:
    """A sweep of 48 s at 512 Hz; settings as for `virtual_shaker_run`."""
    chosen = {"acceleration_g": 3.0, "seed": 1, "duration_s": DURATION_S, "sampling_rate_hz": RATE_HZ, **settings}
    chosen.setdefault("rig_name", "rig.toml")
    return virtual_shaker_run(Rig.from_toml_text(rig_text(fill_level)), **chosen)


def make_laboratory(folder: Path) -> None:
    """``rig.toml``, two good sweeps and an empty run."""
    (folder / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    write_virtual_run(short_run(acceleration_g=1.5), folder / "sweep_1.5g.nc")
    write_virtual_run(short_run(acceleration_g=3.0), folder / "sweep_3g.nc")
    write_virtual_run(short_run(configuration="empty", seed=2), folder / "empty.nc")


def edited(source: Path, target: Path, edit: Callable[[netCDF4.Dataset], None]) -> Path:
    """A copy of a recording with raw edits, no check, no scaling."""
    shutil.copy(source, target)
    with netCDF4.Dataset(target, "a") as recording:
        recording.set_auto_maskandscale(False)
        edit(recording)
    return target


def cut_out(recording: xr.Dataset, start_s: float, stop_s: float) -> xr.Dataset:
    """The samples of [start, stop) with their times."""
    time = recording["time"].values
    return recording.isel(time=np.flatnonzero((time >= start_s) & (time < stop_s)))


def shaker_arguments(runs: Sequence[Path | str], rigs: Sequence[Path | str], output: Path) -> list[str]:
    """Arguments of ``sloshlab shaker`` without a report."""
    options = [part for rig in rigs for part in ("--rig", str(rig))]
    return ["shaker", *map(str, runs), *options, "-o", str(output), "--no-report"]


def refusal(capsys: Any, arguments: Sequence[str], output: Path, *fragments: str) -> str:
    """The one line on stderr with which the command ends; exit 1, nothing on stdout, nothing written."""
    before = contents(output)
    capsys.readouterr()
    code = run(list(arguments))
    captured = capsys.readouterr()
    assert code == INPUT_IS_BAD, f"exit {code}: {captured.err}"
    assert captured.out == ""
    assert_one_line(captured.err, *fragments)
    assert contents(output) == before
    assert leftovers(output.parent) == []
    return str(captured.err)


def assert_one_line(stderr: str, *fragments: str) -> None:
    """One line besides those of progress, no traceback, and every fragment in it."""
    stderr = without_progress(stderr)
    assert stderr.startswith("sloshlab: ")
    assert stderr.endswith("\n")
    assert stderr.count("\n") == 1, stderr
    assert "Traceback" not in stderr
    for fragment in fragments:
        assert fragment in stderr, f"{fragment!r} is not in {stderr!r}"


def contents(folder: Path) -> dict[str, bytes] | None:
    """Bytes of every file below a folder, None if there is no such folder."""
    if not folder.is_dir():
        return None
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def leftovers(folder: Path) -> list[str]:
    """Temporary files and folders that an atomic write would have removed."""
    return sorted(path.name for path in folder.rglob("*") if ".part" in path.name or path.name.startswith("."))
