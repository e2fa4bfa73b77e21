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
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
import xarray as xr

from pipelines.report.outputs import RESULT_ID
from pipelines.report.progress import progress
from pipelines.sweep.folder import recordings_and_rigs
from pipelines.sweep.outputs import write_experiment
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab import interrupt
from sloshlab.errors import InputError, RecordingError, SourceError
from sloshlab.netcdf_lock import NETCDF_LOCK

CHANNELS_OF_A_DEVICE: Final = {"force": "serial", "acceleration": "can"}
LEAST_PATIENCE_S: Final = 30.0
"""A device that has not answered its recorder for so long is given up."""

# on a loaded computer everything takes longer alike, the start of the devices included
_PATIENCE_PER_START = 10.0
# what a source takes
_MOST_PATIENCE_S = 600.0
_LONGEST_RECORDING_IN_PATIENCES = 20.0
_LINES_OF_AN_ERROR = 3
_REFUSAL = "sloshlab: "
"""Begins the one line that a command says of bad input."""


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


@dataclass(frozen=True)
class Playing:
    """Devices that play in another process.

    Attributes
    ----------
    urls : tuple of str
        Where a recorder finds them; each source waits for an answer for `patience_s`.
    patience_s : float
        At least what was asked for; more where the devices were slow to start.
    """

    urls: tuple[str, ...]
    patience_s: float

    @property
    def longest_s(self) -> float:
        """A process that takes longer hangs [s]."""
        return _LONGEST_RECORDING_IN_PATIENCES * self.patience_s


def replayed_campaign(
    folder: Path, output: Path, ways: Sequence[Way] = WAYS, *, least_patience_s: float = LEAST_PATIENCE_S
) -> dict[str, Any]:
    """Play, record, compare counts, analyse, compare windows.

    Parameters
    ----------
    folder : Path
        Recordings with their rigs.
    output : Path
        One folder per way with its recordings and `windows.nc`, beside that of the files.
    ways : sequence of Way
        Which ways the channels take.
    least_patience_s : float
        Before a device that does not answer is given up [s]; ten times the time that it took to start if that is
        longer, at most 600 s.

    Returns
    -------
    dict
        Summary; ``flags`` names every difference.
    """
    runs = sorted(folder.glob("*.nc"))
    if not runs:
        raise RecordingError(f"folder {folder}", got="no recordings", allowed="*.nc with their rig*.toml")
    if not 0 < least_patience_s <= _MOST_PATIENCE_S:
        allowed = f"0 … {_MOST_PATIENCE_S:g} s"
        raise InputError("--patience", got=f"{least_patience_s:g} s", allowed=allowed)
    played = [(way, run) for way in ways for run in runs[:: way.every]]
    flags = _replayed_differences(played, output, least_patience_s)
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


def _replayed_differences(
    played: Sequence[tuple[Way, Path]], output: Path, least_patience_s: float = LEAST_PATIENCE_S
) -> list[str]:
    """Play and record, two at a time, and compare; the first failure of any ends all."""
    flags: list[str] = []
    with progress("replaying", len(played)) as step, ThreadPoolExecutor(2) as pool:
        jobs = [pool.submit(recorded, run, output / way.name, way, least_patience_s) for way, run in played]
        try:
            for (way, run), job in zip(played, jobs, strict=True):
                flags += [f"{way.name}: {run.name}: {text}" for text in differences(run, job.result())]
                step(f"{way.name} {run.stem}")
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return flags


def recorded(run: Path, folder: Path, way: Way, least_patience_s: float = LEAST_PATIENCE_S) -> Path:
    """Play one recording as devices and record them, in two processes; return the new recording."""
    try:
        return _recorded(run, folder, way, least_patience_s)
    except SourceError as error:
        # one message, that of the process that met the trouble, and where
        raise SourceError(f"{run.name} by {way.name}: {error}") from error


def _recorded(run: Path, folder: Path, way: Way, least_patience_s: float) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    output = folder / run.name
    with tempfile.TemporaryDirectory(prefix="sloshlab_") as name:
        devices = _devices(run, Path(name), way)
        attributes = Path(name, "run.toml")
        attributes.write_text(_run_attributes(run), encoding="utf-8")
        arguments = ["replay", str(run), *devices, "--speed", "max"]
        with _playing(arguments, len(way.transports), least_patience_s) as playing:
            sources = [part for url in playing.urls for part in ("--source", url)]
            command = ["record", *sources, "--rig", str(_rig_of(run)), "-o", str(output), "--overwrite"]
            _run([*command, "--run", str(attributes), "--align", "counter"], playing.longest_s)
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
    """How two `windows.nc` differ, bit by bit; only the hashes of the input files, and what they make, may."""
    texts = [f"{name} is only in one of them" for name in sorted(_names(expected) ^ _names(found))]
    for name in sorted(_names(expected) & _names(found)):
        wanted, got = expected[name], found[name]
        if wanted.dtype != got.dtype or _bits(wanted) != _bits(got) or wanted.attrs != got.attrs:
            texts.append(f"{name} differs")
    keys = {*expected.attrs, *found.attrs} - {"inputs", RESULT_ID}
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
def _playing(arguments: Sequence[str], n_devices: int, least_patience_s: float) -> Iterator[Playing]:
    """Devices in a process of their own."""
    command = [sys.executable, "-m", "pipelines.command_line", *arguments]
    began_s = time.monotonic()
    with (
        tempfile.TemporaryFile("w+") as messages,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=messages, text=True) as process,
    ):
        try:
            assert process.stdout is not None
            urls = [_ready(process.stdout, messages) for _ in range(n_devices)]
            patience_s = _patience_s(least_patience_s, time.monotonic() - began_s)
            playing = Playing(tuple(_waiting(url, patience_s) for url in urls), patience_s)
            yield playing
            with _in_time("the simulated device"):
                code = process.wait(playing.longest_s)
            if code != 0:
                messages.seek(0)
                raise _failed("the simulated device", f"exit code {code}", messages.read())
        finally:
            process.kill()


def _patience_s(least_s: float, start_took_s: float) -> float:
    return min(max(least_s, _PATIENCE_PER_START * start_took_s), _MOST_PATIENCE_S)


def _waiting(url: str, patience_s: float) -> str:
    """The URL of a source that waits so long for the first answer."""
    return f"{url}{'&' if '?' in url else '?'}open_timeout_s={patience_s:.1f}"


@contextlib.contextmanager
def _in_time(what: str) -> Iterator[None]:
    try:
        yield
    except subprocess.TimeoutExpired as error:
        raise SourceError(what, got=f"no end within {error.timeout:g} s", remedy="more patience") from error


def _ready(lines: IO[str], messages: IO[str]) -> str:
    for line in lines:
        if line.startswith("ready "):
            return line.removeprefix("ready ").strip()
    messages.seek(0)
    raise _failed("the simulated device", "no line 'ready URL'", messages.read())


def _run(arguments: Sequence[str], longest_s: float) -> None:
    command = [sys.executable, "-m", "pipelines.command_line", *arguments]
    with _in_time(f"sloshlab {arguments[0]}"):
        done = subprocess.run(command, capture_output=True, text=True, timeout=longest_s, check=False)
    if done.returncode not in (0, 3):
        raise _failed(f"sloshlab {arguments[0]}", f"exit code {done.returncode}", done.stderr)


def _failed(what: str, how: str, messages: str) -> SourceError:
    """What a process said that failed: its own line if it said one, else how it ended and its last lines."""
    lines = messages.strip().splitlines()
    refusals = [line.removeprefix(_REFUSAL) for line in lines if line.startswith(_REFUSAL)]
    if refusals:
        return SourceError(refusals[-1])
    return SourceError(what, got=f"{how}: {' | '.join(lines[-_LINES_OF_AN_ERROR:]) or 'no message'}")


def _analysed(recordings: Path, rigs: Path, output: Path) -> xr.Dataset:
    settings = ShakerSettings()
    experiment = analyse_shaker(*recordings_and_rigs(recordings, rigs), settings)
    write_experiment(experiment, output, command=f"sloshlab shaker {recordings.name}", report=False)
    # the netCDF library is not made for threads; an interrupt within xarray would leave its lock taken for ever
    with NETCDF_LOCK, interrupt.held():
        return xr.load_dataset(output / "windows.nc", engine="netcdf4", decode_times=False)
