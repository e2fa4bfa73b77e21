"""A simulated device, put together: signal, clock, wire and the place where it appears."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acquisition.devices.appearance import Appearance
from acquisition.devices.device_clock import ClockedSignal, DeviceClock
from acquisition.devices.endpoint import StartRule
from acquisition.devices.faults import Faults
from acquisition.devices.faulty_frames import FrameFaults
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.player import Player
from acquisition.devices.sender import Sender
from acquisition.devices.sensor_faults import SensorFaults
from acquisition.devices.signal import Signal
from acquisition.devices.truth import Truth
from sloshlab.errors import InputError


def simulated_device(
    signal: Signal,
    found: Appearance,
    laboratory: LaboratoryTime,
    *,
    faults: Faults | None = None,
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
    faults : Faults, optional
        None of them if not given.
    seed : int
        Of the numbers of its streams and everything else that is drawn.
    samples_per_frame : int, optional
        Of a device that takes it.
    n_hosts, runs_freely : int, bool
        When it begins, see `StreamEndpoint`.
    """
    faults = faults or Faults()
    faults.require_channels(signal.channels, can_announce=found.can_announce)
    clock = DeviceClock(signal.sampling_rate_hz, **faults.clock.model_dump())
    # clock first, then sensors, then frames: as the signal passes through a real device
    clocked = ClockedSignal(signal, clock, seed=seed + faults.seed)
    truth = Truth()
    sensor_faults = SensorFaults(faults, signal.channels, clock, truth)
    if samples_per_frame is not None and not found.takes_samples_per_frame:
        raise InputError("--samples-per-frame", got=found.url.text, allowed="serial devices")
    wire = found.wire(sensor_faults.first_description(), clock, samples_per_frame)
    if n_hosts > found.most_hosts:
        raise InputError("--wait-clients", got=str(n_hosts), allowed=f"{found.most_hosts} for {found.url.text}")
    # the place asks the player for the description, and the player sends through the place
    made: list[Player] = []
    place = found.endpoint(
        laboratory,
        lambda: bytes(made[0].describe()["bytes"][0]),
        StartRule(n_hosts, runs_freely),
    )
    line = None if faults.overrun is None else found.line(faults.overrun, wire, truth)
    sender = Sender(place, laboratory, truth, line, found.offers_bytes)
    made.append(
        Player(
            clocked,
            wire,
            sender,
            clock,
            stream_numbers(seed),
            sensor_faults,
            FrameFaults(faults, wire, seed=seed + faults.seed, truth=truth),
            faults.disconnect,
            sensor_faults.announcements(),
        )
    )
    return made[0]


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
        # by the seed, so that a replay with faults can be repeated
        drawn = int(generator.integers(1, 256))
        if drawn != last:
            last = drawn
            yield drawn
