"""From samples to CAN frames and back, for many frames of one message at once.

Frames are rows of bytes; there is no bus here and no state. What a counter in a frame means is
decided in `acquisition.wire.can_counter`.
"""

from __future__ import annotations

import binascii
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from acquisition.samples.delivery import CountArray
from acquisition.wire.can_bits import BitField, FrameBytes, IntArray
from acquisition.wire.can_layout import CanLayout, ControlMessage, SampleMessage, Selected
from sloshlab.errors import InputError

RUNNING: Final = 1
ENDED: Final = 2
START: Final = 1
STOP: Final = 2
LOST_DATA: Final = 1
"""Bit of ``device_flags``: the device lost data since it last sent its flags."""

_SELECTOR, _CRC, _COUNTER, _COUNTER_KNOWN, _CLOCK, _CLOCK_KNOWN, _FLAGS, _N_SAMPLES, _N_NUMBERS = range(9)
_CRC_START: Final = 0xFFFF
_CRC_TABLE: Final = np.array([binascii.crc_hqx(bytes([n]), 0) for n in range(256)], np.uint16)


class FramesOfMessage(NamedTuple):
    """Frames of one message in the order of their counters.

    Attributes
    ----------
    arbitration_id : int
    data : ndarray of uint8, shape (n_frames, length)
    """

    arbitration_id: int
    data: FrameBytes


@dataclass(frozen=True, eq=False)
class DecodedFrames:
    """What frames of one message say.

    Attributes
    ----------
    intact : ndarray of bool, shape (n_frames,)
        Whether the checksum matches; True throughout for a message without one.
    counter, counter_known : ndarray of int64, shape (n_frames,)
        The bits of the sample counter that each frame carries, and which those are.
    clock, clock_known : ndarray of int64, shape (n_frames,)
        The same of the device clock.
    flags : ndarray of int64, shape (n_frames,)
        ``device_flags``; 0 in frames without them.
    n_samples : ndarray of int64, shape (n_frames,)
        Valid samples in each frame; may exceed the samples per frame where a device is wrong.
    counts : ndarray of int32, shape (n_frames, samples_per_frame, n_channels)
    """

    intact: NDArray[np.bool_]
    counter: IntArray
    counter_known: IntArray
    clock: IntArray
    clock_known: IntArray
    flags: IntArray
    n_samples: IntArray
    counts: CountArray


def checksums(arbitration_id: int, data: FrameBytes, crc: BitField) -> NDArray[np.uint16]:
    """``crc_16`` of frames: CRC-CCITT over the identifier and all bytes but the two of the CRC.

    Parameters
    ----------
    arbitration_id : int
    data : ndarray of uint8, shape (n_frames, length)
    crc : BitField
        Where the checksum lies; what is there does not matter.

    Examples
    --------
    >>> data = np.array([[0, 0, 1, 2]], np.uint8)
    >>> int(checksums(0x101, data, BitField("crc_16", 0, 16))[0])
    62098
    >>> binascii.crc_hqx(bytes([1, 1, 0, 0, 1, 2]), 0xFFFF)
    62098
    """
    left_out = {piece.byte for piece in crc.pieces()}
    used = np.array([byte for byte in range(data.shape[1]) if byte not in left_out], np.int64)
    # the identifier is summed, too: the same bytes under another identifier are no frame of this message
    start = binascii.crc_hqx(arbitration_id.to_bytes(4, "little"), _CRC_START)
    values = np.empty(len(data), np.uint16)
    # one compiled loop over all frames, which is faster than the standard library frame by frame
    _sum_up(np.ascontiguousarray(data), used, start, _CRC_TABLE, values)
    return values


@njit(cache=True)  # type: ignore[untyped-decorator]
def _sum_up(
    data: FrameBytes, used: IntArray, start: int, table: NDArray[np.uint16], values: NDArray[np.uint16]
) -> None:
    """Checksum of the used bytes of every frame."""
    for frame in range(data.shape[0]):
        value = np.int64(start)
        for k in range(used.size):
            value = ((value << 8) & 0xFFFF) ^ np.int64(table[(value >> 8) ^ data[frame, used[k]]])
        values[frame] = value


def decode(message: SampleMessage, data: FrameBytes) -> DecodedFrames:
    """Take frames of one message apart.

    Parameters
    ----------
    message : SampleMessage
    data : ndarray of uint8, shape (n_frames, message.length)

    Raises
    ------
    InputError
        If the frames have another length than the message.
    """
    # the positions of all fields rest on the length
    if data.ndim != 2 or data.shape[1] != message.length:
        raise InputError(f"frames of {message.name}", got=str(data.shape), allowed=f"(n, {message.length})")
    n_frames, columns = len(data), message.samples_per_frame * len(message.channels)
    numbers = np.zeros((_N_NUMBERS + columns, n_frames), np.int64)
    intact = np.ones(n_frames, np.bool_)
    plan = _plan(message)
    _take_apart(np.ascontiguousarray(data), plan.pieces, plan.signs, numbers)
    if message.crc is not None:
        intact = numbers[_CRC] == checksums(message.arbitration_id, data, message.crc)
    n_samples = numbers[_N_SAMPLES]
    if message.n_samples is None:
        n_samples[:] = message.samples_per_frame
    # sample by sample, as blocks and journal have them
    counts = numbers[_N_NUMBERS:].T.astype(np.int32, order="C")
    return DecodedFrames(
        intact,
        numbers[_COUNTER],
        numbers[_COUNTER_KNOWN],
        numbers[_CLOCK],
        numbers[_CLOCK_KNOWN],
        numbers[_FLAGS],
        n_samples,
        counts.reshape(n_frames, message.samples_per_frame, len(message.channels)),
    )


class _Plan(NamedTuple):
    """Pieces of all fields: row of the number, selector (−1 for always), byte, shift, bits, weight."""

    pieces: IntArray
    signs: IntArray


@lru_cache(maxsize=512)
def _plan(message: SampleMessage) -> _Plan:
    fields: list[tuple[int, Selected]] = []
    for row, field in ((_SELECTOR, message.multiplexor), (_CRC, message.crc), (_N_SAMPLES, message.n_samples)):
        fields += [(row, Selected(field))] if field is not None else []
    fields += [(_COUNTER, part) for part in message.counter] + [(_CLOCK, part) for part in message.clock]
    fields += [(_FLAGS, message.flags)] if message.flags is not None else []
    signs: list[int] = []
    for k in range(message.samples_per_frame):
        for samples in message.samples:
            fields.append((_N_NUMBERS + len(signs), Selected(samples[k])))
            signs.append(samples[k].length if samples[k].signed else 0)
    pieces = [
        (row, selector, byte, shift, n_bits, weight + part.bit)
        for row, part in fields
        for selector in part.selectors or (-1,)
        for byte, shift, n_bits, weight in part.field.pieces()
    ]
    return _Plan(np.array(pieces, np.int64), np.array(signs, np.int64))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _take_apart(data: FrameBytes, pieces: IntArray, signs: IntArray, numbers: IntArray) -> None:
    """Numbers of every frame, one row each; the multiplexor's pieces come first."""
    for frame in range(data.shape[0]):
        for k in range(pieces.shape[0]):
            row, selector, weight = pieces[k, 0], pieces[k, 1], pieces[k, 5]
            if selector >= 0 and selector != numbers[_SELECTOR, frame]:
                continue
            mask = (np.int64(1) << pieces[k, 4]) - 1
            value = (np.int64(data[frame, pieces[k, 2]]) >> pieces[k, 3]) & mask
            numbers[row, frame] |= value << weight
            if row in (_COUNTER, _CLOCK):
                numbers[row + 1, frame] |= mask << weight
        for column in range(signs.size):
            length = signs[column]
            if length and numbers[_N_NUMBERS + column, frame] >> (length - 1):
                numbers[_N_NUMBERS + column, frame] -= np.int64(1) << length


def encode_samples(
    layout: CanLayout,
    first_counter: int,
    clock_ticks: ArrayLike | None,
    counts: NDArray[np.integer],
    *,
    latched_ticks: int | None = None,
    device_flags: int = 0,
) -> list[FramesOfMessage]:
    """Frames for many samples at once.

    Parameters
    ----------
    layout : CanLayout
        As `device_database` or `read_layout` make it.
    first_counter : int
        Counter of the first sample, of any size; the frames carry as many bits as they have room for.
    clock_ticks : array_like of int, shape (n_samples,), or None
        Device clock at each sample; None for a device without one.
    counts : ndarray of int, shape (n_samples, n_channels)
        In the order of `layout.channels`.
    latched_ticks : int, optional
        Device clock at the last sample before `first_counter` whose counter is a multiple of 8. Needed
        only for classic frames when `first_counter` itself is none.
    device_flags : int
        Sent in the first frame of each message that carries flags; with 8 samples or more there is one.

    Returns
    -------
    list of FramesOfMessage
        One per message; frame j begins with sample j · `samples_per_frame`. The last one may be partly filled.

    Raises
    ------
    InputError
        If counts do not fit into their fields, or the latched clock is missing.
    """
    if counts.ndim != 2 or counts.shape[1] != len(layout.channels) or len(counts) == 0:
        raise InputError("counts", got=f"shape {counts.shape}", allowed=f"(≥ 1, {len(layout.channels)})")
    ticks = None if clock_ticks is None else np.asarray(clock_ticks).astype(np.int64, copy=False)
    return [
        FramesOfMessage(
            message.arbitration_id,
            _encoded(
                message,
                first_counter,
                ticks,
                counts[:, message.channels],
                latched_ticks=latched_ticks,
                device_flags=device_flags,
            ),
        )
        for message in layout.messages
    ]


def _encoded(
    message: SampleMessage,
    first_counter: int,
    ticks: IntArray | None,
    counts: NDArray[np.integer],
    *,
    latched_ticks: int | None,
    device_flags: int,
) -> FrameBytes:
    per_frame = message.samples_per_frame
    n_frames = -(-len(counts) // per_frame)
    data = np.zeros((n_frames, message.length), np.uint8)
    _write_samples(message, data, counts)
    sample = np.arange(n_frames, dtype=np.int64) * per_frame
    # of any size: only as many bits as a frame carries are sent
    counter = first_counter % (1 << 62) + sample
    selector = message.multiplexor_of(counter)
    _write_parts(message.counter, data, selector, counter)
    if message.clock and ticks is not None:
        latched = _latched(sample, counter, ticks, message.clock_latch_samples, latched_ticks)
        _write_parts(message.clock, data, selector, latched)
    if message.flags is not None and device_flags:
        carrying = _where(message.flags, selector)
        flags = np.zeros(n_frames, np.int64)
        # in one frame only: each that carries the bit is counted as a loss by the host
        flags[carrying[:1]] = device_flags
        _write_parts([message.flags], data, selector, flags)
    if message.crc is not None:
        message.crc.write(data, checksums(message.arbitration_id, data, message.crc))
    return data


def _write_samples(message: SampleMessage, data: FrameBytes, counts: NDArray[np.integer]) -> None:
    n_frames, per_frame = len(data), message.samples_per_frame
    n_missing = n_frames * per_frame - len(counts)
    if n_missing and message.n_samples is None:
        raise InputError(
            f"samples for {message.name}", got=str(len(counts)), allowed=f"whole frames of {per_frame}"
        )
    for channel, fields in enumerate(message.samples):
        values = counts[:, channel]
        if values.min() < fields[0].lowest or values.max() > fields[0].highest:
            raise InputError(
                f"counts of {fields[0].name}",
                got=f"{values.min()} … {values.max()}",
                allowed=f"{fields[0].lowest} … {fields[0].highest}",
            )
        padded = np.concatenate([values, np.zeros(n_missing, values.dtype)]) if n_missing else values
        for k, field in enumerate(fields):
            field.write(data, padded[k::per_frame])
    if message.n_samples is not None:
        valid = np.full(n_frames, per_frame, np.int64)
        # a CAN FD frame says how many of its samples are valid, so that a run may end anywhere
        valid[-1] -= n_missing
        message.n_samples.write(data, valid)


def _where(part: Selected, selector: IntArray) -> IntArray:
    return np.flatnonzero(np.isin(selector, part.selectors)) if part.selectors else np.arange(len(selector))


def _write_parts(parts: Sequence[Selected], data: FrameBytes, selector: IntArray, values: IntArray) -> None:
    for part in parts:
        there = _where(part, selector)
        rows = data[there]
        part.field.write(rows, values[there] >> part.bit)
        data[there] = rows


def _latched(
    sample: IntArray, counter: IntArray, ticks: IntArray, latch_samples: int, latched_ticks: int | None
) -> IntArray:
    """Clock at the last latch before each frame."""
    at = sample - counter % latch_samples
    # a stretch may begin in the middle of the eight frames that carry one clock
    before = at < 0
    if before.any() and latched_ticks is None:
        raise InputError(
            "latched_ticks",
            got="nothing",
            allowed=f"the clock at the last counter that is a multiple of {latch_samples}",
            remedy="or begin with such a counter",
        )
    return np.where(before, latched_ticks or 0, ticks[np.maximum(at, 0)])


def control_frame(message: ControlMessage, **values: int) -> bytes:
    """Data of a ``device_status`` or ``host_command``.

    Parameters
    ----------
    message : ControlMessage
    **values : int
        Signals by name: ``state``, ``stream``, ``n_samples``; ``command``. Bits beyond a field are cut off.

    Examples
    --------
    >>> from acquisition.wire.can_layout import COMMAND
    >>> control_frame(COMMAND, command=START).hex()
    'ad40010000000000'
    """
    data = np.zeros((1, message.length), np.uint8)
    for name, value in values.items():
        field = message.field(name)
        if field is None:
            raise InputError(
                f"signal of {message.name}", got=name, allowed=", ".join(f.name for f in message.fields)
            )
        # a number of samples beyond the field comes round as the counter does
        field.write(data, value % (1 << field.length))
    crc = message.field("crc_16")
    if crc is not None:
        crc.write(data, checksums(message.arbitration_id, data, crc))
    return data.tobytes()


def read_control_frame(message: ControlMessage, data: bytes) -> dict[str, int] | None:
    """Signals of a control message by name; None if its checksum or its length is wrong.

    Examples
    --------
    >>> from acquisition.wire.can_layout import STATUS
    >>> frame = control_frame(STATUS, state=ENDED, stream=7, n_samples=1000)
    >>> {name: value for name, value in read_control_frame(STATUS, frame).items() if name != "crc_16"}
    {'state': 2, 'stream': 7, 'n_samples': 1000}
    >>> read_control_frame(STATUS, bytes(8)) is None
    True
    """
    if len(data) != message.length:
        return None
    row = np.frombuffer(data, np.uint8).reshape(1, -1)
    values = {field.name: int(field.read(row)[0]) for field in message.fields}
    crc = message.field("crc_16")
    if crc is not None and values["crc_16"] != int(checksums(message.arbitration_id, row, crc)[0]):
        return None
    return values
