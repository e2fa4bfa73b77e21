"""What arrives from a device: blocks of samples, troubles and the end of the stream."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CountArray = NDArray[np.int32]


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
    # not the counter alone says where a sample belongs: after a restart it counts through the same numbers again
    stream: int
    counter: int
    counts: CountArray
    clock_ticks: int | None
    # two clocks: the monotonic one for intervals, as nobody sets it, and UTC for the date of the recording
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
    LINE_ERROR = "the interface counted what it had received wrongly"


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
