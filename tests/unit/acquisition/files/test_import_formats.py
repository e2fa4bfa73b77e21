"""The same two signals through every format come out as the same recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from import_scenarios import ACCELERATION, COUNTS, FORCE_KN, N_SAMPLES, RATE_HZ, SCENARIOS, Scenario

from acquisition.files import describe_source, import_recording
from sloshlab.recording import read_recording, write_recording


@pytest.fixture(params=SCENARIOS, ids=[scenario.name for scenario in SCENARIOS])
def scenario(request: pytest.FixtureRequest) -> Scenario:
    return request.param


def test_values_units_and_signs_are_exact(scenario: Scenario, tmp_path: Path) -> None:
    path, map_path = scenario.write(tmp_path)
    recording = import_recording([path], map_path).recording
    np.testing.assert_array_equal(recording["force_cell_1"].values, FORCE_KN * 1000.0)
    np.testing.assert_array_equal(recording["acceleration_roof_1"].values, -ACCELERATION)
    assert recording["force_cell_1"].attrs["units"] == "N"
    assert recording["acceleration_roof_1"].attrs["units"] == "m s-2"


def test_time_base(scenario: Scenario, tmp_path: Path) -> None:
    path, map_path = scenario.write(tmp_path)
    recording = import_recording([path], map_path).recording
    # python-can's BLF times are float64 seconds since 1970, good to 2.4e-7 s
    rtol = 1e-5 if scenario.name == "can blf" else 1e-12
    assert recording.attrs["sampling_rate_hz"] == pytest.approx(RATE_HZ, rel=rtol)
    time = recording["time"].values
    assert time.size == N_SAMPLES
    np.testing.assert_allclose(np.diff(time), 1 / RATE_HZ, rtol=1e-5)
    assert time[0] == pytest.approx(0.0, abs=1e-6)


def test_report_accounts_for_everything(scenario: Scenario, tmp_path: Path) -> None:
    path, map_path = scenario.write(tmp_path)
    report = import_recording([path], map_path).report
    assert [channel.channel for channel in report.mapped] == ["force_cell_1", "acceleration_roof_1"]
    assert [channel.factor for channel in report.mapped] == [1000.0, -1.0]
    assert [channel.n_samples for channel in report.mapped] == [N_SAMPLES, N_SAMPLES]
    assert (report.n_lost, report.n_clipped, report.is_flagged) == (0, 0, False)
    assert report.to_dict()["n_samples"] == N_SAMPLES
    assert any("force_cell_1" in line for line in report.lines())


def test_stored_and_read_again(scenario: Scenario, tmp_path: Path) -> None:
    path, map_path = scenario.write(tmp_path)
    result = import_recording([path], map_path)
    target = tmp_path / "out" / "run.nc"
    write_recording(result.recording, target, encoding=result.encoding)
    again = read_recording(target)
    np.testing.assert_array_equal(again["force_cell_1"].values, FORCE_KN * 1000.0)
    np.testing.assert_array_equal(again["acceleration_roof_1"].values, -ACCELERATION)


def test_description_lists_both_columns(scenario: Scenario, tmp_path: Path) -> None:
    path, _ = scenario.write(tmp_path)
    description = describe_source(path)
    assert all(column.n_samples == N_SAMPLES for column in description.columns)
    if not scenario.name.startswith("can"):
        spans = {(column.minimum, column.maximum) for column in description.columns}
        assert (FORCE_KN.min(), FORCE_KN.max()) in spans
        assert (ACCELERATION.min(), ACCELERATION.max()) in spans
    assert description.to_dict()["format"] == description.format
    assert len(description.lines()) > len(description.columns)


def test_raw_counts_are_stored_as_counts(tmp_path: Path) -> None:
    counts = next(scenario for scenario in SCENARIOS if scenario.name == "tdms counts")
    path, map_path = counts.write(tmp_path)
    result = import_recording([path], map_path)
    assert result.encoding["force_cell_1"]["dtype"] == "int16"
    target = tmp_path / "run.nc"
    write_recording(result.recording, target, encoding=result.encoding)
    import netCDF4

    with netCDF4.Dataset(target) as stored:
        stored.set_auto_maskandscale(False)
        np.testing.assert_array_equal(stored["force_cell_1"][:], COUNTS)
        assert stored["acceleration_roof_1"].scale_factor == -0.5
