"""Files that lead out of themselves, unpack to more than memory, or end in the middle: one line each, and soon."""

from __future__ import annotations

import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
from import_scenarios import ACCELERATION, DATABASE, FORCE_KN, SCENARIOS, TIME_S

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from hostile_hdf5 import HOSTILE, SECRET

from acquisition.files import describe_source, import_recording
from acquisition.files.can_database import read_layout
from acquisition.files.channel_map import SourceSection
from acquisition.files.formats import read_table
from acquisition.files.time_base import uniform_grid
from sloshlab.errors import FileFormatError, InputError, RecordingError, SourceError

MIB = 1 << 20


def secrets_of(path: Path) -> list[str]:
    """Columns in which numbers of the other file are found."""
    described = describe_source(path)
    return [column.name for column in described.columns if column.maximum == SECRET.max()]


class TestLinks:
    @pytest.mark.parametrize("damage", HOSTILE)
    def test_netcdf_is_refused(self, damage: str, tmp_path: Path) -> None:
        put, said = HOSTILE[damage]
        with netCDF4.Dataset(tmp_path / "run.nc", "w") as file:
            file.createDimension("t", SECRET.size)
            file.createVariable("a", "f8", ("t",))[:] = 1.0
        with h5py.File(tmp_path / "run.nc", "a") as file:
            put(file, "F", tmp_path)
        with pytest.raises(RecordingError, match=rf"source .*run\.nc: F.*: got {said}; allowed: data in the file"):
            describe_source(tmp_path / "run.nc")

    @pytest.mark.parametrize("damage", HOSTILE)
    def test_mat_names_what_it_leaves_out(self, damage: str, tmp_path: Path) -> None:
        put, said = HOSTILE[damage]
        with h5py.File(tmp_path / "run.mat", "w") as file:
            file["a"] = ACCELERATION
            put(file, "F", tmp_path)
        described = describe_source(tmp_path / "run.mat")
        assert [column.name for column in described.columns] == ["a"]
        assert described.unusable
        assert all(name.startswith("F") and reason == said for name, reason in described.unusable.items())

    @pytest.mark.parametrize("damage", ["external storage", "virtual data set"])
    def test_mat_references_lead_to_nothing_outside(self, damage: str, tmp_path: Path) -> None:
        with h5py.File(tmp_path / "run.mat", "w") as file:
            file["a"] = ACCELERATION
            HOSTILE[damage][0](file, "#refs#/hidden", tmp_path)
            cells = file.create_dataset("cells", (2, 1), h5py.ref_dtype)
            file["#refs#/plain"] = FORCE_KN
            cells[0, 0], cells[1, 0] = file["#refs#/hidden"].ref, file["#refs#/plain"].ref
        described = describe_source(tmp_path / "run.mat")
        assert described.unusable == {"cells{1,1}": "data outside the file, not followed"}
        assert secrets_of(tmp_path / "run.mat") == []
        assert "cells{1,2}" in [column.name for column in described.columns]


class TestSizes:
    def test_references_to_one_array_count_each_time(self, tmp_path: Path) -> None:
        """Two hundred times 100 MB, in a file of some kilobytes as no chunk of it is written."""
        with h5py.File(tmp_path / "run.mat", "w") as file:
            large = file.create_dataset("#refs#/x", (12_500_000,), "f8", chunks=(1000,), compression="gzip")
            cells = file.create_dataset("cells", (200, 1), h5py.ref_dtype)
            for row in range(200):
                cells[row, 0] = large.ref
        with pytest.raises(FileFormatError, match=r"cell cells\{1,3\} and all before: .* 300001600 bytes"):
            describe_source(tmp_path / "run.mat")

    def test_mat5_unpacks_to_no_more_than_its_size_allows(self, tmp_path: Path) -> None:
        """Two variables of 160 MiB each, which deflate to a thousandth."""
        n = 20 * MIB

        def variable(name: bytes) -> bytes:
            flags = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 1, n)
            head = flags + struct.pack("<II", 1, 8) + name.ljust(8, b"\0") + struct.pack("<II", 9, 8 * n)
            packer = zlib.compressobj(1)
            parts = [packer.compress(struct.pack("<II", 14, len(head) + 8 * n) + head)]
            parts += [packer.compress(bytes(MIB)) for _ in range(8 * n // MIB)]
            body = b"".join([*parts, packer.flush()])
            return struct.pack("<II", 15, len(body)) + body

        header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
        path = tmp_path / "run.mat"
        path.write_bytes(header + variable(b"force_01") + variable(b"force_02"))
        assert path.stat().st_size < 3 * MIB
        with pytest.raises(
            FileFormatError, match="variable 'force_02' and all before: got a declared size of 3355"
        ):
            describe_source(path)

    def test_a_mat_file_is_of_one_version_for_all_its_readers(self, tmp_path: Path) -> None:
        """With a zero among its first bytes scipy reads version 4, past everything that was looked at."""
        path = SCENARIOS[[scenario.name for scenario in SCENARIOS].index("mat v5")].write(tmp_path)[0]
        path.write_bytes(b"\0" + path.read_bytes()[1:])
        with pytest.raises(FileFormatError, match="got no MAT v5 header"):
            describe_source(path)

    def test_blf_unpacks_to_no_more_than_its_size_allows(self, tmp_path: Path) -> None:
        blf_file(tmp_path / "run.blf", n_frames=6_000_000)
        assert (tmp_path / "run.blf").stat().st_size < 2 * MIB
        with pytest.raises(FileFormatError, match="got a log container of more than 268435456 bytes"):
            describe_source(tmp_path / "run.blf")

    def test_frames_without_end_are_ended_by_the_clock(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("acquisition.files.reading_limits._COMPUTING_S", 0.5)
        monkeypatch.setattr("acquisition.files.reading_limits._COMPUTING_S_PER_MIB", 0.0)
        blf_file(tmp_path / "run.blf", n_frames=3_000_000)
        with pytest.raises(FileFormatError, match=r"run\.blf: got more than the \d+ s of computing"):
            describe_source(tmp_path / "run.blf")

    def test_memory_of_a_reader_is_limited(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """In the small, so that the test needs no gigabytes: 64 MB of text against 32 MiB of memory."""
        monkeypatch.setattr("acquisition.files.reading_limits._MEMORY_BYTES", 32 * MIB)
        monkeypatch.setattr("acquisition.files.reading_limits._MEMORY_PER_DECODED", 0)
        (tmp_path / "run.csv").write_text("F,a\n" + "1.5,2.5\n" * 8_000_000)
        with pytest.raises(FileFormatError, match=r"run\.csv: got more than the 0\.0 GiB that reading may take"):
            describe_source(tmp_path / "run.csv")


def blf_file(path: Path, n_frames: int) -> None:
    """A BLF log whose one container holds the same frame again and again."""
    frame = struct.pack("<4sHHIIIHHQ", b"LOBJ", 32, 1, 48, 1, 2, 0, 0, 10**6)
    frame += struct.pack("<HBBI8s", 1, 0, 8, 0x123, bytes(8))
    packer = zlib.compressobj(1)
    body = b"".join(packer.compress(frame * 10_000) for _ in range(n_frames // 10_000)) + packer.flush()
    container = struct.pack("<4sHHII", b"LOBJ", 16, 1, 32 + len(body), 10)
    container += struct.pack("<HHIII", 2, 0, 0, 48 * n_frames, 0) + body
    size = 144 + len(container)
    header = struct.pack("<4sL8BQQLL16H", b"LOGG", 144, *[0] * 8, size, 0, n_frames, 0, *[0] * 16)
    path.write_bytes(header.ljust(144, b"\0") + container + bytes(len(container) % 4))


class TestDatabase:
    HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: rig\n'

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            (
                'BO_ 291 Loads: 8 rig\n SG_ F : 0|4000000000@1- (1,0) [0|0] "N" rig\n',
                "4000000000 as bit or length",
            ),
            (
                'BO_ 291 Loads: 8 rig\n SG_ F : 4000000000|8@1- (1,0) [0|0] "N" rig\n',
                "4000000000 as bit or length",
            ),
            (
                'BO_ 291 Loads: 900000000 rig\n SG_ F : 0|8@1- (1,0) [0|0] "N" rig\n',
                "900000000 bytes of a message",
            ),
            (
                'BO_ 291 Loads: 8 rig\n SG_ M M : 0|8@1+ (1,0) [0|0] "" rig\n'
                ' SG_ F m0 : 8|8@1- (1,0) [0|0] "N" rig\n'
                "SG_MUL_VAL_ 291 F M 0-4000000000;\n",
                "4000000000 as number of a multiplexer",
            ),
        ],
    )
    def test_enormous_numbers_are_refused_before_they_are_listed(
        self, text: str, said: str, tmp_path: Path
    ) -> None:
        path = SCENARIOS[[scenario.name for scenario in SCENARIOS].index("can asc")].write(tmp_path)[0]
        (tmp_path / "rig.dbc").write_text(self.HEAD + text)
        with pytest.raises(FileFormatError, match=f"rig.dbc: got {said}"):
            describe_source(path, SourceSection(database=str(tmp_path / "rig.dbc")))
        with pytest.raises(SourceError, match=f"rig.dbc: got {said}"):
            read_layout(tmp_path / "rig.dbc")

    def test_the_longest_message_of_any_protocol_is_read(self, tmp_path: Path) -> None:
        path = SCENARIOS[[scenario.name for scenario in SCENARIOS].index("can asc")].write(tmp_path)[0]
        longest = 'BO_ 2566844926 Tp: 1785 rig\n SG_ X : 14272|8@1- (1,0) [0|0] "N" rig\n'
        (tmp_path / "rig.dbc").write_text(DATABASE + "\n" + longest)
        assert describe_source(path, SourceSection(database=str(tmp_path / "rig.dbc"))).columns


class TestTime:
    @pytest.mark.parametrize(
        "stamps", [[0.0, 0, 0, 0, 5, 10], [0.0, 0, 0, 7], [0.0, 0, 0, 1e-300, 1], [0.0, 5e-324, 1e-323, 1]]
    )
    def test_equal_stamps_are_no_division_by_zero(self, stamps: list[float]) -> None:
        with pytest.raises(RecordingError, match="x: "):
            uniform_grid(np.array(stamps), name="x", resolution_s=1e-4)

    def test_a_trc_log_with_one_time_for_many_frames_is_described(self, tmp_path: Path) -> None:
        lines = [";$FILEVERSION=1.1", ";$STARTTIME=44548.6", ";"]
        stamps = [0.0] * 6 + [900.0, 2000.0]
        lines += [f"{n:6d})  {t:11.1f}  Rx         0123  1  05 " for n, t in enumerate(stamps, start=1)]
        (tmp_path / "run.trc").write_text("\n".join(lines) + "\n")
        assert any("not uniform" in trap for trap in describe_source(tmp_path / "run.trc").traps)


def _without_last_bytes(n: int) -> Callable[[bytes], bytes]:
    return lambda content: content[:-n]


CUT_OFF = [
    ("csv", lambda content: content[: content.rindex(b",")], "has 2 of 3 cells and no line end"),
    ("csv", lambda content: content[: content.rindex(b"\n", 0, -1) + 4], "has 1 of 3 cells and no line end"),
    ("text with rounded times", _without_last_bytes(1), "the last number has fewer decimals than all before"),
    ("can asc", lambda content: content[: content.index(b"End Trig")], "'End TriggerBlock' is missing"),
    ("can asc", lambda content: content[: content.index(b"0.09375")], "'End TriggerBlock' is missing"),
    ("can asc", lambda content: content[: content.index(b"0.09375") + 40], "the last line has no line end"),
    ("can trc", _without_last_bytes(4), "the last line has no line end"),
    ("can blf", lambda content: content[:16] + struct.pack("<Q", 10**6) + content[24:], "declares 1000000 bytes"),
]


class TestEnds:
    @pytest.mark.parametrize(("name", "cut", "said"), CUT_OFF)
    def test_a_missing_end_is_an_error_that_a_map_may_accept(
        self, name: str, cut: Callable[[bytes], bytes], said: str, tmp_path: Path
    ) -> None:
        scenario = next(scenario for scenario in SCENARIOS if scenario.name == name)
        path, map_path = scenario.write(tmp_path)
        path.write_bytes(cut(path.read_bytes()))
        with pytest.raises(FileFormatError, match=said):
            import_recording([path], map_path)
        assert said in describe_source(path).traps[0]
        text = map_path.read_text()
        map_path.write_text(text.replace("[source]", "[source]\naccept_truncated = true"))
        recording = import_recording([path], map_path).recording
        force = recording["force_cell_1"].values
        assert TIME_S.size // 2 < force.size <= TIME_S.size
        np.testing.assert_array_equal(force, 1000 * FORCE_KN[: force.size])

    @pytest.mark.parametrize("name", ["csv", "csv with decimal commas", "can asc"])
    def test_a_last_line_without_end_may_be_whole(self, name: str, tmp_path: Path) -> None:
        scenario = next(scenario for scenario in SCENARIOS if scenario.name == name)
        path, map_path = scenario.write(tmp_path)
        path.write_bytes(path.read_bytes().rstrip(b"\r\n"))
        recording = import_recording([path], map_path).recording
        np.testing.assert_array_equal(recording["force_cell_1"].values, 1000 * FORCE_KN)


def test_a_reader_that_crashes_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import ctypes

    monkeypatch.setattr("acquisition.files.delimited_text._parsed", lambda *_: ctypes.string_at(0))
    (tmp_path / "run.csv").write_text("F\n1.5\n2.5\n")
    with pytest.raises(InputError, match=r"run\.csv: got a file on which the reader crashed \(SIGSEGV\)"):
        describe_source(tmp_path / "run.csv")


def test_an_invalidation_bit_outside_the_record_is_refused(tmp_path: Path) -> None:
    """asammdf reads where the file says, 512 MB behind the record; it is refused before."""
    from asammdf import MDF, Signal

    counts = np.arange(16, dtype=np.uint8)
    with MDF(version="4.10") as target:
        target.append([Signal(counts, counts / 8.0, name="u", invalidation_bits=counts % 3 == 0)])
        target.save(tmp_path / "run.mf4", overwrite=True, compression=0)
    content = bytearray((tmp_path / "run.mf4").read_bytes())
    np.testing.assert_array_equal(import_columns(tmp_path / "run.mf4")["u"], counts[counts % 3 != 0])
    # of a channel block: 24 bytes of head, 8 links, type, order, place and size; then flags and the bit
    for at in [at for at in range(len(content)) if content[at : at + 4] == b"##CN"]:
        if struct.unpack_from("<I", content, at + 100)[0] & 2:
            struct.pack_into("<I", content, at + 104, 2**32 - 1)
    (tmp_path / "run.mf4").write_bytes(content)
    with pytest.raises(FileFormatError, match="channel 'u' with its invalidation bit outside the record"):
        describe_source(tmp_path / "run.mf4")


def import_columns(path: Path) -> dict[str, np.ndarray]:
    """Values by name of column."""
    return {column.name: column.values for column in read_table(path, SourceSection()).columns}
