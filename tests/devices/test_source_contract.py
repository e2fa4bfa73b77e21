"""The contract of sources, kept by every backend: files, lines, buses, and the virtual laboratory."""

from __future__ import annotations

import contextlib
import math
import socket
import threading
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from documented_package import installed_from
from source_contract import SourceContract, WorkingDevice

from acquisition.devices.appearance import appearance
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.pattern_signal import PatternSignal
from acquisition.devices.simulated_device import simulated_device
from acquisition.sources import parse_url
from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.sensors import CHANNELS
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run
from sloshlab.recording import write_recording
from sloshlab.rig import Rig

RATE_HZ = 1000.0
FORCE = {"units": "N", "quantity": "force"}
STORED = {"dtype": "int16", "scale_factor": 1.0, "_FillValue": np.int16(-32768)}


def pattern(number: int) -> np.ndarray:
    """Counts of 16 bits by splitmix64, channel by channel and sample by sample; device 2 has a channel more."""
    n_samples, n_channels = 900 + 100 * number, 2 + number
    mask = 2**64 - 1
    counts = np.empty((n_samples, n_channels), np.int64)
    for sample in range(n_samples):
        for channel in range(n_channels):
            z = (256 * sample + channel + 0x9E3779B97F4A7C15) & mask
            z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
            upper = (z ^ (z >> 31)) >> 48
            counts[sample, channel] = upper - 2**16 if upper >= 2**15 else upper
    return counts


@contextlib.contextmanager
def simulated(url: str, number: int):
    """A simulated device at work in a thread, as fast as its host."""
    counts = pattern(number)
    n_samples, n_channels = counts.shape
    signal = PatternSignal(n_channels=n_channels, sampling_rate_hz=RATE_HZ, bits=16, n_samples=n_samples)
    found = appearance(parse_url(url), number=number)
    player = simulated_device(signal, found, LaboratoryTime(1, speed=math.inf), seed=number)
    its_url = player.endpoint.open()
    thread = threading.Thread(target=player.play, name=f"device {number}")
    thread.start()
    try:
        channels = [f"voltage_pattern_{k + 1}" for k in range(n_channels)]
        yield WorkingDevice(its_url, counts, channels, RATE_HZ)
    finally:
        player.stop()
        thread.join(60.0)
        assert not thread.is_alive()


class TestFile(SourceContract):
    unknown_url = "file:FOLDER/no.nc"

    @contextlib.contextmanager
    def device(self, folder: Path, number: int):
        counts = pattern(number)
        channels = [f"force_cell_{k}" for k in range(counts.shape[1])]
        recording = xr.Dataset(
            {name: ("time", counts[:, k] * 1.0, FORCE) for k, name in enumerate(channels)},
            coords={"time": np.arange(len(counts)) / RATE_HZ},
            attrs={
                "sloshlab_format": "1",
                "run_id": "pattern",
                "experiment": "other",
                "configuration": "empty",
                "rig": "rig.toml",
                "sampling_rate_hz": RATE_HZ,
                "start_time_utc": "2026-01-31T12:00:00Z",
            },
        )
        path = folder / f"run_{number}.nc"
        write_recording(recording, path, encoding={name: STORED for name in channels})
        yield WorkingDevice(f"file:{path}", counts, channels, RATE_HZ)


class TestVirtualLaboratory(SourceContract):
    unknown_url = "sim:shaker_sweep?rig=FOLDER/no.toml"

    @contextlib.contextmanager
    def device(self, folder: Path, number: int):
        rig = folder / f"rig_{number}.toml"
        rig.write_text(rig_text(0.5))
        run = virtual_shaker_run(Rig.from_toml(rig), duration_s=5.0, seed=number)
        counts = np.stack([np.rint(run[name] / run[name].encoding["scale_factor"]) for name in CHANNELS], axis=1)
        url = f"sim:shaker_sweep?rig={rig}&duration_s=5&seed={number}&real_time=no"
        yield WorkingDevice(url, counts.astype(np.int64), list(CHANNELS), 512.0)


class SimulatedDeviceContract(SourceContract):
    """The contract on a simulated device."""

    appears_as: str
    """URL with ``{folder}``, ``{number}`` of the device, and ``{port}`` for a UDP port that is free."""

    def device(self, folder: Path, number: int):
        return simulated(self.appears_as.format(folder=folder, number=number, port=free_port()), number)


class TestPseudoTerminal(SimulatedDeviceContract):
    unknown_url = "serial:FOLDER/no_port"
    appears_as = "serial:{folder}/port_{number}"


class TestSerialOverTCP(SimulatedDeviceContract):
    unknown_url = "serial:socket://127.0.0.1:1"
    appears_as = "serial:socket://127.0.0.1:0"


class TestVirtualBus(SimulatedDeviceContract):
    unknown_url = "can:virtual?channel=nowhere&dbc=FOLDER/no.dbc"
    appears_as = "can:virtual?channel={folder.name}_{number}&dbc={folder}/bus_{number}.dbc"


class TestVirtualBusFD(SimulatedDeviceContract):
    unknown_url = "can:no_such_interface?channel=nowhere&dbc=FOLDER/no.dbc"
    appears_as = f"{TestVirtualBus.appears_as}&fd=yes"


class TestSocketcand(SimulatedDeviceContract):
    unknown_url = "can:socketcand?port=1&dbc=FOLDER/no.dbc"
    appears_as = "can:socketcand?port=0&channel=can{number}&dbc={folder}/bus_{number}.dbc"


class TestSlcan(SimulatedDeviceContract):
    unknown_url = "can:slcan?channel=FOLDER/no_port&dbc=FOLDER/no.dbc"
    appears_as = "can:slcan?channel={folder}/adapter_{number}&dbc={folder}/bus_{number}.dbc"


class TestSlcanFD(TestSlcan):
    appears_as = f"{TestSlcan.appears_as}&fd=yes"


class TestMulticast(SimulatedDeviceContract):
    unknown_url = "can:udp_multicast?channel=10.1.2.3&dbc=FOLDER/no.dbc"
    appears_as = "can:udp_multicast?port={port}&dbc={folder}/bus_{number}.dbc"


class TestRamp(SourceContract):
    """The backend that docs/sources.md shows how to write."""

    unknown_url = "ramp:two words"

    @contextlib.contextmanager
    def device(self, folder: Path, number: int):
        counts = np.arange(1000 * number)[:, np.newaxis]
        url = f"ramp:pressure_{number}?n_samples={len(counts)}"
        yield WorkingDevice(url, counts, [f"voltage_pressure_{number}"], RATE_HZ)

    @pytest.fixture(autouse=True)
    def installed(self, repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
        """The package of the page, installed as far as Python looks."""
        with installed_from(repository / "docs" / "sources.md", tmp_path, monkeypatch):
            yield


def free_port() -> int:
    """A UDP port that nobody has at the moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.bind(("127.0.0.1", 0))
        return int(asking.getsockname()[1])
