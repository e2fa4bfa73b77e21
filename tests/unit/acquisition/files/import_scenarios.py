"""One list of files, built here without the importer, that drives the tests of every format.

Each scenario holds the same two signals, so that one set of expected numbers serves all formats.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

N_SAMPLES = 64
RATE_HZ = 512.0  # a power of two: every time stamp is exact in float64
COUNTS = (np.arange(N_SAMPLES) * 37) % 101 - 50
FORCE_KN = COUNTS * 0.25  # exact in binary, and in every text with three decimals
ACCELERATION = COUNTS[::-1] * 0.5
TIME_S = np.arange(N_SAMPLES) / RATE_HZ

RUN = """
[run]
run_id = "scenario"
experiment = "other"
configuration = "frozen"
start_time_utc = "2026-01-31T12:00:00Z"
"""


@dataclass(frozen=True)
class Scenario:
    """A file, and how a map calls its columns."""

    name: str
    file_name: str
    build: Callable[[Path], None]
    source: str
    force: str
    acceleration: str

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Build the file and its map; their paths."""
        path = folder / self.file_name
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.build(path)
        map_path = folder / "map.toml"
        map_path.write_text(
            f"{RUN}\n[source]\n{self.source}\n"
            f'[channels.force_cell_1]\ncolumn = {self.force}\nunits = "kN"\n'
            f'[channels.acceleration_roof_1]\ncolumn = {self.acceleration}\nunits = "m s-2"\nsign = -1\n',
            encoding="utf-8",
        )
        return path, map_path


def _csv(path: Path) -> None:
    rows = [
        f"{t!r},{f!r},{a!r}"
        for t, f, a in zip(TIME_S.tolist(), FORCE_KN.tolist(), ACCELERATION.tolist(), strict=True)
    ]
    path.write_text("time,F,a\n" + "\n".join(rows) + "\n", encoding="utf-8")


def _german_csv(path: Path) -> None:
    def comma(value: float) -> str:
        return repr(value).replace(".", ",")

    rows = [
        f"{comma(t)};{comma(f)};{comma(a)}"
        for t, f, a in zip(TIME_S.tolist(), FORCE_KN.tolist(), ACCELERATION.tolist(), strict=True)
    ]
    text = "Prüfstand 7\r\nZeit;Kraft;Beschleunigung\r\ns;kN;m/s²\r\n" + "\r\n".join(rows) + "\r\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())


def _rounded_csv(path: Path) -> None:
    rows = [f"{t:.4f} {f:.2f} {a:.1f}" for t, f, a in zip(TIME_S, FORCE_KN, ACCELERATION, strict=True)]
    path.write_text("% t F a\n" + "\n".join(rows), encoding="utf-8")


def _mat5(path: Path) -> None:
    import scipy.io

    content = {
        "Fs": np.array([[RATE_HZ]]),
        "Force": FORCE_KN[np.newaxis],
        "Acceleration": np.vstack([np.zeros(N_SAMPLES), ACCELERATION]),
        "note": "text",
    }
    scipy.io.savemat(path, content, do_compression=True)


def _mat5_structure(path: Path) -> None:
    import scipy.io

    content = {"run": {"F": FORCE_KN, "a": ACCELERATION, "t": TIME_S}}
    scipy.io.savemat(path, content, do_compression=False)


def _mat73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as target:
        target.create_dataset("Force", data=FORCE_KN[:, np.newaxis]).attrs["MATLAB_class"] = b"double"
        both = np.stack([np.zeros(N_SAMPLES), ACCELERATION], axis=1)
        target.create_dataset("data/Acceleration", data=both).attrs["MATLAB_class"] = b"double"
    header = b"MATLAB 7.3 MAT-file".ljust(124) + struct.pack("<H", 0x0200) + b"IM"
    with path.open("r+b") as stream:
        stream.write(header)


def _uff_set(values: np.ndarray, title: str, units: str, *, binary: bool) -> bytes:
    """One data set 58, field by field as the format is published."""
    mark = b"    -1\n"
    first = b"    58\n"
    if binary:
        first = f"    58b{1:6d}{2:6d}{11:12d}{8 * values.size:12d}{0:6d}{0:6d}{0:12d}{0:12d}\n".encode()
    head = [title, "NONE", "31-Jan-26 12:00:00", "NONE", "NONE"]
    head.append(f"{1:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{1:10d}{3:4d} {'NONE':10s}{0:10d}{0:4d}")
    head.append(f"{4:10d}{values.size:10d}{1:10d}{0.0:13.5E}{1 / RATE_HZ:13.5E}{0.0:13.5E}")
    head.append(f"{17:10d}{0:5d}{0:5d}{0:5d} {'Time':20s} {'s':20s}")
    head.append(f"{12:10d}{0:5d}{0:5d}{0:5d} {'Signal':20s} {units:20s}")
    head += [f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}"] * 2
    text = "\n".join(head).encode() + b"\n"
    if binary:
        return mark + first + text + values.astype("<f8").tobytes() + b"\n" + mark
    lines = [
        "".join(f"{value:20.12E}" for value in values[start : start + 4]) for start in range(0, values.size, 4)
    ]
    return mark + first + text + "\n".join(lines).encode() + b"\n" + mark


def _uff(path: Path) -> None:
    path.write_bytes(
        _uff_set(FORCE_KN, "cell 1", "kN", binary=False) + _uff_set(ACCELERATION, "roof 1", "m/s^2", binary=False)
    )


def _uff_binary(path: Path) -> None:
    path.write_bytes(
        _uff_set(FORCE_KN, "cell 1", "kN", binary=True) + _uff_set(ACCELERATION, "roof 1", "m/s^2", binary=True)
    )


def _tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    wave = {"wf_increment": 1 / RATE_HZ, "wf_start_offset": 0.0, "wf_samples": N_SAMPLES}
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                ChannelObject("rig", "F", FORCE_KN, {**wave, "unit_string": "kN"}),
                ChannelObject("rig", "a", ACCELERATION, wave),
            ]
        )


def _tdms_counts(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    def scaled(slope: float) -> dict[str, object]:
        return {
            "wf_increment": 1 / RATE_HZ,
            "NI_Number_Of_Scales": 1,
            "NI_Scaling_Status": "unscaled",
            "NI_Scale[0]_Scale_Type": "Linear",
            "NI_Scale[0]_Linear_Slope": slope,
            "NI_Scale[0]_Linear_Y_Intercept": 0.0,
            "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        }

    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                ChannelObject("rig", "F", COUNTS.astype(np.int16), scaled(0.25)),
                ChannelObject("rig", "a", COUNTS[::-1].astype(np.int16), scaled(0.5)),
            ]
        )


def lvm_text(force: np.ndarray, acceleration: np.ndarray, *, declared: int = N_SAMPLES, decimal: str = ".") -> str:
    """A LabVIEW measurement file without an X column."""
    n = declared
    head = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        f"Decimal_Separator\t{decimal}", "Multi_Headings\tNo", "X_Columns\tNo", "Time_Pref\tAbsolute",
        "***End_of_Header***\t", "\t", "Channels\t2\t\t", f"Samples\t{n}\t{n}\t", "Y_Unit_Label\tkN\tm/s^2\t",
        "X_Dimension\tTime\tTime\t", "X0\t0.0E+0\t0.0E+0\t".replace(".", decimal),
        f"Delta_X\t{1 / RATE_HZ:.9f}\t{1 / RATE_HZ:.9f}\t".replace(".", decimal),
        "***End_of_Header***\t\t\t", "X_Value\tF\ta\tComment",
    ]  # fmt: skip
    rows = [f"\t{f:.6f}\t{a:.6f}".replace(".", decimal) for f, a in zip(force, acceleration, strict=True)]
    return "\n".join(head + rows) + "\n"


def _lvm(path: Path) -> None:
    path.write_text(lvm_text(FORCE_KN, ACCELERATION, decimal=","), encoding="utf-8")


def _mf4(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as target:
        target.append(
            [
                Signal(FORCE_KN, TIME_S, unit="kN", name="F"),
                Signal(ACCELERATION, TIME_S, unit="m/s^2", name="a"),
            ]
        )
        target.save(path, overwrite=True)


DATABASE = """VERSION ""

NS_ :

BS_:

BU_: rig

BO_ 291 Loads: 4 rig
 SG_ F : 0|16@1- (0.25,0) [0|0] "kN" rig
 SG_ a : 16|16@1- (0.5,0) [0|0] "m/s^2" rig
"""


def can_frames() -> list[object]:
    """Data frames of both signals, an error frame and a remote frame."""
    import can

    frames: list[object] = [
        can.Message(
            timestamp=float(t),
            arbitration_id=291,
            is_extended_id=False,
            data=struct.pack("<hh", int(f), int(a)),
            channel=0,
        )
        for t, f, a in zip(TIME_S, COUNTS, COUNTS[::-1], strict=True)
    ]
    last = float(TIME_S[-1])
    frames.append(can.Message(timestamp=last, is_error_frame=True, channel=0))
    frames.append(
        can.Message(timestamp=last, arbitration_id=292, is_extended_id=False, is_remote_frame=True, channel=0)
    )
    return frames


def _can_asc(path: Path) -> None:
    lines = ["date Sat Jan 31 12:00:00.000 2026", "base hex  timestamps absolute", "internal events logged"]
    lines += ["Begin Triggerblock Sat Jan 31 12:00:00.000 2026", "   0.000000 Start of measurement"]
    for t, f, a in zip(TIME_S, COUNTS, COUNTS[::-1], strict=True):
        data = " ".join(f"{byte:02X}" for byte in struct.pack("<hh", int(f), int(a)))
        lines.append(f"{t:11.9f} 1  123             Rx   d 4 {data}")
    lines += [f"{TIME_S[-1]:11.9f} 1 ErrorFrame", f"{TIME_S[-1]:11.9f} 1 124 Rx r", "End TriggerBlock"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    (path.parent / "rig.dbc").write_text(DATABASE, encoding="utf-8")


def _can_blf(path: Path) -> None:
    import can

    with can.BLFWriter(str(path)) as writer:
        for frame in can_frames():
            frame.timestamp += 1.7e9  # type: ignore[attr-defined]
            writer.on_message_received(frame)  # type: ignore[arg-type]
    (path.parent / "rig.dbc").write_text(DATABASE, encoding="utf-8")


def _can_trc(path: Path) -> None:
    lines = [";$FILEVERSION=1.1", ";$STARTTIME=44548.6028595139", ";"]
    for number, (t, f, a) in enumerate(zip(TIME_S, COUNTS, COUNTS[::-1], strict=True), start=1):
        data = " ".join(f"{byte:02X}" for byte in struct.pack("<hh", int(f), int(a)))
        lines.append(f"{number:6d})  {t * 1e3:11.1f}  Rx         0123  4  {data} ")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    (path.parent / "rig.dbc").write_text(DATABASE, encoding="utf-8")


def _netcdf(path: Path) -> None:
    import netCDF4

    with netCDF4.Dataset(path, "w") as target:
        target.createDimension("t", N_SAMPLES)
        clock = target.createVariable("t", "f8", ("t",))
        clock.units = "s"
        clock[:] = TIME_S
        force = target.createVariable("F", "i2", ("t",))
        force.units = "kN"
        force.scale_factor = 0.25
        force[:] = FORCE_KN
        acceleration = target.createVariable("a", "f4", ("t",))
        acceleration[:] = ACCELERATION


_CAN = 'database = "rig.dbc"'
SCENARIOS = [
    Scenario("csv", "run.csv", _csv, 'time = "time"', '"F"', '"a"'),
    Scenario(
        "csv with decimal commas",
        "run.csv",
        _german_csv,
        'time = "Zeit"\nunits_row = 3',
        '"Kraft"',
        '"Beschleunigung"',
    ),
    Scenario("text with rounded times", "run.txt", _rounded_csv, 'time = "t"', '"F"', "3"),
    Scenario("mat v5", "run.mat", _mat5, 'sampling_rate_variable = "Fs"', '"Force"', '["Acceleration", 2]'),
    Scenario("mat v5 structure", "run.mat", _mat5_structure, 'time = "run.t"', '"run.F"', '"run.a"'),
    Scenario("mat v7.3", "run.mat", _mat73, "sampling_rate_hz = 512", '"Force"', '["data.Acceleration", 2]'),
    Scenario("uff", "run.uff", _uff, "sampling_rate_hz = 512", '"cell 1"', '"set 2"'),
    Scenario("uff binary", "run.uff", _uff_binary, "sampling_rate_hz = 512", '"cell 1"', "2"),
    Scenario("tdms", "run.tdms", _tdms, 'group = "rig"', '"F"', '"rig/a"'),
    Scenario("tdms counts", "run.tdms", _tdms_counts, "", '"F"', '"a"'),
    Scenario("lvm", "run.lvm", _lvm, "", '"F"', '"a"'),
    Scenario("mf4", "run.mf4", _mf4, "", '"F"', '"a"'),
    Scenario("can asc", "run.asc", _can_asc, _CAN, '"F"', '"Loads.a"'),
    Scenario("can blf", "run.blf", _can_blf, _CAN, '"F"', '"Loads.a"'),
    Scenario("can trc", "run.trc", _can_trc, _CAN + "\nsampling_rate_hz = 512", '"F"', '"Loads.a"'),
    Scenario("netcdf", "run.nc", _netcdf, "", '"F"', '"a"'),
]
