"""Files of other laboratories import without loss, or end in one clear line."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from acquisition.files import describe_source, import_recording
from sloshlab.errors import FileFormatError, InputError, RecordingError

pytestmark = pytest.mark.external

RUN = """
[run]
experiment = "other"
configuration = "frozen"
start_time_utc = "2020-01-01T00:00:00Z"
"""


def mapped(folder: Path, body: str) -> Path:
    path = folder / "map.toml"
    path.write_text(RUN + body, encoding="utf-8")
    return path


@pytest.mark.slow
def test_every_file_is_described_or_refused_in_one_line(external_data: Path) -> None:
    files = [path for path in sorted(external_data.rglob("*")) if path.is_file()]
    described = 0
    refusals: list[str] = []
    for path in files:
        try:
            description = describe_source(path)
        except InputError as error:
            refusals.append(str(error))
            continue
        described += 1
        assert description.columns, path
    assert described >= 40
    assert not [refusal for refusal in refusals if "\n" in refusal]


@pytest.mark.slow
def test_every_reading_column_of_the_formats_imports(external_data: Path, tmp_path: Path) -> None:
    """Each column with a rate becomes a channel with the same number of samples, all of them kept."""
    imported = 0
    for path in sorted((external_data / "formats").rglob("*")):
        if path.suffix not in (".uff", ".lvm", ".tdms"):
            continue
        try:
            description = describe_source(path)
        except FileFormatError:
            continue
        for column in description.columns:
            if column.rate_hz is None or "[segment" in column.name:
                continue
            body = f"[source]\naccept_truncated = true\n[channels.voltage_x]\ncolumn = {column.number}\n"
            map_path = mapped(tmp_path, body + 'units = "V"\nunits_override = true\n')
            result = import_recording([path], map_path)
            values = result.recording["voltage_x"].values
            assert np.isfinite(values).sum() == column.n_samples - column.n_not_a_number
            assert (np.nanmin(values), np.nanmax(values)) == (column.minimum, column.maximum)
            imported += 1
    assert imported >= 25


@pytest.mark.parametrize("level", [1, 3, 5, 7])
def test_f16_sweeps(level: int, external_data: Path, repository: Path) -> None:
    import scipy.io

    path = external_data / "f16" / f"F16Data_SineSw_Level{level}.mat"
    result = import_recording([path], repository / "docs" / "examples" / "f16_sweep.toml")
    source = scipy.io.loadmat(path)
    recording = result.recording
    assert recording.attrs["sampling_rate_hz"] == 400.0
    np.testing.assert_array_equal(recording["force_shaker"].values, source["Force"][0])
    np.testing.assert_array_equal(recording["voltage_shaker"].values, source["Voltage"][0])
    for row, place in enumerate(("shaker", "wing", "payload")):
        np.testing.assert_array_equal(recording[f"acceleration_{place}"].values, source["Acceleration"][row])
    assert result.report.left_out == ()
    assert not result.report.is_flagged


class TestLvmWithTwoHits:
    NAME = Path("formats") / "lvm" / "long_single_header_multi_ch.lvm"

    def body(self, segment: str, units: str = 'units = "N"\nunits_override = true') -> str:
        return f'[source]\nsampling_rate_hz = 1024\n{segment}\n[channels.force_hammer]\ncolumn = "F"\n{units}\n'

    def test_traps_are_listed(self, external_data: Path) -> None:
        traps = " ".join(describe_source(external_data / self.NAME).traps)
        assert "two hits under one header" in traps
        assert "labelled 'g'" in traps
        assert "1024 Hz" in traps

    def test_each_hit_is_a_run(self, external_data: Path, tmp_path: Path) -> None:
        path = external_data / self.NAME
        lines = path.read_text(encoding="utf-8").splitlines()
        first = next(number for number, line in enumerate(lines) if line.startswith("X_Value")) + 1
        rows = [line.split("\t") for line in lines[first:]]
        force = np.array([float(row[1]) for row in rows if len(row) > 3])
        assert force.size == 16384
        for segment in (1, 2):
            result = import_recording([path], mapped(tmp_path, self.body(f"segment = {segment}")))
            expected = force[(segment - 1) * 8192 : segment * 8192]
            np.testing.assert_array_equal(result.recording["force_hammer"].values, expected)
            assert any("labelled 'g'" in trap for trap in result.report.traps)

    def test_refusals(self, external_data: Path, tmp_path: Path) -> None:
        path = external_data / self.NAME
        with pytest.raises(InputError, match="segment = 1 … 2"):
            import_recording([path], mapped(tmp_path, self.body("")))
        with pytest.raises(InputError, match="units_override"):
            import_recording([path], mapped(tmp_path, self.body("segment = 1", 'units = "N"')))
        with pytest.raises(InputError, match="gram"):
            import_recording([path], mapped(tmp_path, self.body("segment = 1", "")))


def test_binary_and_text_uff_of_one_record_agree(external_data: Path, tmp_path: Path) -> None:
    body = "[source]\nsampling_rate_hz = 65536\n[channels.voltage_mic]\ncolumn = 1\n"
    body += 'units = "V"\nunits_override = true\n'
    folder = external_data / "formats" / "uff"
    text = import_recording([folder / "Sample_UFF58_ascii.uff"], mapped(tmp_path, body)).recording
    binary = import_recording([folder / "Sample_UFF58b_bin.uff"], mapped(tmp_path, body)).recording
    # the text holds six digits
    np.testing.assert_allclose(text["voltage_mic"], binary["voltage_mic"], rtol=6e-6, atol=1e-12)


def test_uff_that_declares_more_than_it_holds(external_data: Path, tmp_path: Path) -> None:
    path = external_data / "formats" / "uff" / "dataset_milestone_in_header.uff"
    with pytest.raises(FileFormatError, match="declares 2508876 samples and holds 42"):
        import_recording([path], mapped(tmp_path, '[channels.voltage_x]\ncolumn = 1\nunits = "V"\n'))


def test_lvm_with_irregular_times_is_refused(external_data: Path, tmp_path: Path) -> None:
    path = external_data / "formats" / "lvm" / "with_comments.lvm"
    body = '[channels.voltage_x]\ncolumn = 1\nunits = "V"\nunits_override = true\n'
    with pytest.raises(RecordingError, match="not uniform"):
        import_recording([path], mapped(tmp_path, body))


def test_can_log_with_a_database(external_data: Path, tmp_path: Path) -> None:
    """Frame 0x11 comes every 100 ms; its first two bytes read as one little-endian integer."""
    path = external_data / "formats" / "can" / "issue_1256.asc"
    (tmp_path / "x.dbc").write_text(
        'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: rig\n\nBO_ 17 Angle: 8 rig\n SG_ x : 0|16@1- (1,0) [0|0] "V" rig\n',
        encoding="utf-8",
    )
    frames = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if len(line.split()) > 6]
    rows = [row for row in frames if row[1:4] == ["1", "11", "Rx"]]
    expected = [struct.unpack("<h", bytes.fromhex(row[6] + row[7]))[0] for row in rows]
    body = '[source]\ndatabase = "x.dbc"\n[channels.voltage_x]\ncolumn = "x"\n'
    result = import_recording([path], mapped(tmp_path, body))
    values = result.recording["voltage_x"].values
    np.testing.assert_array_equal(values[np.isfinite(values)], expected)
