"""What every source of samples is: open, read what has arrived, close, say what it is.

A source never repairs, joins or reorders: it delivers the samples of each device as they arrived,
with the device's own sample counter unwrapped to 64 bits, and says what went wrong on the way. Whoever
puts samples in their place uses the counter and nothing else.
"""

from __future__ import annotations

import enum
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

CountArray = NDArray[np.int32]

MOST_CHANNELS: Final = 256
"""More channels than this in one device are refused."""

HIGHEST_SAMPLING_RATE_HZ: Final = 10e6


@dataclass(frozen=True)
class Channel:
    """One channel of a device; value in `units` = `scale_factor` · count + `add_offset`.

    Attributes
    ----------
    name : str
        Name in the recording, ``<quantity>_<place>``.
    quantity, units : str
        As in the recording format.
    bits : int
        Width of a count: 16, 24 or 32, signed.
    missing_count : int or None
        Count by which the device says that it has no reading.
    range_min, range_max, noise_std, x_m : float or None
        In `units`; as in the recording format.
    block_from, block_to : str or None
        For interface forces.
    sensor_serial : str or None
        Serial number of the sensor, where the device knows it.
    """

    name: str
    quantity: str
    units: str
    bits: int = 16
    scale_factor: float = 1.0
    add_offset: float = 0.0
    missing_count: int | None = None
    range_min: float | None = None
    range_max: float | None = None
    noise_std: float | None = None
    x_m: float | None = None
    block_from: str | None = None
    block_to: str | None = None
    sensor_serial: str | None = None


@dataclass(frozen=True)
class SourceInfo:
    """What a device says about itself.

    Attributes
    ----------
    device : str
        Short name, unique among the sources of a recording.
    url : str
        How it was addressed.
    sampling_rate_hz : float
        Nominal rate of the sample counter.
    channels : tuple of Channel
        In the order of the device.
    groups : tuple of tuple of int
        Channels (numbers in `channels`) that travel together and share a counter: all in one group on
        a serial line, one group per message on CAN. Each channel is in exactly one group.
    clock_hz : float or None
        Ticks per second of the device clock; None without one.
    """

    device: str
    url: str
    sampling_rate_hz: float
    channels: tuple[Channel, ...]
    groups: tuple[tuple[int, ...], ...]
    clock_hz: float | None = None


@dataclass(frozen=True)
class Block:
    """Consecutive samples of one group of channels, as they arrived.

    Attributes
    ----------
    group : int
        Number of the group in `SourceInfo.groups`.
    stream : int
        Drawn by the device whenever its counter starts anew; samples of two streams share no counter.
    counter : int
        Device's sample counter at the first sample, unwrapped to 64 bits; sample k has counter + k.
    counts : ndarray of int32, shape (n_samples, n_channels_of_group)
    clock_ticks : int or None
        Device clock at the first sample, unwrapped.
    host_monotonic_ns, host_utc_ns : int
        Clocks of this computer when the last byte of the block had been read.
    """

    group: int
    stream: int
    counter: int
    counts: CountArray
    clock_ticks: int | None
    host_monotonic_ns: int
    host_utc_ns: int


class TroubleKind(enum.Enum):
    """What can go wrong between a device and this computer; the text is the explanation."""

    CORRUPT_FRAME = "a frame failed its checksum and was left out"
    GARBAGE = "bytes that belong to no frame were skipped"
    MALFORMED_FRAME = "a frame with a good checksum breaks the protocol and was left out"
    OVERRUN = "the device or the interface says that it lost data"
    DISCONNECTED = "the connection was lost"
    RECONNECTED = "the connection came back"
    RESTARTED = "the device started its counter anew"
    CALIBRATION_CHANGED = "the device describes its channels differently than before"
    UNCERTAIN_COUNTER = "samples whose place could not be proved were left out"
    BUS_ERROR = "the bus reported error frames"


@dataclass(frozen=True)
class Trouble:
    """One thing that went wrong.

    Attributes
    ----------
    kind : TroubleKind
    detail : str
        For a person; one line.
    count : int
        Frames or bytes concerned.
    host_monotonic_ns : int
        When it was noticed.
    """

    kind: TroubleKind
    detail: str
    count: int
    host_monotonic_ns: int


@dataclass(frozen=True)
class End:
    """The device says that its stream is complete.

    Attributes
    ----------
    stream : int
    n_samples : int or None
        How many samples it has taken, so that a missing tail is noticed: counters 0 … n − 1 of the stream.
    """

    stream: int
    n_samples: int | None


Delivery = Block | Trouble | End


class Source(ABC):
    """A device that delivers samples.

    Use it as a context manager::

        with open_source("serial:/dev/ttyUSB0") as source:
            source.start()
            for delivery in source.read(timeout_s=0.2): ...

    Errors raised by any method are `SourceError`; after one the source can only be closed.
    """

    url: str

    @abstractmethod
    def open(self) -> None:
        """Connect and learn what the device is; `info` is known afterwards.

        Raises
        ------
        SourceError
            If there is no device, it does not answer in time, or describes itself impossibly.
        """

    @property
    @abstractmethod
    def info(self) -> SourceInfo:
        """What the device says about itself; SourceError before `open`."""

    def start(self) -> None:  # noqa: B027 - a source that streams anyway has nothing to do
        """Ask the device to begin sampling; a device that streams anyway ignores it."""

    @abstractmethod
    def read(self, timeout_s: float) -> Sequence[Delivery]:
        """What has arrived, in order of arrival.

        Returns as soon as there is something, or after `timeout_s` with nothing. Memory is bounded
        whatever the device sends.
        """

    def finish(self) -> Sequence[Delivery]:
        """Stop the device where it can be stopped and hand over what still waits for later samples.

        Called once, after the last `read` and before `close`. Nothing waits in most sources.
        """
        return ()

    @abstractmethod
    def close(self) -> None:
        """Stop the device where it can be stopped and let it go; may be called twice."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass(frozen=True)
class SourceURL:
    """``scheme:target?option=value&…`` taken apart.

    Attributes
    ----------
    text : str
        As it was given.
    scheme : str
        Name of the backend: file, serial, can, sim, or one that a plug-in brings.
    target : str
        What stands between the colon and the question mark.
    options : mapping of str to str
    """

    text: str
    scheme: str
    target: str
    options: Mapping[str, str] = field(default_factory=dict)


def attributes_of(channel: Channel) -> dict[str, Any]:
    """Attributes of the channel in a recording, without scaling.

    Examples
    --------
    >>> attributes_of(Channel("force_cell_1", "force", "N", range_min=-20.0))
    {'units': 'N', 'quantity': 'force', 'range_min': -20.0}
    """
    optional = ("range_min", "range_max", "noise_std", "x_m", "block_from", "block_to", "sensor_serial")
    found = {name: getattr(channel, name) for name in optional}
    return {
        "units": channel.units,
        "quantity": channel.quantity,
        **{k: v for k, v in found.items() if v is not None},
    }
