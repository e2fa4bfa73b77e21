"""What the frames of a CAN device look like: which bits are counter, clock, checksum and channels.

`device_database` lays out the frames of a device of ours, `acquisition.files.can_database_text` writes a layout
as a DBC file, `acquisition.files.can_database` takes one from any. ``docs/can_protocol.md`` has the convention.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.samples.channel import MOST_CHANNELS, Channel
from acquisition.wire.can_bits import BitField, IntArray
from sloshlab.errors import SourceError

STATUS_ID: Final = 0x100
FIRST_SAMPLES_ID: Final = 0x101
COMMAND_ID: Final = 0x080
STREAM_BITS: Final = 8
"""Of the number of the stream in ``device_status``, at most."""

FD_LENGTHS: Final = (8, 12, 16, 20, 24, 32, 48, 64)
"""Lengths of a CAN FD frame from 8 bytes up."""

# checksum 2, counter 4, clock 4, flags 1, number of samples 1
_FD_HEADER_BYTES = 12
_CRC = BitField("crc_16", 0, 16)


@dataclass(frozen=True)
class Selected:
    """A field that is there in some frames only.

    Attributes
    ----------
    field : BitField
    bit : int
        Which bit of the whole number the field begins with.
    selectors : tuple of int
        Values of the multiplexor with which it is there; empty for always.
    """

    field: BitField
    bit: int = 0
    selectors: tuple[int, ...] = ()


@dataclass(frozen=True)
class ControlMessage:
    """A message without samples: `device_status` or `host_command`."""

    name: str
    arbitration_id: int
    extended: bool
    length: int
    fields: tuple[BitField, ...]
    fd: bool = False

    def field(self, name: str) -> BitField | None:
        """The field of that name, None without one."""
        return next((field for field in self.fields if field.name == name), None)


@dataclass(frozen=True)
class SampleMessage:
    """A message with samples; it is a group of channels with a counter of its own.

    Attributes
    ----------
    name : str
    arbitration_id : int
    extended : bool
        29-bit identifier.
    length : int
        Data bytes.
    fd : bool
    channels : tuple of int
        Numbers of its channels in the layout.
    samples : tuple of tuple of BitField
        ``samples[channel][k]``: sample k of the frame; the counter counts sample 0.
    counter : tuple of Selected
        Parts of the sample counter.
    clock : tuple of Selected
        Parts of the device clock; empty without one.
    multiplexor : BitField or None
    crc : BitField or None
    n_samples : BitField or None
        How many samples of the frame are valid; all of them without it.
    flags : Selected or None
        ``device_flags``.
    """

    name: str
    arbitration_id: int
    length: int
    channels: tuple[int, ...]
    samples: tuple[tuple[BitField, ...], ...]
    counter: tuple[Selected, ...]
    clock: tuple[Selected, ...] = ()
    multiplexor: BitField | None = None
    crc: BitField | None = None
    n_samples: BitField | None = None
    flags: Selected | None = None
    extended: bool = False
    fd: bool = False

    def __hash__(self) -> int:
        # all that belongs to a message is looked up by it for every batch: hundreds of fields take too long
        return hash((self.name, self.arbitration_id, self.extended, self.length))

    @property
    def samples_per_frame(self) -> int:
        """Samples of each channel in a full frame."""
        return len(self.samples[0])

    @property
    def clock_latch_samples(self) -> int:
        """The clock in a frame is that of the last sample whose counter is a multiple of this; 1 for its own."""
        if self.multiplexor is None or not any(part.selectors for part in self.clock):
            return 1
        return 1 << self.multiplexor.length

    def multiplexor_of(self, counter: IntArray) -> IntArray:
        """Value of the multiplexor in frames with these counters, shape (n,).

        Raises
        ------
        SourceError
            If the multiplexor is no part of the counter: such frames can be read, not made.
        """
        if self.multiplexor is None:
            return np.zeros(len(counter), np.int64)
        # which part of the counter is sent follows from the counter itself, so that no state is needed to make
        # frames
        part = next((part for part in self.counter if part.field == self.multiplexor), None)
        if part is None:
            raise SourceError(
                f"{self.name}: multiplexor", got=self.multiplexor.name, allowed="a part of the sample counter"
            )
        return (counter >> part.bit) & ((1 << part.field.length) - 1)


@dataclass(frozen=True)
class CanLayout:
    """All frames of a device.

    Attributes
    ----------
    device : str
    sampling_rate_hz : float
    clock_hz : float or None
    channels : tuple of Channel
    messages : tuple of SampleMessage
    status, command : ControlMessage or None
        ``device_status`` and ``host_command``, where the device has them.
    """

    device: str
    sampling_rate_hz: float
    clock_hz: float | None
    channels: tuple[Channel, ...]
    messages: tuple[SampleMessage, ...]
    status: ControlMessage | None = None
    command: ControlMessage | None = None

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Channels of each message, as `SourceInfo.groups` has them."""
        return tuple(message.channels for message in self.messages)

    @property
    def fd(self) -> bool:
        """Whether any message needs CAN FD."""
        return any(message.fd for message in self.messages)


def device_database(
    device: str,
    sampling_rate_hz: float,
    clock_hz: float | None,
    channels: Sequence[Channel],
    fd: bool = False,
) -> CanLayout:
    """Lay out the frames of a device in the convention of ``docs/can_protocol.md``.

    Parameters
    ----------
    device : str
        Short name.
    sampling_rate_hz : float
    clock_hz : float or None
        Ticks per second of the device clock; None leaves the clock out.
    channels : sequence of Channel
    fd : bool
        Frames of CAN FD with many samples each, instead of classic frames with one.

    Raises
    ------
    SourceError
        If a channel cannot be described in a DBC file, or there are more than 256.

    Examples
    --------
    >>> cells = [Channel(f"force_cell_{n}", "force", "N") for n in (1, 2, 3)]
    >>> [hex(m.arbitration_id) for m in device_database("cells", 1000.0, 1e6, cells).messages]
    ['0x101', '0x102']
    """
    if not 1 <= len(channels) <= MOST_CHANNELS:
        raise SourceError(f"{device}: channels", got=str(len(channels)), allowed=f"1 … {MOST_CHANNELS}")
    has_clock = clock_hz is not None
    numbered = list(enumerate(channels))
    groups = _fd_groups(numbered) if fd else _classic_groups(numbered)
    build = _fd_message if fd else _classic_message
    messages = tuple(
        build(number, [channels[index] for index in group], tuple(group), has_clock)
        for number, group in enumerate(groups)
    )
    return CanLayout(device, sampling_rate_hz, clock_hz, tuple(channels), messages, STATUS, COMMAND)


STATUS: Final = ControlMessage(
    "device_status",
    STATUS_ID,
    False,
    8,
    (_CRC, BitField("state", 16, 8), BitField("stream", 24, STREAM_BITS), BitField("n_samples", 32, 32)),
)
"""State 1 is running, 2 ended; `n_samples` is the counter that the next sample has."""

COMMAND: Final = ControlMessage("host_command", COMMAND_ID, False, 8, (_CRC, BitField("command", 16, 8)))
"""1 starts the device, 2 stops it."""


def _classic_groups(numbered: Sequence[tuple[int, Channel]]) -> list[list[int]]:
    """Pairs of 16-bit channels; wider ones alone. Groups are in the order of their first channel."""
    # four bytes are left for counts beside checksum, counter and the byte that is sent in turn
    groups: list[list[int]] = []
    half: list[int] | None = None
    for index, channel in numbered:
        if channel.bits == 16 and half is not None:
            half.append(index)
            half = None
            continue
        groups.append([index])
        if channel.bits == 16:
            half = groups[-1]
    return groups


def _fd_groups(numbered: Sequence[tuple[int, Channel]]) -> list[list[int]]:
    """As many channels per message as fit with one sample each."""
    groups: list[list[int]] = []
    left = 0
    for index, channel in numbered:
        width = channel.bits // 8
        # one sample of each channel must fit, as the counter is that of the whole message
        if width > left:
            groups.append([])
            left = FD_LENGTHS[-1] - _FD_HEADER_BYTES
        groups[-1].append(index)
        left -= width
    return groups


def _sample_fields(channels: Sequence[Channel], first_byte: int, n_samples: int) -> Iterator[tuple[BitField, ...]]:
    row = sum(channel.bits for channel in channels)
    start = 8 * first_byte
    for channel in channels:
        names = [channel.name] if n_samples == 1 else [f"{channel.name}__{k}" for k in range(n_samples)]
        yield tuple(BitField(name, start + k * row, channel.bits, signed=True) for k, name in enumerate(names))
        start += channel.bits


def _classic_message(
    number: int, channels: Sequence[Channel], indices: tuple[int, ...], has_clock: bool
) -> SampleMessage:
    # The multiplexor is the low bits of the counter, so that byte 2 is its low byte in every frame; eight frames
    # in a row carry all of it, the whole clock and the flags.
    multiplexor = BitField("sample_counter_0", 16, 3)
    page = [Selected(BitField(f"sample_counter_{bit}", 24, 8), bit, (n,)) for n, bit in enumerate((8, 16, 24))]
    clock = [Selected(BitField(f"device_clock_{bit}", 24, 8), bit, (bit // 8 + 3,)) for bit in (0, 8, 16, 24)]
    return SampleMessage(
        name=f"samples_{number}",
        arbitration_id=FIRST_SAMPLES_ID + number,
        length=8,
        channels=indices,
        samples=tuple(_sample_fields(channels, 4, 1)),
        counter=(Selected(multiplexor), Selected(BitField("sample_counter_3", 19, 5), 3), *page),
        clock=tuple(clock) if has_clock else (),
        multiplexor=multiplexor,
        crc=_CRC,
        flags=Selected(BitField("device_flags", 24, 8), 0, (7,)),
    )


def _fd_message(
    number: int, channels: Sequence[Channel], indices: tuple[int, ...], has_clock: bool
) -> SampleMessage:
    row = sum(channel.bits for channel in channels) // 8
    n_samples = (FD_LENGTHS[-1] - _FD_HEADER_BYTES) // row
    # CAN FD has a few lengths only; the rest of the frame stays zero
    needed = _FD_HEADER_BYTES + n_samples * row
    return SampleMessage(
        name=f"samples_{number}",
        arbitration_id=FIRST_SAMPLES_ID + number,
        length=next(length for length in FD_LENGTHS if length >= needed),
        channels=indices,
        samples=tuple(_sample_fields(channels, _FD_HEADER_BYTES, n_samples)),
        counter=(Selected(BitField("sample_counter_0", 16, 32)),),
        clock=(Selected(BitField("device_clock_0", 48, 32)),) if has_clock else (),
        crc=_CRC,
        n_samples=BitField("n_samples_in_frame", 88, 8),
        flags=Selected(BitField("device_flags", 80, 8)),
        fd=True,
    )
