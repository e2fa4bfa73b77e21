"""Cases of the numerical tank: what is believed of the liquid is in the rig, recordings are copied."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import InputError
from sloshlab.recording import read_recording
from studies.tank_diagnosis import CASES, TankCase, at_lower_rate, constant_beyond, make_case, part_of

RECORDINGS = "raw_data/numerical_tank"


@pytest.mark.slow
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
    band_hz = 0.5 * min(recording.attrs["sampling_rate_hz"] for recording in recordings)
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


def recorded(values: np.ndarray, rate_hz: float) -> xr.Dataset:
    variable = xr.Variable("time", values, {"noise_std": 0.4})
    return xr.Dataset(
        {"force": variable}, {"time": np.arange(values.size) / rate_hz}, {"sampling_rate_hz": rate_hz}
    )


def test_a_release_keeps_its_first_displacement() -> None:
    """cos 2π 9 t begins with its largest value; a filter that sees nothing before it halves that."""
    slow = np.cos(2 * np.pi * 9.0 * np.arange(4096) / 1024.0)
    lower = at_lower_rate(recorded(slow, 1024.0), 16)
    assert np.abs(lower.force.values - slow[::16])[:8].max() < 0.01


def test_a_lower_rate_keeps_the_noise_per_band_and_nothing_above_what_is_asked() -> None:
    noise = 0.4 * np.random.default_rng(2).standard_normal(2**17)
    lower = at_lower_rate(recorded(noise, 512.0), 4, below_hz=16.0)
    frequency = np.fft.rfftfreq(lower.force.size, 1 / 128.0)
    power = np.abs(np.fft.rfft(lower.force.values)) ** 2 / lower.force.size
    assert power[frequency < 12.0].mean() == pytest.approx(lower.force.attrs["noise_std"] ** 2, rel=0.05)
    assert power[frequency > 22.0].mean() < 1e-3 * power[frequency < 12.0].mean()


def test_work_beyond_a_level_is_that_of_the_last_known_one_at_the_same_frequency() -> None:
    """ω̄² ū is 0.5, 1, 1.5, 2 g in the first row and four times that in the second; gaps below the level stay."""
    measured = xr.DataArray(
        [[np.nan, 7.0, 5.0, 4.0], [6.0, 9.0, 3.0, 2.0]],
        {"omega_bar": [1.0, 2.0], "u_bar": [0.5, 1.0, 1.5, 2.0]},
        ("omega_bar", "u_bar"),
    )
    known = constant_beyond(measured, 1.6)
    assert known.sel(omega_bar=1.0).values[1:].tolist() == [7.0, 5.0, 5.0]
    assert np.isnan(known.sel(omega_bar=1.0).values[0])
    assert np.isnan(known.sel(omega_bar=2.0).values).all()
    assert constant_beyond(measured, 3.0).sel(omega_bar=2.0).values.tolist() == [6.0, 6.0, 6.0, 6.0]
    xr.testing.assert_identical(constant_beyond(measured, np.inf), measured)


def test_a_part_of_a_recording_begins_with_zero() -> None:
    part = part_of(recorded(np.arange(100.0), 10.0), 2.0, 5.0)
    assert part.force.values.tolist() == list(np.arange(20.0, 50.0))
    assert part.time.values[[0, -1]].tolist() == [0.0, 2.9]


def test_recordings_that_are_not_there_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="numerical tank"):
        make_case(tmp_path, CASES[0], tmp_path / "case")
    assert not (tmp_path / "case").exists()
