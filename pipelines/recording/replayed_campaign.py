"""Every recording of a folder through simulated devices and back, then through the shaker analysis.

The proof that acquisition loses, invents and moves nothing: the device and the recorder are two
processes, counts must be those of the file, and the analysis of what was recorded must give the same
`windows.nc` as the analysis of the files themselves.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
import xarray as xr

from pipelines.report.progress import progress
from pipelines.sweep.folder import recordings_and_rigs
from pipelines.sweep.outputs import write_experiment
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab import interrupt
from sloshlab.errors import RecordingError, SourceError
from sloshlab.netcdf_lock import NETCDF_LOCK

CHANNELS_OF_A_DEVICE: Final = {"force": "serial", "acceleration": "can"}
_LONGEST_RECORDING_S = 600.0
_LINES_OF_AN_ERROR = 3


@dataclass(frozen=True)
class Way:
    """How the channels of a recording travel to the recorder.

    Attributes
    ----------
    name : str
        Name of the folder of results.
    transports : tuple of str
        ``serial`` or ``can``; two of them share the channels, forces on the first.
    every : int
        1 plays every recording and analyses them; n plays every n-th one and compares counts only.
    """

    name: str
    transports: tuple[str, ...]
    every: int = 1


WAYS: Final = (
    Way("serial", ("serial",)),
    Way("can", ("can",)),
    Way("serial_and_can", ("serial", "can"), every=6),
)


def replayed_campaign(folder: Path, output: Path, ways: Sequence[Way] = WAYS) -> dict[str, Any]:
    """Play, record, compare counts, analyse, compare windows.

    Parameters
    ----------
    folder : Path
        Recordings with their rigs.
    output : Path
        One folder per way with its recordings and `windows.nc`, beside that of the files.
    ways : sequence of Way
        Which ways the channels take.

    Returns
    -------
    dict
        Summary; ``flags`` names every difference.
    """
    runs = sorted(folder.glob("*.nc"))
    if not runs:
        raise RecordingError(f"folder {folder}", got="no recordings", allowed="*.nc with their rig*.toml")
    flags = _replayed_differences([(way, run) for way in ways for run in runs[:: way.every]], output)
    expected = _analysed(folder, folder, output / "file")
    n_windows = int(expected.sizes["window"])
    analysed = [way for way in ways if way.every == 1]
    for way in analysed:
        found = _analysed(output / way.name, folder, output / way.name / "shaker")
        flags += [f"{way.name}: windows.nc: {text}" for text in window_differences(expected, found)]
    numbers = {way.name: len(runs[:: way.every]) for way in ways}
    return {
        "lines": [
            *(f"{n} recordings by {name}, device and recorder in two processes" for name, n in numbers.items()),
            f"{n_windows} windows of the files compared with those by {', '.join(way.name for way in analysed)}",
            "counts and windows are identical" if not flags else f"{len(flags)} differences",
        ],
        "flags": flags,
        "runs": numbers,
        "windows": n_windows,
    }


def _replayed_differences(played: Sequence[tuple[Way, Path]], output: Path) -> list[str]:
    """Play and record, two at a time, and compare; the first failure of any ends all."""
    flags: list[str] = []
    with progress("replaying", len(played)) as step, ThreadPoolExecutor(2) as pool:
        jobs = [pool.submit(recorded, run, output / way.name, way) for way, run in played]
        try:
            for (way, run), job in zip(played, jobs, strict=True):
                flags += [f"{way.name}: {run.name}: {text}" for text in differences(run, job.result())]
                step(f"{way.name} {run.stem}")
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return flags


def recorded(run: Path, folder: Path, way: Way) -> Path:
    """Play one recording as devices and record them, in two processes; return the new recording."""
    folder.mkdir(parents=True, exist_ok=True)
    output = folder / run.name
    with tempfile.TemporaryDirectory(prefix="sloshlab_") as name:
        devices = _devices(run, Path(name), way)
        attributes = Path(name, "run.toml")
        attributes.write_text(_run_attributes(run), encoding="utf-8")
        with _playing(["replay", str(run), *devices, "--speed", "max"], len(way.transports)) as urls:
            sources = [part for url in urls for part in ("--source", url)]
            command = ["record", *sources, "--rig", str(_rig_of(run)), "-o", str(output), "--overwrite"]
            _run([*command, "--run", str(attributes), "--align", "counter"])
    return output


def differences(run: Path, recording: Path) -> list[str]:
    """How the stored counts, flags, scaling, times and attributes of two recordings differ; nothing is decoded.

    The legend of the quality bits may: a recorder of today knows more of them. What the recorder says about
    itself, `acquisition` and a `quality` without flags, may come on top.
    """
    with _stored(run) as expected, _stored(recording) as found:
        invented = sorted({*map(str, found.variables)} - {*map(str, expected.variables), "quality"})
        texts = [f"{name} is invented" for name in invented]
        texts += [
            f"attribute {key} is {found.attrs.get(key)!r} instead of {value!r}"
            for key, value in expected.attrs.items()
            if not _equal(found.attrs.get(key), value)
        ]
        for name, variable in expected.variables.items():
            if name not in found.variables:
                texts.append(f"{name} is missing")
            elif not np.array_equal(variable.values, found[name].values):
                texts.append(f"{name} differs")
            elif variable.dtype != found[name].dtype:
                texts.append(f"{name} is stored as {found[name].dtype} instead of {variable.dtype}")
            else:
                texts += [
                    f"{name}: {key} is {found[name].attrs.get(key)!r} instead of {value!r}"
                    for key, value in variable.attrs.items()
                    if name != "quality" and not _equal(found[name].attrs.get(key), value)
                ]
        if "quality" not in expected.variables and "quality" in found.variables and found["quality"].values.any():
            texts.append("quality flags samples that are good")
        return texts


def window_differences(expected: xr.Dataset, found: xr.Dataset) -> list[str]:
    """How two `windows.nc` differ, bit by bit; only the hashes of the input files may."""
    texts = [f"{name} is only in one of them" for name in sorted(_names(expected) ^ _names(found))]
    for name in sorted(_names(expected) & _names(found)):
        wanted, got = expected[name], found[name]
        if wanted.dtype != got.dtype or _bits(wanted) != _bits(got) or wanted.attrs != got.attrs:
            texts.append(f"{name} differs")
    keys = {*expected.attrs, *found.attrs} - {"inputs"}
    return texts + [
        f"attribute {key} differs"
        for key in sorted(keys)
        if not _equal(expected.attrs.get(key), found.attrs.get(key))
    ]


def _names(dataset: xr.Dataset) -> set[str]:
    return {str(name) for name in dataset.variables}


def _bits(variable: xr.DataArray) -> object:
    values = variable.values
    return values.tolist() if values.dtype.kind == "O" else values.tobytes()


def _equal(found: Any, expected: Any) -> bool:
    return bool(np.array_equal(found, expected))


@contextlib.contextmanager
def _stored(path: Path) -> Iterator[xr.Dataset]:
    with NETCDF_LOCK, xr.open_dataset(path, engine="netcdf4", mask_and_scale=False, decode_times=False) as dataset:
        yield dataset


def _devices(run: Path, folder: Path, way: Way) -> list[str]:
    """Options of `sloshlab replay`: one device per transport, with the channels that it carries."""
    urls = {
        "serial": f"serial:{folder / 'tty'}",
        "can": f"can:socketcand?host=127.0.0.1&port=0&channel=can0&dbc={folder / 'device.dbc'}",
    }
    options = []
    for transport in way.transports:
        options += ["--as", urls[transport]]
        if len(way.transports) > 1:
            options += ["--channels", ",".join(_channels_of(run, transport))]
    return options


def _channels_of(run: Path, transport: str) -> list[str]:
    with _stored(run) as recording:
        return [
            str(name)
            for name, variable in recording.data_vars.items()
            if CHANNELS_OF_A_DEVICE.get(str(variable.attrs.get("quantity"))) == transport
        ]


def _rig_of(run: Path) -> Path:
    with _stored(run) as recording:
        return run.parent / str(recording.attrs["rig"])


def _run_attributes(run: Path) -> str:
    """What the operator would tell the recorder about the run, as TOML."""
    with _stored(run) as recording:
        known = {
            key: value.item() if isinstance(value, np.generic) else value for key, value in recording.attrs.items()
        }
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in known.items())


@contextlib.contextmanager
def _playing(arguments: Sequence[str], n_devices: int) -> Iterator[list[str]]:
    """Devices in a process of their own; yields the URLs at which the recorder finds them."""
    command = [sys.executable, "-m", "pipelines.command_line", *arguments]
    with (
        tempfile.TemporaryFile("w+") as messages,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=messages, text=True) as process,
    ):
        try:
            assert process.stdout is not None
            yield [_ready(process.stdout, messages) for _ in range(n_devices)]
            with _in_time("the simulated device"):
                code = process.wait(_LONGEST_RECORDING_S)
            if code != 0:
                messages.seek(0)
                got = f"exit code {code}: {_last_lines(messages.read())}"
                raise SourceError("the simulated device", got=got, allowed="exit code 0")
        finally:
            process.kill()


@contextlib.contextmanager
def _in_time(what: str) -> Iterator[None]:
    try:
        yield
    except subprocess.TimeoutExpired as error:
        raise SourceError(what, got=f"no end within {error.timeout:g} s") from error


def _ready(lines: IO[str], messages: IO[str]) -> str:
    for line in lines:
        if line.startswith("ready "):
            return line.removeprefix("ready ").strip()
    messages.seek(0)
    raise SourceError("the simulated device", got=_last_lines(messages.read()), allowed="a line 'ready URL'")


def _run(arguments: Sequence[str]) -> None:
    command = [sys.executable, "-m", "pipelines.command_line", *arguments]
    with _in_time(f"sloshlab {arguments[0]}"):
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_RECORDING_S, check=False)
    if done.returncode not in (0, 3):
        raise SourceError(f"sloshlab {arguments[0]}", got=_last_lines(done.stderr), allowed="exit code 0 or 3")


def _last_lines(text: str) -> str:
    return " | ".join(text.strip().splitlines()[-_LINES_OF_AN_ERROR:]) or "no message"


def _analysed(recordings: Path, rigs: Path, output: Path) -> xr.Dataset:
    settings = ShakerSettings()
    experiment = analyse_shaker(*recordings_and_rigs(recordings, rigs), settings)
    write_experiment(experiment, output, command=f"sloshlab shaker {recordings.name}", report=False)
    # the netCDF library is not made for threads; an interrupt within xarray would leave its lock taken for ever
    with NETCDF_LOCK, interrupt.held():
        return xr.load_dataset(output / "windows.nc", engine="netcdf4", decode_times=False)
