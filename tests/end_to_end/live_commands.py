"""Commands as processes of their own: devices that play, recorders that record, and what must be left."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

LONGEST_WAIT_S = 60.0
RATE_HZ = 512.0
FORCES = ("force_cell_1", "force_cell_2")
ROOF = ("acceleration_roof_1", "acceleration_roof_2")


def wait_until(condition: Callable[[], Any], what: str, more_s: float = 0.0) -> Any:
    """Wait for a condition as long as a loaded machine may need, and `more_s`; its value."""
    deadline_s = time.monotonic() + LONGEST_WAIT_S + more_s
    while not (value := condition()):
        assert time.monotonic() < deadline_s, f"waited in vain for {what}"
        time.sleep(0.02)
    return value


class Command:
    """A running command; stdout and stderr go to files, so that it never waits for a reader."""

    def __init__(self, arguments: Sequence[str], folder: Path, **options: Any) -> None:
        self._files = [(folder / f"{os.urandom(6).hex()}.{name}").open("w+b") for name in ("out", "err")]
        out, err = self._files
        # an interrupt is for this process alone, not for the tests that started it
        self.process = subprocess.Popen(arguments, stdout=out, stderr=err, start_new_session=True, **options)
        self.peak_kib = 0

    @property
    def stdout(self) -> str:
        """Everything said so far."""
        return Path(self._files[0].name).read_text(encoding="utf-8")

    @property
    def stderr(self) -> str:
        """Everything said so far."""
        return Path(self._files[1].name).read_text(encoding="utf-8")

    @property
    def summary(self) -> dict[str, Any]:
        """The last line of stdout, which `--json` makes a summary."""
        found = json.loads(self.stdout.splitlines()[-1])
        assert isinstance(found, dict)
        return found

    def send(self, number: signal.Signals) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def poll(self) -> bool:
        """Whether it has ended; keeps its peak memory."""
        if self.process.returncode is None:
            self._see_memory()
            self.process.poll()
        return self.process.returncode is not None

    def _see_memory(self) -> None:
        """The high-water mark of its own memory; that of `wait4` would count the tests that started it."""
        with contextlib.suppress(OSError, IndexError):
            status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8")
            self.peak_kib = max(self.peak_kib, int(status.partition("VmHWM:")[2].split()[0]))

    def exit_code(self, duration_s: float = 0.0) -> int:
        """Wait for the end of a command that needs `duration_s` by its nature."""
        wait_until(self.poll, f"the end of {self.process.args}: {self.stderr[-500:]}", duration_s)
        assert "\x1b" not in self.stdout + self.stderr, "escape codes in a pipe"
        assert "Traceback" not in self.stderr, self.stderr
        return int(self.process.returncode)

    def close(self) -> None:
        """End it at once, however it is."""
        if not self.poll():
            self.process.kill()
            wait_until(self.poll, "the end of a killed process")
        for file in self._files:
            file.close()
            Path(file.name).unlink()


@contextlib.contextmanager
def running(arguments: Sequence[Any], folder: Path, **options: Any) -> Iterator[Command]:
    """``sloshlab ARGUMENTS…``; killed at the end of the block if it still runs."""
    program = str(Path(sys.executable).with_name("sloshlab"))
    command = Command([program, *map(str, arguments)], folder.parent, **options)
    try:
        yield command
    finally:
        command.close()


class Devices:
    """``sloshlab replay`` with the URLs that it announced."""

    def __init__(self, command: Command, n_devices: int) -> None:
        self.command = command
        ready = wait_until(lambda: self._ready(n_devices), "devices")
        self.sources = [part for url in ready for part in ("--source", url)]

    def _ready(self, n_devices: int) -> list[str]:
        assert not self.command.poll(), self.command.stderr
        lines = [line for line in self.command.stdout.splitlines(keepends=True) if line.startswith("ready ")]
        urls = [line.removeprefix("ready ").strip() for line in lines if line.endswith("\n")]
        return urls if len(urls) == n_devices else []


@contextlib.contextmanager
def playing(run: Path, folder: Path, *places: str, options: Sequence[Any] = ()) -> Iterator[Devices]:
    """Play a recording as devices in `folder`; `places` as in `place`."""
    urls = [part for transport in places for part in ("--as", place(transport, folder))]
    with running(["replay", run, *urls, *options], folder) as command:
        yield Devices(command, len(places))


def place(transport: str, folder: Path) -> str:
    """Where a device of a transport appears; names and ports are its own."""
    return {
        "pty": f"serial:{folder / 'tty'}",
        "socket": "serial:socket://127.0.0.1:0",
        "socketcand": f"can:socketcand?port=0&channel=can0&dbc={folder / 'socketcand.dbc'}",
        "slcan": f"can:slcan?channel={folder / 'slcan'}&dbc={folder / 'slcan.dbc'}",
    }[transport]


def stored(path: Path) -> xr.Dataset:
    """A recording as it is on disk: counts, not values."""
    with xr.open_dataset(path, engine="netcdf4", mask_and_scale=False, decode_times=False) as dataset:
        return dataset.load()


def samples_that_agree(original: Path, recording: Path, names: Sequence[str] = ()) -> int:
    """Length of a recording whose every count is that of the original, under the same scale, with no flag.

    Fails at the first channel that differs; the recording may end before the original does.
    """
    expected, found = stored(original), stored(recording)
    n_samples = found.sizes["time"]
    assert 0 < n_samples <= expected.sizes["time"]
    for name in names or [name for name in map(str, expected.data_vars) if name != "quality"]:
        assert found[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(found[name].values, expected[name].values[:n_samples], err_msg=name)
        for key, value in expected[name].attrs.items():
            assert found[name].attrs[key] == value, (name, key)
    assert not found["quality"].values.any()
    np.testing.assert_allclose(found["time"].values, np.arange(n_samples) / RATE_HZ, rtol=0, atol=1e-9)
    return int(n_samples)


def n_bytes(path: Path) -> int:
    """Size of a file, 0 while there is none."""
    return path.stat().st_size if path.exists() else 0


def visible(folder: Path) -> list[str]:
    """Names of everything in a folder."""
    return sorted(path.name for path in folder.iterdir())


def cut_recording(original: Path, target: Path, n_samples: int) -> Path:
    """The first samples of a recording, counts untouched."""
    stored(original).isel(time=slice(0, n_samples)).to_netcdf(target)
    return target
