"""Recordings in memory: units, identity, and all ways to hand them over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from pipelines.inputs.recordings import RecordingInMemory, attributes_of, recording_of, run_sources
from sloshlab.errors import InputError, RecordingError
from sloshlab.recording import read_recording, write_recording


def recording(units: str = "m", factor: float = 1.0, **attributes: Any) -> xr.Dataset:
    """A displacement of a hundred samples in some unit."""
    time = np.arange(100) / 50.0
    described = {
        "units": units, "quantity": "displacement", "noise_std": 1e-4 * factor, "range_max": 0.5 * factor
    }  # fmt: skip
    return xr.Dataset(
        {"displacement_table": ("time", factor * 0.01 * np.sin(7 * time), described)},
        {"time": ("time", time, {"units": "s"})},
        {
            "sloshlab_format": "1",
            "run_id": "run 7",
            "experiment": "other",
            "configuration": "sloshing",
            "rig": "rig.toml",
            "sampling_rate_hz": 50.0,
            "start_time_utc": "2026-01-01T00:00:00Z",
            **attributes,
        },
    )


def test_a_recording_in_millimetres_is_read_as_its_file_is(tmp_path: Path) -> None:
    """The reader of files converts by a way of its own."""
    given = recording("mm", 1e3)
    write_recording(given, tmp_path / "run.nc")
    of_file, of_memory = read_recording(tmp_path / "run.nc"), RecordingInMemory.of(given).recording
    np.testing.assert_allclose(of_memory["displacement_table"], of_file["displacement_table"], rtol=1e-15)
    np.testing.assert_allclose(of_memory["displacement_table"], recording()["displacement_table"], rtol=1e-15)
    for name in ("units", "noise_std", "range_max"):
        assert of_memory["displacement_table"].attrs[name] == of_file["displacement_table"].attrs[name]
    xr.testing.assert_identical(given, recording("mm", 1e3))


def test_the_hash_is_that_of_the_content() -> None:
    same, other = RecordingInMemory.of(recording(), "a"), RecordingInMemory.of(recording(), "b")
    assert same.sha256 == other.sha256
    changed = recording()
    changed["displacement_table"].values[50] += 1e-12
    assert RecordingInMemory.of(changed).sha256 != same.sha256
    assert RecordingInMemory.of(recording(repeat=2)).sha256 != same.sha256


def test_what_breaks_the_format_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"run 7: displacement_table: units.*N"):
        RecordingInMemory.of(recording("N"))
    with pytest.raises(RecordingError, match=r"sampling_rate_hz: got 20 Hz"):
        RecordingInMemory.of(recording(sampling_rate_hz=20.0))
    decoded = recording().assign_coords(time=np.arange(100) * np.timedelta64(20, "ms"))
    with pytest.raises(RecordingError, match=r"remedy: read the file with sloshlab.open_recording"):
        RecordingInMemory.of(decoded)


def test_all_ways_to_hand_over_the_same(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    write_recording(recording(), path)
    tree = xr.DataTree.from_dict({"level/a": recording(), "b": recording()})
    named = [
        [str(source) for source in run_sources(given)]
        for given in (path, str(path), [path, recording()], recording(), {"x": recording(), "y": path}, tree)
    ]
    assert named == [
        [str(path)], [str(path)], [str(path), "run 7"], ["run 7"], ["x", str(path)], ["b", "level/a"]
    ]  # fmt: skip
    [of_file], [of_memory] = run_sources(path), run_sources(recording())
    xr.testing.assert_equal(recording_of(of_file), recording_of(of_memory))
    assert attributes_of(of_file) == attributes_of(of_memory)


@pytest.mark.parametrize(
    ("given", "words"),
    [([], "recordings: got none"), ([3], "type int"), (7, "type int"), ({"x": None}, "NoneType")],
)
def test_what_is_no_recording_is_refused(given: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        run_sources(given)
