"""Whatever is in a file, reading it ends in a recording or in one `SloshlabError`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from number_of_examples import examples

from acquisition.files.description import describe_source
from sloshlab.errors import RecordingError, SloshlabError
from sloshlab.recording import LOST, channels, read_recording, write_recording
from sloshlab.units import SI_UNITS

_N_DAMAGED = examples(400)
"""`make fuzz` goes on for as long as asked."""
FUZZ = settings(
    max_examples=examples(80),
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
READER = Path(__file__).with_name("recording_reader.py")
N_SAMPLES = 240
ATTRIBUTES = {
    "sloshlab_format": "1",
    "run_id": "fuzzed",
    "experiment": "other",
    "configuration": "sloshing",
    "rig": "rig.toml",
    "sampling_rate_hz": 100.0,
    "start_time_utc": "2026-01-31T12:00:00Z",
}


def recording(n: int = N_SAMPLES) -> xr.Dataset:
    rng = np.random.default_rng(20260131)
    return xr.Dataset(
        {
            "force_cell_1": ("time", rng.normal(size=n), {"units": "N", "quantity": "force", "range_max": 10.0}),
            "acceleration_roof_1": (
                "time",
                np.round(rng.normal(size=n), 2),
                {"units": "m s-2", "quantity": "acceleration"},
            ),
            "quality": ("time", np.zeros(n, np.uint8)),
        },
        coords={"time": ("time", np.arange(n) / 100.0, {"units": "s"})},
        attrs=dict(ATTRIBUTES),
    )


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("good") / "good.nc"
    counts = {"dtype": "int16", "scale_factor": 0.01, "_FillValue": np.int16(-32768)}
    write_recording(recording(), path, encoding={"acceleration_roof_1": counts})
    return path.read_bytes()


def damaged(good: bytes, number: int, rng: np.random.Generator) -> bytes:
    """Cut short, bits flipped, bytes replaced, bytes inserted, or a block blanked, in turn."""
    content = bytearray(good)
    at, n = int(rng.integers(len(content))), int(rng.integers(1, 40))
    kind = number % 5
    if kind == 0:
        return bytes(content[:at])
    if kind == 1:
        for position in rng.integers(len(content), size=int(rng.integers(1, 4))):
            content[position] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        for position in rng.integers(len(content), size=int(rng.integers(1, 4))):
            content[position] = int(rng.choice([0, 255, 127, 128, 1]))
    elif kind == 3:
        content[at:at] = rng.bytes(n)
    else:
        content[at : at + n] = bytes([int(rng.choice([0, 255]))]) * len(content[at : at + n])
    return bytes(content)


def outcomes_in_another_process(paths: list[Path]) -> dict[str, str]:
    """Outcome of each file; a crash or a hang is the outcome of the file that was open."""
    result: dict[str, str] = {}
    todo = [str(path) for path in paths]
    while todo:
        process = subprocess.Popen(
            [sys.executable, str(READER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        ended = "ended early"
        try:
            output, _ = process.communicate("\n".join(todo) + "\n", timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            output, _ = process.communicate()
            ended = "did not end"
        for line in output.splitlines():
            path, what = json.loads(line)
            result[path] = what
        opened = [path for path, what in result.items() if what == "opened"]
        for path in opened:
            result[path] = f"the process {ended} (exit {process.returncode})"
        assert opened or process.returncode == 0, process.returncode
        todo = todo[todo.index(opened[0]) + 1 :] if opened else []
    return result


def test_damaged_files_are_read_or_refused(good: bytes, tmp_path: Path) -> None:
    rng = np.random.default_rng(20260131)
    paths = []
    for number in range(_N_DAMAGED):
        paths.append(tmp_path / f"{number}.nc")
        paths[-1].write_bytes(damaged(good, number, rng))
    outcomes = outcomes_in_another_process(paths)
    assert len(outcomes) == len(paths)
    wrong = {Path(path).name: what for path, what in outcomes.items() if what not in ("read", "refused")}
    assert wrong == {}
    assert sum(what == "refused" for what in outcomes.values()) > _N_DAMAGED // 3


@pytest.mark.parametrize("n_bytes", [0, 1, 2**63])
def test_a_heap_that_leads_nowhere_is_refused(n_bytes: int, good: bytes, tmp_path: Path) -> None:
    """A free object of size 0 keeps the HDF5 library busy for ever; size 2⁶³ leads beyond the file."""
    heap = good.index(b"GCOL\x01\x00\x00\x00")
    spoiled = bytearray(good)
    spoiled[heap + 16 : heap + 32] = bytes(8) + n_bytes.to_bytes(8, "little")
    (tmp_path / "bad.nc").write_bytes(spoiled)
    with pytest.raises(RecordingError, match=f"damaged heap at byte {heap}"):
        read_recording(tmp_path / "bad.nc")


def test_the_import_refuses_such_a_heap_too(good: bytes, tmp_path: Path) -> None:
    heap = good.index(b"GCOL\x01\x00\x00\x00")
    spoiled = bytearray(good)
    spoiled[heap + 16 : heap + 32] = bytes(16)
    (tmp_path / "bad.nc").write_bytes(spoiled)
    with pytest.raises(RecordingError, match=f"source .*damaged heap at byte {heap}"):
        describe_source(tmp_path / "bad.nc")


NUMBERS = st.integers(-(2**31), 2**31 - 1) | st.floats() | st.sampled_from([0, 1, -1.0, 1e308, 5e-324])
VALUES = (
    NUMBERS.map(lambda value: np.int64(value) if isinstance(value, int) else value)
    | st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=30)
    | st.lists(st.floats(), min_size=2, max_size=4).map(np.array)
    | st.lists(st.sampled_from(["N", "m"]), min_size=2, max_size=3)
    | st.sampled_from(["N", "kN", "m s-2", "V", "1", "force", "acceleration", "NaN", "1e400", "2026-01-31"])
)
GLOBAL_NAMES = [*ATTRIBUTES, "sweep_start_hz", "sweep_rate_octave_per_s", "acceleration_g", "repeat", "novel"]
CHANNEL_NAMES = [
    "units", "quantity", "block_from", "x_m", "range_min", "range_max", "noise_std", "scale_factor", "add_offset",
    "missing_value", "novel",
]  # fmt: skip


@FUZZ
@given(
    of_run=st.dictionaries(st.sampled_from(GLOBAL_NAMES), VALUES, max_size=2),
    of_channel=st.dictionaries(st.sampled_from(CHANNEL_NAMES), VALUES, max_size=3),
    of_time=st.dictionaries(st.sampled_from(["units", "calendar", "scale_factor"]), VALUES, max_size=1),
)
def test_any_attributes(of_run: Any, of_channel: Any, of_time: Any, good: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    path.write_bytes(good)
    with netCDF4.Dataset(path, "a") as file:
        for target, values in ((file, of_run), (file["force_cell_1"], of_channel), (file["time"], of_time)):
            for key, value in values.items():
                target.setncattr(key, value)
    outcome = read_or_refused(path)
    if isinstance(outcome, xr.Dataset):
        assert all(
            outcome[name].attrs["units"] == SI_UNITS[outcome[name].attrs["quantity"]] for name in channels(outcome)
        )


def read_or_refused(path: Path) -> xr.Dataset | SloshlabError:
    try:
        return read_recording(path)
    except SloshlabError as error:
        refusal = error
    assert "\n" not in str(refusal)
    return refusal


TYPES = ["f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u8", "S1", str]


@FUZZ
@given(
    name=st.sampled_from(["force_cell_1", "force_x", "quality", "time", "acceleration", "note", "voltage_1"]),
    kind=st.sampled_from(TYPES),
    dimensions=st.lists(st.sampled_from(["time", "other"]), max_size=2).map(tuple),
    attributes=st.dictionaries(
        st.sampled_from(["units", "quantity"]), st.sampled_from(["N", "force", "V", 3]), max_size=2
    ),
    n_samples=st.sampled_from([0, 1, 2, 50]),
    with_time=st.booleans(),
)
def test_any_variable(name, kind, dimensions, attributes, n_samples, with_time, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(ATTRIBUTES)
        file.createDimension("time", n_samples or None)
        file.createDimension("other", 3)
        if with_time and name != "time":
            file.createVariable("time", "f8", ("time",))[:] = np.arange(n_samples) / 100.0
        file.createVariable(name, kind, dimensions).setncatts(attributes)
    read_or_refused(path)


CHANNEL = st.fixed_dictionaries(
    {
        "quantity_and_units": st.sampled_from(
            [
                ("force", "N", 1.0),
                ("force", "kN", 1e3),
                ("force", "mN", 1e-3),
                ("acceleration", "m s-2", 1.0),
                ("acceleration", "mm s-2", 1e-3),
                ("acceleration", "gravity", 9.80665),
                ("velocity", "cm s-1", 1e-2),
                ("velocity", "km h-1", 1 / 3.6),
                ("displacement", "mm", 1e-3),
                ("displacement", "inch", 0.0254),
                ("voltage", "mV", 1e-3),
            ]
        ),
        "storage": st.sampled_from(["f4", "f8", "i2", "i4", "u2"]),
        "step": st.sampled_from([0.5, 0.01, 3e-4]),
        "seed": st.integers(0, 2**31),
        "range_max": st.none() | st.floats(1e-3, 1e3),
    }
)


@FUZZ
@given(
    stated=st.lists(CHANNEL, min_size=1, max_size=4),
    n=st.integers(2, 200),
    rate_hz=st.sampled_from([1.0, 48.0, 512.0, 10000.0, 44100.0]),
    start_s=st.floats(-1e3, 1e3),
    lost=st.sets(st.integers(0, 199), max_size=5),
    extra=st.text(st.characters(min_codepoint=32, max_codepoint=0x2FFF), max_size=20),
)
def test_round_trip(stated, n, rate_hz, start_s, lost, extra, tmp_path: Path) -> None:
    """Numbers are those that were stored times the factor of their units; attributes come back."""
    flags = np.zeros(n, np.uint8)
    flags[[at for at in lost if at < n]] = LOST
    run = xr.Dataset(
        coords={"time": ("time", start_s + np.arange(n) / rate_hz, {"units": "s"})},
        attrs={**ATTRIBUTES, "sampling_rate_hz": rate_hz, "novel": extra},
    )
    run["quality"] = ("time", flags)
    expected, encoding, ranges = {}, {}, {}
    for number, channel in enumerate(stated):
        quantity, units, factor = channel["quantity_and_units"]
        name = f"{quantity}_place_{number}"
        counts = np.random.default_rng(channel["seed"]).integers(0, 30_000, n)
        attributes = {"units": units, "quantity": quantity}
        if channel["range_max"] is not None:
            attributes["range_max"] = channel["range_max"]
            ranges[name] = channel["range_max"] * factor
        values = counts * channel["step"]
        if channel["storage"] in ("i2", "i4", "u2"):
            fill = np.dtype(channel["storage"]).type(65535 if channel["storage"] == "u2" else -32768)
            encoding[name] = {"dtype": channel["storage"], "scale_factor": channel["step"], "_FillValue": fill}
        else:
            values = values.astype(channel["storage"])
        expected[name] = np.where(flags > 0, np.nan, values.astype(float) * factor)
        run[name] = ("time", np.where(flags > 0, np.nan, values).astype(values.dtype), attributes)
    path = tmp_path / "run.nc"
    write_recording(run, path, encoding=encoding)
    back = read_recording(path)
    assert channels(back) == sorted(expected)
    np.testing.assert_array_equal(back["time"], run["time"])
    np.testing.assert_array_equal(back["quality"], flags)
    assert back.attrs["novel"] == extra
    assert {key: back.attrs[key] for key in run.attrs} == dict(run.attrs)
    for name, values in expected.items():
        # float32 where stored so, or as short counts: 2⁻²⁴ per operation, two operations
        np.testing.assert_allclose(back[name].values, values, rtol=2e-7)
        assert back[name].attrs["units"] == SI_UNITS[name.partition("_")[0]]
        if name in ranges:
            assert back[name].attrs["range_max"] == pytest.approx(ranges[name], rel=1e-12)
