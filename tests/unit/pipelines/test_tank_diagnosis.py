"""Cases of the numerical tank: what is believed of the liquid is in the rig, recordings are copied."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pipelines.tank_diagnosis import CASES, TankCase, at_lower_rate, make_case
from sloshlab.errors import InputError
from sloshlab.recording import read_recording

RECORDINGS = "raw_data/numerical_tank"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_has_its_recordings_and_what_is_believed(case: TankCase, repository: Path, tmp_path: Path) -> None:
    folder = tmp_path / case.name
    make_case(repository / RECORDINGS, case, folder)
    rig = tomllib.loads((folder / "rig.toml").read_text())
    assert rig["twin"]["tank_model"] == ("frozen" if "frozen" in case.name else "viscous")
    recordings = [read_recording(path) for path in (folder / "recordings").glob("*.nc")]
    assert len(recordings) >= 5
    maps = ["maps.nc"] if "maps" in case.name else []
    assert sorted(path.name for path in folder.iterdir()) == [*maps, "recordings", "rig.toml"]
    band_hz = 0.5 * min(one.attrs["sampling_rate_hz"] for one in recordings)
    assert all(f < band_hz for f in rig.get("structure", {}).get("frequencies_hz", []))


def test_a_lower_rate_keeps_what_is_slow_where_it_is_and_nothing_that_is_fast() -> None:
    """A tone of 9 Hz and one of 27 Hz, at 512 Hz and then at 32 Hz; the ends of the filter aside."""
    time = np.arange(8192) / 512.0
    slow, fast = (np.sin(2 * np.pi * f * time) for f in (9.0, 27.0))
    variables = {"force": ("time", slow + fast), "quality": ("time", np.zeros(time.size, np.uint8))}
    recording = xr.Dataset(variables, {"time": time}, {"sampling_rate_hz": 512.0})
    lower = at_lower_rate(recording, 16)
    assert lower.attrs["sampling_rate_hz"] == 32.0
    assert np.allclose(np.diff(lower.time), 1 / 32.0)
    assert lower.quality.dtype == np.uint8
    assert np.abs(lower.force.values - slow[::16])[16:-16].max() < 0.01


def test_recordings_that_are_not_there_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="numerical tank"):
        make_case(tmp_path, CASES[0], tmp_path / "case")
    assert not (tmp_path / "case").exists()
