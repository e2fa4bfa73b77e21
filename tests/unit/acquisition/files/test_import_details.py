"""Details that one format or one option has to itself."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from import_scenarios import ACCELERATION, COUNTS, FORCE_KN, N_SAMPLES, RUN, TIME_S, _uff_set

from acquisition.files import describe_source, import_recording
from acquisition.files.delay_compensation import HALF_LENGTH, delay_compensated
from sloshlab.errors import ChannelMapError, FileFormatError
from sloshlab.recording import read_recording, write_recording


def map_file(folder: Path, source: str, channel: str = 'column = "F"\nunits = "kN"') -> Path:
    path = folder / "map.toml"
    path.write_text(f"{RUN}\n[source]\n{source}\n[channels.force_cell_1]\n{channel}\n", encoding="utf-8")
    return path


def csv_file(path: Path, columns: dict[str, list[str]]) -> Path:
    rows = [",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_fractional_delay_loses_the_samples_around_a_gap() -> None:
    values = np.sin(0.3 * np.arange(400))
    values[200] = np.nan
    moved = delay_compensated(values, 0.25)
    lost = np.r_[0:HALF_LENGTH, 200 - HALF_LENGTH : 201 + HALF_LENGTH, 400 - HALF_LENGTH : 400]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(moved)), lost)


def test_clipping_flags_move_with_the_delayed_samples(tmp_path: Path) -> None:
    force = ["0.0"] * 20
    force[10] = "5.0"
    path = csv_file(tmp_path / "run.csv", {"t": [f"{k / 100}" for k in range(20)], "F": force})
    channel = 'column = "F"\nunits = "N"\nrange_max = 5.0\ndelay_s = 0.03'
    recording = import_recording([path], map_file(tmp_path, 'time = "t"', channel)).recording
    np.testing.assert_array_equal(np.flatnonzero(recording["quality"].values & 2), [7])
    assert recording["force_cell_1"].values[7] == 5.0


def test_fortran_exponents(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "run.csv", {"t": ["0", "1", "2"], "F": ["1.5D+00", "-2.5D-01", "3.0D+02"]})
    recording = import_recording([path], map_file(tmp_path, 'time = "t"')).recording
    np.testing.assert_array_equal(recording["force_cell_1"].values, [1500.0, -250.0, 300_000.0])


def test_text_among_numbers_is_named(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "run.csv", {"t": ["0", "1", "2"], "F": ["1.5", "over", "3.0"]})
    with pytest.raises(ChannelMapError, match="the first 'over' in data row 2"):
        import_recording([path], map_file(tmp_path, 'time = "t"'))


def test_starts_a_fraction_of_a_step_apart_are_refused(tmp_path: Path) -> None:
    first = csv_file(tmp_path / "a.csv", {"t": ["0", "1", "2"], "F": ["1", "2", "3"]})
    second = csv_file(tmp_path / "b.csv", {"t": ["0.25", "1.25", "2.25"], "V": ["1", "2", "3"]})
    channels = 'column = "F"\nunits = "kN"\n[channels.voltage_x]\ncolumn = "V"\nunits = "V"'
    with pytest.raises(ChannelMapError, match=r"voltage_x: time: got a start 0\.25 steps"):
        import_recording([first, second], map_file(tmp_path, 'time = "t"\njoin = "channels"', channels))


def test_lvm_whose_x_starts_again_is_two_records(tmp_path: Path) -> None:
    head = ["LabVIEW Measurement\t", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tOne"]
    head += ["***End_of_Header***\t", "\t", "Channels\t1\t", "Samples\t6\t", "Y_Unit_Label\tkN\t", "X0\t0.0\t"]
    head += ["Delta_X\t0.25\t", "***End_of_Header***\t\t", "X_Value\tF\tComment"]
    rows = [f"{t}\t{f}" for t, f in zip([0, 0.25, 0.5] * 2, range(6), strict=True)]
    path = tmp_path / "run.lvm"
    path.write_text("\n".join(head + rows) + "\n", encoding="utf-8")
    result = import_recording([path], map_file(tmp_path, "segment = 2"))
    np.testing.assert_array_equal(result.recording["force_cell_1"].values, [3000.0, 4000.0, 5000.0])
    assert any("X_Value starts again" in trap for trap in result.report.traps)


def test_uff_numbers_after_the_declared_ones_are_left_out(tmp_path: Path) -> None:
    whole = _uff_set(FORCE_KN, "F", "kN", binary=False)
    path = tmp_path / "run.uff"
    path.write_bytes(whole.replace(f"{4:10d}{N_SAMPLES:10d}".encode(), f"{4:10d}{60:10d}".encode()))
    result = import_recording([path], map_file(tmp_path, ""))
    np.testing.assert_array_equal(result.recording["force_cell_1"].values, FORCE_KN[:60] * 1000)
    assert any("4 numbers after the 60 declared" in trap for trap in result.report.traps)


def test_mf4_invalid_samples_are_lost(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    invalid = np.isin(np.arange(N_SAMPLES), [5, 6])
    path = tmp_path / "run.mf4"
    with MDF(version="4.10") as target:
        target.append([Signal(FORCE_KN, TIME_S, name="F", invalidation_bits=invalid)])
        target.save(path, overwrite=True)
    recording = import_recording([path], map_file(tmp_path, "")).recording
    np.testing.assert_array_equal(np.flatnonzero(recording["quality"].values), [5, 6])


def test_mf4_chain_that_bites_its_tail_is_refused(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    path = tmp_path / "run.mf4"
    with MDF(version="4.10") as target:
        target.append([Signal(FORCE_KN, TIME_S, name="F")])
        target.save(path, overwrite=True)
    content = bytearray(path.read_bytes())
    at = content.index(b"##DG")
    content[at + 24 : at + 32] = struct.pack("<Q", at)
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="chain of blocks that returns"):
        describe_source(path)


def test_netcdf_time_in_milliseconds(tmp_path: Path) -> None:
    import netCDF4

    path = tmp_path / "run.nc"
    with netCDF4.Dataset(path, "w") as target:
        target.createDimension("t", N_SAMPLES)
        clock = target.createVariable("t", "f8", ("t",))
        clock.units = "milliseconds since 2026-01-31 12:00:00"
        clock[:] = TIME_S * 1000
        target.createVariable("F", "f8", ("t",))[:] = FORCE_KN
    recording = import_recording([path], map_file(tmp_path, "")).recording
    assert recording.attrs["sampling_rate_hz"] == pytest.approx(512.0, rel=1e-12)


def test_links_out_of_a_mat_file_are_not_followed(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["F"] = FORCE_KN
    with h5py.File(tmp_path / "run.mat", "w") as target:
        target["a"] = ACCELERATION
        target["F"] = h5py.ExternalLink("secret.h5", "/F")
    assert describe_source(tmp_path / "run.mat").unusable == {"F": "a link, not followed"}


def test_counts_with_calibration_and_offset_are_stored_as_counts(tmp_path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    properties = {
        "wf_increment": 1 / 512,
        "unit_string": "V",
        "NI_Number_Of_Scales": 1,
        "NI_Scaling_Status": "unscaled",
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.25,
        "NI_Scale[0]_Linear_Y_Intercept": 3.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }
    path = tmp_path / "run.tdms"
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([ChannelObject("rig", "F", COUNTS.astype(np.int16), properties)])
    channel = 'column = "F"\ncalibration = { factor = 2.0, offset = 5.0, from = "V", to = "N" }'
    result = import_recording([path], map_file(tmp_path, "", channel))
    write_recording(result.recording, tmp_path / "run.nc", encoding=result.encoding)
    assert result.encoding["force_cell_1"]["dtype"] == "int16"
    stored = read_recording(tmp_path / "run.nc")["force_cell_1"].values
    np.testing.assert_array_equal(stored, 2.0 * (COUNTS * 0.25 + 3.0) + 5.0)
