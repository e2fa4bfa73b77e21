"""The recording format: what is read, what is kept, and what writing refuses."""

from __future__ import annotations

from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr
from hostile_hdf5 import HOSTILE

from sloshlab.errors import RecordingError
from sloshlab.recording import (
    channels,
    read_attributes,
    read_attributes_of_many,
    read_recording,
    validate_recording,
    write_recording,
)

RATE_HZ = 512.0


def recording(n: int = 1000) -> xr.Dataset:
    time = np.arange(n) / RATE_HZ
    return xr.Dataset(
        {
            "force_cell_1": ("time", np.sin(time), {"units": "kN", "quantity": "force", "range_max": 0.2}),
            "acceleration_roof_1": ("time", np.cos(time), {"units": "m s-2", "quantity": "acceleration"}),
            "temperature": ("time", np.full(n, 293.0), {"units": "K"}),
            "note": ((), 3.0),
        },
        coords={"time": ("time", time, {"units": "s"})},
        attrs={
            "sloshlab_format": "1",
            "run_id": "r1",
            "experiment": "other",
            "configuration": "sloshing",
            "rig": "rig.toml",
            "sampling_rate_hz": RATE_HZ,
            "start_time_utc": "2026-01-31T12:00:00Z",
            "weather": "rain",
        },
    )


def test_channels_are_converted_once_and_everything_else_is_kept(tmp_path: Path):
    write_recording(recording(), tmp_path / "run.nc")
    back = read_recording(tmp_path / "run.nc")
    assert channels(back) == ["acceleration_roof_1", "force_cell_1"]
    assert channels(back, "force") == ["force_cell_1"]
    time = np.arange(1000) / RATE_HZ
    np.testing.assert_allclose(back.force_cell_1, 1000 * np.sin(time), rtol=1e-14)
    assert back.force_cell_1.attrs["units"] == "N"
    assert back.force_cell_1.attrs["range_max"] == pytest.approx(200.0)
    np.testing.assert_array_equal(back.temperature, 293.0)
    assert back.temperature.attrs["units"] == "K"
    assert float(back.note) == 3.0
    assert back.attrs["weather"] == "rain"
    assert read_attributes(tmp_path / "run.nc").run_id == "r1"
    assert (read_attributes(tmp_path / "run.nc").model_extra or {})["weather"] == "rain"


def test_scaled_integers_with_an_offset(tmp_path: Path):
    """Stored count k, scale 0.5 and offset 2 mean 0.5 k + 2 mm."""
    write_recording(recording(), tmp_path / "run.nc")
    with netCDF4.Dataset(tmp_path / "run.nc", "a") as file:
        channel = file.createVariable("displacement_tank", "i2", ("time",))
        channel.setncatts({"units": "mm", "quantity": "displacement", "scale_factor": 0.5, "add_offset": 2.0})
        channel.set_auto_maskandscale(False)
        channel[:] = np.arange(1000, dtype="i2") - 500
    expected = 1e-3 * (0.5 * (np.arange(1000) - 500) + 2.0)
    np.testing.assert_allclose(
        read_recording(tmp_path / "run.nc").displacement_tank, expected, rtol=1e-6, atol=1e-9
    )


@pytest.mark.parametrize("jitter_steps", [0.9e-6, 1.5e-6])
def test_jitter_of_a_millionth_of_a_step_is_the_limit(jitter_steps: float):
    run = recording()
    time = run.time.values.copy()
    time[500] += jitter_steps / RATE_HZ
    run = run.assign_coords(time=("time", time, {"units": "s"}))
    if jitter_steps < 1e-6:
        validate_recording(run)
        return
    with pytest.raises(RecordingError, match=r"not uniform: got jitter of 1\.5e-06 steps.*sample 500"):
        validate_recording(run)


@pytest.mark.parametrize("start_s", [-3.0, 0.0, 1e5])
def test_any_start_is_uniform(start_s: float):
    run = recording()
    validate_recording(run.assign_coords(time=("time", start_s + run.time.values, {"units": "s"})))


@pytest.mark.parametrize("rate_hz", [2e-311, 1e-307, 1e-300, 1e308])
def test_a_rate_at_the_ends_of_all_numbers_is_refused(rate_hz: float):
    with pytest.raises(RecordingError, match=r"sampling_rate_hz: got"):
        validate_recording(recording().assign_attrs(sampling_rate_hz=rate_hz))


def test_memory_is_bounded_before_anything_is_read(tmp_path: Path):
    write_recording(recording(), tmp_path / "run.nc")
    with pytest.raises(RecordingError, match="1000 samples"):
        read_recording(tmp_path / "run.nc", maximum_decoded_bytes=10_000)


@pytest.mark.parametrize(
    ("spoil", "what"),
    [
        (lambda r: r.drop_vars("time"), "time"),
        (lambda r: r.isel(time=slice(0, 1)), "1 samples"),
        (lambda r: r.drop_vars(["force_cell_1", "acceleration_roof_1"]), "channels"),
        (lambda r: r.assign_attrs(run_id=""), "run_id"),
        (lambda r: r.assign(force_cell_1=r.force_cell_1.assign_attrs(units="m")), "force_cell_1"),
        (lambda r: r.assign(force_cell_1=r.force_cell_1.where(r.time > 0.5)), "NaN samples"),
        (lambda r: r.assign(force_cell_1=r.force_cell_1 / 0.0), "force_cell_1"),
        (lambda r: r.assign(quality=("time", np.zeros(1000))), "quality"),
    ],
)
def test_writing_refuses_what_reading_would(spoil, what: str, tmp_path: Path):
    with np.errstate(divide="ignore", invalid="ignore"), xr.set_options(keep_attrs=True):
        bad = spoil(recording())
    with pytest.raises(RecordingError, match=what):
        write_recording(bad, tmp_path / "run.nc")
    assert list(tmp_path.iterdir()) == []


def test_lost_samples_are_nan_and_flagged(tmp_path: Path):
    run = recording()
    run.force_cell_1.values[10:20] = np.nan
    flags = np.zeros(1000, np.uint8)
    flags[10:20] = 1
    run["quality"] = ("time", flags)
    write_recording(run, tmp_path / "run.nc")
    back = read_recording(tmp_path / "run.nc")
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(back.force_cell_1)), np.arange(10, 20))
    np.testing.assert_array_equal(back.quality, flags)


@pytest.mark.parametrize("damage", HOSTILE)
def test_what_lies_outside_of_a_recording_is_refused(damage, tmp_path):
    """An HDF5 file may name other files, whose bytes would become samples; or contain itself without end."""
    put, said = HOSTILE[damage]
    write_recording(recording(), tmp_path / "run.nc")
    with h5py.File(tmp_path / "run.nc", "a") as file:
        put(file, "force_cell_9", tmp_path)
    for read in (read_recording, read_attributes):
        with pytest.raises(RecordingError, match=rf"run\.nc: force_cell_9.*: got {said}"):
            read(tmp_path / "run.nc")


def test_attributes_of_many_are_those_of_each_and_a_bad_one_is_named(tmp_path, repository) -> None:
    runs = sorted((repository / "raw_data" / "shaker").glob("fill_0.50_sweep_*g.nc"))[:3]
    assert read_attributes_of_many(runs) == [read_attributes(run) for run in runs]
    cut = tmp_path / "cut.nc"
    cut.write_bytes(runs[0].read_bytes()[:5000])
    with pytest.raises(RecordingError, match=r"cut\.nc"):
        read_attributes_of_many([runs[0], cut, runs[1]])
    with pytest.raises(RecordingError, match=r"nowhere\.nc.*no such file"):
        read_attributes_of_many([runs[0], tmp_path / "nowhere.nc"])
