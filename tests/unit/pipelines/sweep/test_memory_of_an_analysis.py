"""An analysis of a sweep does not hold its recording."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab.recording import read_recording, write_recording

RATE_HZ, DURATION_S = 10_000.0, 200.0

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")


def memory_bytes(what):
    return 1024 * int(Path("/proc/self/status").read_text().split(f"{what}:")[1].split()[0])


def test_the_peak_of_an_analysis_is_less_than_half_of_the_recording(tmp_path, repository):
    """Held as a whole, channels, their sums and the time are more than all of it (1.3 times, without blocks)."""
    t = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    phase = 2 * np.pi * (5.0 * t + 0.5 * 15.0 / DURATION_S * t**2)
    acceleration = 30.0 * np.cos(phase)
    noise = 0.002 * np.random.default_rng(3).standard_normal((5, t.size))
    names = ["force_cell_1", "force_cell_2", "acceleration_roof_1", "acceleration_roof_2", "acceleration_control"]
    signals = [0.35 * acceleration + 1.5 * np.sin(phase)] * 2 + [acceleration] * 3
    variables = {
        name: ("time", signal + added, {"units": "N", "quantity": "force"})
        if name.startswith("force")
        else ("time", signal + added, {"units": "m s-2", "quantity": "acceleration"})
        for name, signal, added in zip(names, signals, noise, strict=True)
    }
    attributes = {
        "sloshlab_format": "1", "run_id": "long", "experiment": "shaker_sweep", "configuration": "sloshing",
        "rig": "rig_fill_0.50.toml", "sampling_rate_hz": RATE_HZ, "start_time_utc": "2026-01-01T00:00:00Z",
    }  # fmt: skip
    stored = {"dtype": "int16", "scale_factor": 0.002, "_FillValue": np.int16(-32768), "zlib": False}
    file = tmp_path / "long.nc"
    write_recording(
        xr.Dataset(variables, {"time": ("time", t, {"units": "s"})}, attributes),
        file,
        encoding={name: stored for name in names} | {"time": {"zlib": False}},
    )
    del variables, signals, noise, acceleration, phase
    settings = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=False, has_report=False)

    def analysed():
        return analyse_shaker([file], [repository / "raw_data" / "shaker" / "rig_fill_0.50.toml"], settings)

    # compiled and imported before it is measured
    assert analysed().windows.sizes["window"] > 50
    before = memory_bytes("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    analysed()
    peak = memory_bytes("VmHWM") - before
    assert peak < 0.5 * read_recording(file).nbytes
