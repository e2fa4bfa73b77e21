"""A simulated device, put together: signal, clock, wire and the place where it appears."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from acquisition.devices.appearance import Appearance, endpoint
from acquisition.devices.can_wire import CanWire
from acquisition.devices.device_clock import CLOCK_HZ, ClockedSignal, DeviceClock
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.player import Player, Wire
from acquisition.devices.serial_wire import SerialWire
from acquisition.devices.signal import Signal
from acquisition.wire.can_layout import device_database
from sloshlab.errors import InputError


def simulated_device(
    signal: Signal,
    found: Appearance,
    laboratory: LaboratoryTime,
    *,
    seed: int = 0,
    samples_per_frame: int | None = None,
    n_hosts: int = 1,
    runs_freely: bool = False,
) -> Player:
    """Make a device, not yet open.

    Parameters
    ----------
    signal : Signal
        What it measures.
    found : Appearance
        Where it appears.
    laboratory : LaboratoryTime
        Shared by all devices of one experiment.
    seed : int
        Of the numbers of its streams and everything else that is drawn.
    samples_per_frame : int, optional
        Of a serial device.
    n_hosts, runs_freely : int, bool
        When it begins, see `StreamEndpoint`.
    """
    clock = DeviceClock(signal.sampling_rate_hz)
    clocked = ClockedSignal(signal, clock, seed=seed)
    wire = _wire(found, clocked, clock, samples_per_frame)
    made: list[Player] = []
    place = endpoint(
        found,
        laboratory,
        lambda: bytes(made[0].describe()["bytes"][0]),
        n_hosts=n_hosts,
        runs_freely=runs_freely,
    )
    made.append(Player(clocked, wire, place, clock, laboratory, stream_numbers(seed)))
    return made[0]


def _wire(found: Appearance, signal: Signal, clock: DeviceClock, samples_per_frame: int | None) -> Wire:
    if found.transport == "serial":
        return SerialWire(found.device, clock, signal.channels, samples_per_frame=samples_per_frame)
    if samples_per_frame is not None:
        raise InputError("--samples-per-frame", got=found.url.text, allowed="serial devices")
    layout = device_database(found.device, signal.sampling_rate_hz, CLOCK_HZ, signal.channels, fd=found.fd)
    if found.dbc is not None:
        layout.write_dbc(found.dbc)
    return CanWire(dataclasses.replace(layout), clock)


def stream_numbers(seed: int) -> Iterator[int]:
    """Numbers of streams, each differing from the one before; 1 … 255, as CAN has 8 bits for them.

    Examples
    --------
    >>> numbers = stream_numbers(0)
    >>> first, second = next(numbers), next(numbers)
    >>> first != second, 1 <= first <= 255
    (True, True)
    """
    generator = np.random.default_rng([seed, 12])
    last = 0
    while True:
        drawn = int(generator.integers(1, 256))
        if drawn != last:
            last = drawn
            yield drawn
