"""Frames of the serial protocol, version 1: from bytes to frames and back, nothing else.

A frame on the wire is ``COBS(header, payload, CRC-32) 0x00``, little-endian throughout;
``docs/serial_protocol.md`` has it byte by byte. `parse` is a pure function that never raises: whatever
arrives, it finds the frames that are whole and says what the rest was.
"""

from __future__ import annotations

import enum
import struct
import zlib
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from acquisition.samples.channel import MOST_CHANNELS
from acquisition.samples.delivery import CountArray
from acquisition.wire import cobs
from sloshlab.errors import InputError

VERSION: Final = 1
# bounds the memory that any sender can make the host use for a frame
LONGEST_BODY: Final = 65_535
"""Bytes of header, payload and CRC together; what is longer is garbage."""

LONGEST_TEXT: Final = 65_000
"""Bytes of a calibration or of a message."""

_HEADER: Final = struct.Struct("<BBHIQHHBBH")
_CRC: Final = struct.Struct("<I")
_N_SAMPLES: Final = struct.Struct("<Q")
_SHORTEST_BODY: Final = _HEADER.size + _CRC.size
_LONGEST_RUN: Final = cobs.longest_encoding(LONGEST_BODY)
_SAMPLES, _CALIBRATION, _END, _MESSAGE = 1, 2, 3, 4
_OVERRUN: Final = 1
_WRAP: Final = 1 << 32


class CommandKind(enum.IntEnum):
    """What a host may ask of a device; the number is the frame type."""

    START = 0x81
    STOP = 0x82
    SEND_CALIBRATION = 0x83


@dataclass(frozen=True, eq=False)
class SamplesFrame:
    """Consecutive samples of all channels.

    Attributes
    ----------
    stream : int
        16 bits, drawn by the device at each start of its counter.
    counter : int
        Sample counter at the first sample, 32 bits.
    clock_ticks : int
        Device clock at the first sample, 64 bits.
    counts : ndarray of int32, shape (n_samples, n_channels)
    bytes_per_count : int
        2, 3 or 4.
    overrun : bool
        Whether the device lost data before this frame.
    """

    stream: int
    counter: int
    clock_ticks: int
    counts: CountArray
    bytes_per_count: int
    overrun: bool = False


@dataclass(frozen=True)
class CalibrationFrame:
    """What the device says about itself; `text` is JSON, see `acquisition.wire.serial_calibration`."""

    stream: int
    counter: int
    clock_ticks: int
    text: bytes


@dataclass(frozen=True)
class EndFrame:
    """The stream is complete: counters 0 … `n_samples` − 1."""

    stream: int
    n_samples: int


@dataclass(frozen=True)
class MessageFrame:
    """Words for a person."""

    text: str


@dataclass(frozen=True)
class CommandFrame:
    """A request of the host."""

    kind: CommandKind


Frame = SamplesFrame | CalibrationFrame | EndFrame | MessageFrame | CommandFrame


class FrameErrorKind(enum.Enum):
    """Why bytes became no frame."""

    GARBAGE = "bytes that are no frame"
    CORRUPT = "a frame whose checksum does not match"
    MALFORMED = "a frame with a good checksum that breaks the protocol"


@dataclass(frozen=True)
class FrameError:
    """Bytes that became no frame.

    Attributes
    ----------
    kind : FrameErrorKind
    detail : str
        For a person; one line.
    n_bytes : int
        Bytes on the wire, without the zeros between.
    """

    kind: FrameErrorKind
    detail: str
    n_bytes: int


@dataclass(frozen=True)
class Parsed:
    """What `parse` found.

    Attributes
    ----------
    frames : tuple of Frame
        In order of arrival.
    rest : bytes
        The beginning of a frame whose end has not arrived; put it before the next bytes.
    errors : tuple of FrameError
        One for each corrupt or malformed frame, in order; all garbage of one call is one error, the last.
    """

    frames: tuple[Frame, ...]
    rest: bytes
    errors: tuple[FrameError, ...]


def parse(data: bytes | bytearray | memoryview) -> Parsed:
    """Find the frames in `data`; after anything unreadable it goes on at the next zero byte.

    ``parse(a + b)`` finds the same frames as ``parse(a)`` followed by ``parse(rest + b)``.
    `rest` is never longer than 65 795 bytes: a longer run without a zero is dropped as it comes.

    Examples
    --------
    >>> parsed = parse(b"noise\\0" + encode_frame(MessageFrame("ready")) + b"\\5half")
    >>> parsed.frames, parsed.rest, parsed.errors[0].n_bytes
    ((MessageFrame(text='ready'),), b'\\x05half', 5)
    """
    runs = cobs.decode_runs(data, shortest=_SHORTEST_BODY, longest=LONGEST_BODY)
    frames: list[Frame] = []
    errors: list[FrameError] = []
    bodies = runs.bodies.data
    for start, stop, n_bytes in zip(
        runs.starts.tolist(), runs.stops.tolist(), runs.encoded_sizes.tolist(), strict=True
    ):
        found = _frame(bodies[start:stop], n_bytes)
        (errors if isinstance(found, FrameError) else frames).append(found)  # type: ignore[arg-type]
    rest, n_dropped = _bounded_rest(data, runs.n_used)
    n_garbage = runs.n_garbage_bytes + n_dropped
    if n_garbage:
        errors.append(FrameError(FrameErrorKind.GARBAGE, f"{n_garbage} bytes belong to no frame", n_garbage))
    return Parsed(tuple(frames), rest, tuple(errors))


def _bounded_rest(data: bytes | bytearray | memoryview, start: int) -> tuple[bytes, int]:
    """What follows the last zero, and how many bytes of it were dropped.

    One byte more than any frame has is kept: with it the run stays known as too long until its zero comes.
    """
    # whoever never sends a zero costs no more memory than the longest frame
    keep = min(len(data), start + _LONGEST_RUN + 1)
    return bytes(data[start:keep]), len(data) - keep


def _frame(body: memoryview, n_bytes: int) -> Frame | FrameError:
    content = body[: -_CRC.size]
    # the checksum first: nothing that a damaged frame says is believed
    if _CRC.unpack(body[-_CRC.size :])[0] != zlib.crc32(content):
        return FrameError(FrameErrorKind.CORRUPT, f"checksum of a frame of {len(body)} bytes", n_bytes)
    try:
        return _frame_of_content(content)
    except ValueError as error:
        return FrameError(FrameErrorKind.MALFORMED, str(error), n_bytes)


def _frame_of_content(content: memoryview) -> Frame:
    kind, version, stream, counter, ticks, n_channels, n_samples, width, status, _ = _HEADER.unpack(
        content[: _HEADER.size]
    )
    payload = content[_HEADER.size :]
    if version != VERSION:
        raise ValueError(f"protocol version {version}, known is {VERSION}")
    if kind == _SAMPLES:
        counts = _counts(payload, n_samples, n_channels, width)
        return SamplesFrame(stream, counter, ticks, counts, width, bool(status & _OVERRUN))
    if kind == _CALIBRATION:
        return CalibrationFrame(stream, counter, ticks, bytes(_short_text(payload)))
    if kind == _END:
        if len(payload) != _N_SAMPLES.size:
            raise ValueError(f"end frame with {len(payload)} bytes of payload, must be {_N_SAMPLES.size}")
        return EndFrame(stream, _N_SAMPLES.unpack(payload)[0])
    if kind == _MESSAGE:
        return MessageFrame(bytes(_short_text(payload)).decode())
    return _command(kind, payload)


def _short_text(payload: memoryview) -> memoryview:
    if len(payload) > LONGEST_TEXT:
        raise ValueError(f"text of {len(payload)} bytes, at most {LONGEST_TEXT}")
    return payload


def _command(kind: int, payload: memoryview) -> CommandFrame:
    try:
        command = CommandKind(kind)
    except ValueError:
        raise ValueError(f"unknown frame type {kind:#04x}") from None
    if payload:
        raise ValueError(f"command {command.name} with {len(payload)} bytes of payload, must be empty")
    return CommandFrame(command)


def _counts(payload: memoryview, n_samples: int, n_channels: int, width: int) -> CountArray:
    """Counts of a payload, (n_samples, n_channels); nothing is allocated before the sizes agree."""
    if not (1 <= n_channels <= MOST_CHANNELS and n_samples >= 1 and width in (2, 3, 4)):
        raise ValueError(
            f"{n_samples} samples × {n_channels} channels × {width} bytes; allowed are at least 1 sample, "
            f"1 to {MOST_CHANNELS} channels, 2, 3 or 4 bytes"
        )
    if len(payload) != n_samples * n_channels * width:
        raise ValueError(
            f"{len(payload)} bytes of payload for {n_samples} samples × {n_channels} channels × {width} bytes"
        )
    if width == 3:
        counts = np.empty(n_samples * n_channels, np.int32)
        _unpack_24_bits(np.frombuffer(payload, np.uint8), counts)
    else:
        counts = np.frombuffer(payload, f"<i{width}").astype(np.int32)
    return counts.reshape(n_samples, n_channels)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _unpack_24_bits(payload: cobs.ByteArray, counts: CountArray) -> None:
    for k in range(counts.size):
        low, middle, high = payload[3 * k], payload[3 * k + 1], payload[3 * k + 2]
        # numpy has no integers of 24 bits; the last line gives bit 23 its weight of −2²³
        unsigned = np.int32(low) | (np.int32(middle) << 8) | (np.int32(high) << 16)
        counts[k] = (unsigned ^ 0x800000) - 0x800000


def encode_frame(frame: Frame) -> bytes:
    """The bytes of a frame on the wire, with the zero that ends it.

    Raises
    ------
    InputError
        If the frame cannot be expressed: too long, counts that do not fit, too many channels.

    Examples
    --------
    >>> encode_frame(CommandFrame(CommandKind.START)).hex(" ")
    '03 81 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 05 b9 b0 2e f4 00'
    """
    if isinstance(frame, SamplesFrame):
        # the clock of the first sample is the one that is sent
        ticks = np.full(len(frame.counts), frame.clock_ticks, np.uint64)
        (encoded,) = encode_samples(
            frame.stream,
            frame.counter,
            ticks,
            frame.counts,
            frame.bytes_per_count,
            samples_per_frame=max(1, len(frame.counts)),
            overrun=frame.overrun,
        )
        return encoded
    return _closed(*_content_without_samples(frame))


def _content_without_samples(frame: Frame) -> tuple[bytes, bytes]:
    kind, stream, counter, ticks, payload = 0, 0, 0, 0, b""
    if isinstance(frame, CalibrationFrame):
        kind, stream, payload = _CALIBRATION, frame.stream, frame.text
        counter, ticks = frame.counter % _WRAP, frame.clock_ticks
    elif isinstance(frame, EndFrame):
        kind, stream, payload = _END, frame.stream, _N_SAMPLES.pack(frame.n_samples)
    elif isinstance(frame, MessageFrame):
        kind, payload = _MESSAGE, frame.text.encode()
    elif isinstance(frame, CommandFrame):
        kind = int(frame.kind)
    if len(payload) > LONGEST_TEXT:
        raise InputError("text of a frame", got=f"{len(payload)} bytes", allowed=f"≤ {LONGEST_TEXT} bytes")
    return _HEADER.pack(kind, VERSION, stream, counter, ticks, 0, 0, 0, 0, 0), payload


def _closed(header: bytes, payload: bytes | memoryview) -> bytes:
    content = b"".join((header, payload))
    # the checksum is stuffed with the rest, since it may hold zeros itself
    return cobs.encode(content + _CRC.pack(zlib.crc32(content))) + b"\0"


def encode_samples(
    stream: int,
    first_counter: int,
    clock_ticks: ArrayLike,
    counts: NDArray[np.integer],
    bytes_per_count: int,
    *,
    samples_per_frame: int,
    overrun: bool = False,
) -> list[bytes]:
    """Frames for many samples at once, each with the zero that ends it.

    Parameters
    ----------
    stream : int
    first_counter : int
        Counter of the first sample, of any size; 32 bits of it are sent.
    clock_ticks : array_like of int, shape (n_samples,)
        Device clock at each sample; that of the first sample of a frame is sent.
    counts : ndarray of int, shape (n_samples, n_channels)
    bytes_per_count : int
        2, 3 or 4.
    samples_per_frame : int
        The last frame may have fewer.
    overrun : bool
        Whether the first frame says that data were lost before it.

    Raises
    ------
    InputError
        If counts do not fit into `bytes_per_count`, or a frame would be longer than `LONGEST_BODY`.

    Examples
    --------
    >>> [len(f) for f in encode_samples(7, 0, [0, 0, 0], np.array([[1], [2], [3]]), 2, samples_per_frame=2)]
    [34, 32]
    """
    ticks = np.asarray(clock_ticks, np.uint64)
    # once for all frames, before any is made
    _require_expressible(counts, bytes_per_count, samples_per_frame)
    n_channels = counts.shape[1]
    packed = memoryview(_packed(counts, bytes_per_count))
    frames = []
    for start in range(0, len(counts), samples_per_frame):
        stop = min(start + samples_per_frame, len(counts))
        header = _HEADER.pack(
            _SAMPLES,
            VERSION,
            stream,
            (first_counter + start) % _WRAP,
            int(ticks[start]),
            n_channels,
            stop - start,
            bytes_per_count,
            _OVERRUN if overrun and start == 0 else 0,
            0,
        )
        row = n_channels * bytes_per_count
        frames.append(_closed(header, packed[start * row : stop * row]))
    return frames


def _require_expressible(counts: NDArray[np.integer], bytes_per_count: int, samples_per_frame: int) -> None:
    if bytes_per_count not in (2, 3, 4):
        raise InputError("bytes per count", got=str(bytes_per_count), allowed="2, 3 or 4")
    if counts.ndim != 2 or not 1 <= counts.shape[1] <= MOST_CHANNELS or len(counts) == 0:
        raise InputError("counts of a frame", got=f"shape {counts.shape}", allowed=f"(n ≥ 1, 1 … {MOST_CHANNELS})")
    longest = (LONGEST_BODY - _SHORTEST_BODY) // (counts.shape[1] * bytes_per_count)
    if not 1 <= samples_per_frame <= longest:
        raise InputError("samples per frame", got=str(samples_per_frame), allowed=f"1 … {longest}")
    limit = 1 << (8 * bytes_per_count - 1)
    lowest, highest = int(counts.min()), int(counts.max())
    if lowest < -limit or highest >= limit:
        raise InputError(
            "counts of a frame", got=f"{lowest} … {highest}", allowed=f"{bytes_per_count} bytes, signed"
        )


def _packed(counts: NDArray[np.integer], bytes_per_count: int) -> bytes:
    if bytes_per_count == 3:
        words = np.ascontiguousarray(counts, "<i4").view(np.uint8).reshape(-1, 4)
        return words[:, :3].tobytes()
    return np.ascontiguousarray(counts, f"<i{bytes_per_count}").tobytes()
