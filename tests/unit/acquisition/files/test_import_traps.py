"""Traps of each format are reported, and files that are not what they say end in one line."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from import_scenarios import (
    ACCELERATION,
    COUNTS,
    DATABASE,
    FORCE_KN,
    N_SAMPLES,
    RUN,
    SCENARIOS,
    TIME_S,
    _uff_set,
    lvm_text,
)

from acquisition.files import describe_source, import_recording
from acquisition.files.file_format import FILE_FORMATS
from sloshlab.errors import ChannelMapError, FileFormatError, InputError


def map_file(folder: Path, source: str, force: str = "F", extra: str = "") -> Path:
    path = folder / "map.toml"
    path.write_text(
        f'{RUN}\n[source]\n{source}\n[channels.force_cell_1]\ncolumn = "{force}"\n{extra}\n', encoding="utf-8"
    )
    return path


class TestLvm:
    def two_hits(self, folder: Path) -> Path:
        path = folder / "hits.lvm"
        text = lvm_text(np.r_[FORCE_KN, -FORCE_KN], np.r_[ACCELERATION, ACCELERATION])
        path.write_text(text, encoding="utf-8")
        return path

    def test_two_hits_are_two_segments(self, tmp_path: Path) -> None:
        path = self.two_hits(tmp_path)
        assert any("two hits under one header" in trap for trap in describe_source(path).traps)
        with pytest.raises(ChannelMapError, match="state segment = 1 … 2"):
            import_recording([path], map_file(tmp_path, ""))
        for segment, sign in ((1, 1.0), (2, -1.0)):
            result = import_recording([path], map_file(tmp_path, f"segment = {segment}"))
            np.testing.assert_array_equal(result.recording["force_cell_1"].values, sign * FORCE_KN * 1000)
            assert any("two hits" in trap for trap in result.report.traps)

    def test_shorter_than_declared_is_refused_unless_accepted(self, tmp_path: Path) -> None:
        path = tmp_path / "cut.lvm"
        path.write_text(lvm_text(FORCE_KN[:40], ACCELERATION[:40]), encoding="utf-8")
        with pytest.raises(FileFormatError, match="declares 64 samples and 40 rows follow"):
            import_recording([path], map_file(tmp_path, ""))
        result = import_recording([path], map_file(tmp_path, "accept_truncated = true"))
        np.testing.assert_array_equal(result.recording["force_cell_1"].values, FORCE_KN[:40] * 1000)
        assert any("declares 64" in trap for trap in result.report.traps)

    def test_rounded_step_names_the_likely_rate(self, tmp_path: Path) -> None:
        path = tmp_path / "short.lvm"
        text = lvm_text(FORCE_KN, ACCELERATION).replace("0.001953125", "0.001953")
        path.write_text(text, encoding="utf-8")
        assert any("rounded step" in trap and "512 Hz" in trap for trap in describe_source(path).traps)
        result = import_recording([path], map_file(tmp_path, "sampling_rate_hz = 512"))
        assert result.recording.attrs["sampling_rate_hz"] == 512.0
        with pytest.raises(ChannelMapError, match="but the file says a step of"):
            import_recording([path], map_file(tmp_path, "sampling_rate_hz = 500"))

    def test_pickle_beside_the_file_is_never_opened(self, tmp_path: Path) -> None:
        path = tmp_path / "run.lvm"
        path.write_text(lvm_text(FORCE_KN, ACCELERATION), encoding="utf-8")
        trap = tmp_path / "run.lvm.pkl"
        trap.write_bytes(b"cos\nmkdir\n(S'opened'\ntR.")
        import_recording([path], map_file(tmp_path, ""))
        assert trap.read_bytes().startswith(b"cos")
        assert sorted(item.name for item in tmp_path.iterdir()) == ["map.toml", "run.lvm", "run.lvm.pkl"]


class TestUff:
    def test_rounded_step(self, tmp_path: Path) -> None:
        path = tmp_path / "run.uff"
        path.write_bytes(_uff_set(FORCE_KN, "F", "kN", binary=False))
        assert any("rounded step" in trap and "512 Hz" in trap for trap in describe_source(path).traps)

    @pytest.mark.parametrize("binary", [False, True])
    def test_fewer_samples_than_declared(self, binary: bool, tmp_path: Path) -> None:
        path = tmp_path / "run.uff"
        whole = _uff_set(FORCE_KN, "F", "kN", binary=binary)
        path.write_bytes(whole.replace(f"{4:10d}{N_SAMPLES:10d}".encode(), f"{4:10d}{10**9:10d}".encode()))
        with pytest.raises(FileFormatError, match="declares 1000000000 samples and holds 64"):
            import_recording([path], map_file(tmp_path, ""))

    def test_spectra_are_listed_not_imported(self, tmp_path: Path) -> None:
        path = tmp_path / "run.uff"
        spectrum = _uff_set(FORCE_KN, "S", "kN", binary=False).replace(b"\n    1         0", b"\n    4         0")
        path.write_bytes(spectrum + _uff_set(FORCE_KN, "F", "kN", binary=False))
        assert describe_source(path).unusable == {"set 1": "frequency response function, not a time history"}

    def test_cut_in_the_last_set(self, tmp_path: Path) -> None:
        path = tmp_path / "run.uff"
        whole = _uff_set(FORCE_KN, "F", "kN", binary=False)
        path.write_bytes(whole + whole[: len(whole) // 2])
        with pytest.raises(FileFormatError, match="cut short"):
            import_recording([path], map_file(tmp_path, ""))


class TestTdms:
    def test_without_waveform_properties(self, tmp_path: Path) -> None:
        from nptdms import ChannelObject, TdmsWriter

        path = tmp_path / "run.tdms"
        with TdmsWriter(str(path)) as writer:
            writer.write_segment([ChannelObject("rig", "F", FORCE_KN), ChannelObject("rig", "text", ["a", "b"])])
        description = describe_source(path)
        assert any("no waveform properties" in trap for trap in description.traps)
        assert "rig/text" in description.unusable
        with pytest.raises(ChannelMapError, match="sampling rate"):
            import_recording([path], map_file(tmp_path, "", extra='units = "kN"'))


class TestCan:
    def log(self, folder: Path, n_lost: int = 0) -> Path:
        next(scenario for scenario in SCENARIOS if scenario.name == "can asc").build(folder / "run.asc")
        if n_lost:
            lines = (folder / "run.asc").read_text(encoding="utf-8").splitlines()
            (folder / "run.asc").write_text("\n".join(lines[:20] + lines[20 + n_lost :]) + "\n", encoding="utf-8")
        return folder / "run.asc"

    def test_error_and_remote_frames_are_counted(self, tmp_path: Path) -> None:
        path = self.log(tmp_path)
        traps = import_recording([path], map_file(tmp_path, 'database = "rig.dbc"')).report.traps
        assert any("1 error frames and 1 remote frames" in trap for trap in traps)

    def test_missing_frames_are_lost_samples(self, tmp_path: Path) -> None:
        path = self.log(tmp_path, n_lost=5)
        result = import_recording([path], map_file(tmp_path, 'database = "rig.dbc"'))
        assert (result.report.n_lost, result.report.n_samples) == (5, N_SAMPLES)
        values = result.recording["force_cell_1"].values
        np.testing.assert_array_equal(values[np.isfinite(values)], np.delete(FORCE_KN, np.s_[15:20]) * 1000)
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(values)), np.arange(15, 20))

    def test_without_database_the_remedy_names_it(self, tmp_path: Path) -> None:
        with pytest.raises(ChannelMapError, match=r"state database = 'FILE\.dbc'"):
            import_recording([self.log(tmp_path)], map_file(tmp_path, ""))

    def test_short_frames_are_not_decoded_and_counted(self, tmp_path: Path) -> None:
        path = self.log(tmp_path)
        text = path.read_text(encoding="utf-8").splitlines()
        text[30] = text[30].split(" d 4")[0] + " d 2 00 00"
        path.write_text("\n".join(text) + "\n", encoding="utf-8")
        result = import_recording([path], map_file(tmp_path, 'database = "rig.dbc"'))
        assert any("1 frames not decoded" in trap for trap in result.report.traps)
        assert result.report.n_lost == 1

    def test_multiplexed_signals_keep_their_own_times(self, tmp_path: Path) -> None:
        database = DATABASE.replace(" SG_ F : 0|16", ' SG_ which M : 32|8@1+ (1,0) [0|0] "" rig\n SG_ F m0 : 0|16')
        database = database.replace(" SG_ a : 16|16", " SG_ a m1 : 16|16").replace("Loads: 4", "Loads: 5")
        (tmp_path / "rig.dbc").write_text(database, encoding="utf-8")
        lines = ["date Sat Jan 31 12:00:00.000 2026", "base hex  timestamps absolute", "internal events logged"]
        for number, t in enumerate(TIME_S):
            data = struct.pack("<hhB", int(COUNTS[number]), int(COUNTS[number]), number % 2)
            lines.append(f"{t:11.9f} 1  123             Rx   d 5 " + " ".join(f"{byte:02X}" for byte in data))
        path = tmp_path / "run.asc"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        result = import_recording([path], map_file(tmp_path, 'database = "rig.dbc"'))
        assert result.recording.attrs["sampling_rate_hz"] == 256.0
        np.testing.assert_array_equal(result.recording["force_cell_1"].values, FORCE_KN[::2] * 1000)

    def test_one_message_on_two_buses_is_two_columns(self, tmp_path: Path) -> None:
        path = self.log(tmp_path)
        lines = path.read_text(encoding="utf-8").splitlines()
        doubled = [
            part
            for line in lines
            for part in ([line, line.replace(" 1  123", " 2  123")] if "123" in line else [line])
        ]
        path.write_text("\n".join(doubled) + "\n", encoding="utf-8")
        with pytest.raises(ChannelMapError, match=r"Loads\.F \[channel 0\]"):
            import_recording([path], map_file(tmp_path, 'database = "rig.dbc"'))
        result = import_recording([path], map_file(tmp_path, 'database = "rig.dbc"\ncan_channel = 1'))
        np.testing.assert_array_equal(result.recording["force_cell_1"].values, FORCE_KN * 1000)


class TestMf4:
    def test_formula_is_not_evaluated(self, tmp_path: Path) -> None:
        from asammdf import MDF, Signal

        path = tmp_path / "run.mf4"
        formula = {"formula": "X1*2"}
        with MDF(version="4.10") as target:
            target.append(
                [Signal(FORCE_KN, TIME_S, name="F", conversion=formula), Signal(ACCELERATION, TIME_S, name="a")]
            )
            target.save(path, overwrite=True)
        assert "not evaluated" in describe_source(path).unusable["F"]


class TestMat:
    def test_declared_size_is_checked_before_reading(self, tmp_path: Path) -> None:
        import scipy.io

        path = tmp_path / "run.mat"
        scipy.io.savemat(path, {"F": FORCE_KN}, do_compression=False)
        content = bytearray(path.read_bytes())
        at = content.index(struct.pack("<ii", 1, N_SAMPLES))
        content[at : at + 8] = struct.pack("<ii", 1 << 15, 1 << 15)
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match="of 1073741824 numbers in"):
            describe_source(path)

    def test_compressed_bomb_is_refused_by_its_declared_size(self, tmp_path: Path) -> None:
        body = zlib.compress(struct.pack("<II", 14, 0xFFFFFFF8) + bytes(1 << 20))
        header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
        path = tmp_path / "run.mat"
        path.write_bytes(header + struct.pack("<II", 15, len(body)) + body)
        with pytest.raises(FileFormatError, match="declared size of 4294967288 bytes; allowed: ≤ 268435456 bytes"):
            describe_source(path)


@pytest.mark.parametrize("suffix", ["csv", "txt", "mat", "uff", "tdms", "lvm", "mf4", "asc", "blf", "trc", "nc"])
class TestHostile:
    def test_garbage_is_refused(self, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"run.{suffix}"
        path.write_bytes(np.random.default_rng(7).integers(0, 256, 4096, dtype=np.uint8).tobytes())
        with pytest.raises(InputError):
            describe_source(path)

    def test_empty_file_is_refused(self, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"run.{suffix}"
        path.touch()
        with pytest.raises(FileFormatError, match="an empty file"):
            describe_source(path)

    def test_missing_file_and_folder(self, suffix: str, tmp_path: Path) -> None:
        with pytest.raises(FileFormatError, match="no such file"):
            describe_source(tmp_path / f"none.{suffix}")
        with pytest.raises(FileFormatError, match="a folder"):
            describe_source(tmp_path)

    def test_every_stated_format_is_refused_for_prose(self, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"run.{suffix}"
        path.write_text("It was a dark and stormy night.\nNobody measured anything.\n", encoding="utf-8")
        with pytest.raises(InputError):
            describe_source(path)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=[scenario.name for scenario in SCENARIOS])
def test_half_a_file_never_passes_unnoticed(scenario: object, tmp_path: Path) -> None:
    path, map_path = scenario.write(tmp_path)  # type: ignore[attr-defined]
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    try:
        result = import_recording([path], map_path)
    except InputError:
        return
    # line-based formats declare no length: what is there must be right, and shorter
    assert scenario.name.startswith(("csv", "text", "can asc", "can trc"))  # type: ignore[attr-defined]
    n_samples = result.recording.sizes["time"]
    assert N_SAMPLES / 4 < n_samples < N_SAMPLES


def test_npy_is_refused_with_its_reason(tmp_path: Path) -> None:
    path = tmp_path / "run.npy"
    np.save(path, FORCE_KN)
    with pytest.raises(FileFormatError, match=r"\.npy array.*pickle"):
        describe_source(path)


def test_every_format_has_a_reader_module() -> None:
    import importlib

    for module in {known.reader for known in FILE_FORMATS}:
        assert callable(importlib.import_module(f"acquisition.files.{module}").read)
