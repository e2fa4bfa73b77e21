"""The text of socketcand, the daemon that serves a CAN bus over TCP, as pure functions.

Messages stand between ``<`` and ``>``. In raw mode a frame is ``< frame ID SECONDS DATA >``, ID with three
hexadecimal digits, or eight if it is extended, DATA with or without spaces between the bytes; an error
frame is ``< error CLASS SECONDS >``. The text knows classic CAN only.
"""

from __future__ import annotations

import binascii
import re
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_bits import FrameBytes, IntArray
from sloshlab.errors import InputError

LONGEST_MESSAGE_BYTES: Final = 200
"""A longer text without an end is garbage."""

_MOST_BYTES: Final = 8
_FRAME: Final = re.compile(
    rb"<\s*frame\s+([0-9A-Fa-f]{8}|[0-9A-Fa-f]{3})\s+[0-9]{1,20}\.[0-9]{1,9}\s+((?:[0-9A-Fa-f]{2} ?){0,8})\s*>"
)
_ERROR: Final = re.compile(rb"<\s*error\s[^<>]*>")
_HARMLESS: Final = re.compile(rb"<\s*(?:ok|hi|echo)\s*>|\s+")


class SocketcandText(NamedTuple):
    """What a piece of text holds.

    Attributes
    ----------
    batch : FrameBatch
    rest : bytes
        Beginning of a message whose end has not come; put it before the next piece.
    n_error_frames : int
    n_garbage_bytes : int
        Bytes of what is no message.
    """

    batch: FrameBatch
    rest: bytes
    n_error_frames: int
    n_garbage_bytes: int


def parse_socketcand(text: bytes) -> SocketcandText:
    """Take the text apart that a socketcand sends in raw mode; what is no message is skipped.

    Parameters
    ----------
    text : bytes

    Examples
    --------
    >>> parsed = parse_socketcand(b"< frame 101 1.500000 0AFF >< error 04 1.6 >?< fra")
    >>> parsed.batch.arbitration_id.tolist(), parsed.batch.data[:, :3].tolist()
    ([257], [[10, 255, 0]])
    >>> parsed.rest, parsed.n_error_frames, parsed.n_garbage_bytes
    (b'< fra', 1, 1)
    """
    end = text.rfind(b">") + 1
    whole, (between, beginning, rest) = text[:end], text[end:].partition(b"<")
    rest = beginning + rest
    usual, n_taken = _usual_frames(whole)
    others, n_error_frames = b"", 0
    batch = usual
    if n_taken < len(whole):
        # slower, but right for any spacing and for whatever stands between frames
        found = _FRAME.findall(whole, n_taken)
        others, n_error_frames = _ERROR.subn(b"", _FRAME.sub(b"", whole[n_taken:]))
        batch = usual.followed_by(_batch(found))
    n_garbage_bytes = len(_HARMLESS.sub(b"", others)) + len(_HARMLESS.sub(b"", between))
    # a peer that never closes a message must not fill the memory
    if len(rest) > LONGEST_MESSAGE_BYTES:
        # counted at once: the end that would count it may never come
        n_garbage_bytes, rest = n_garbage_bytes + len(rest), b""
    return SocketcandText(batch, rest, n_error_frames, n_garbage_bytes)


def socketcand_send(arbitration_id: int, data: bytes, *, extended: bool = False) -> bytes:
    """Message that asks socketcand to send a frame.

    Parameters
    ----------
    arbitration_id : int
    data : bytes
        At most 8.
    extended : bool
        29-bit identifier.

    Raises
    ------
    InputError
        If there are more bytes than a classic frame has.

    Examples
    --------
    >>> socketcand_send(0x80, bytes([1, 0xAB])), socketcand_send(0x80, b"", extended=True)
    (b'< send 080 2 1 ab >', b'< send 00000080 0 >')
    """
    if len(data) > _MOST_BYTES:
        raise InputError("frame over socketcand", got=f"{len(data)} bytes", allowed=f"≤ {_MOST_BYTES}")
    identifier = f"{arbitration_id:08X}" if extended else f"{arbitration_id:03X}"
    return " ".join(["<", "send", identifier, str(len(data)), *[f"{byte:x}" for byte in data], ">"]).encode()


def _batch(found: list[tuple[bytes, bytes]]) -> FrameBatch:
    contents = [binascii.unhexlify(data.replace(b" ", b"")) for _, data in found]
    packed = b"".join([content.ljust(_MOST_BYTES, b"\0") for content in contents])
    never = np.zeros(len(found), np.bool_)
    return FrameBatch(
        arbitration_id=np.array([int(identifier, 16) & 0x1FFFFFFF for identifier, _ in found], np.int64),
        extended=np.array([len(identifier) == 8 for identifier, _ in found], np.bool_),
        remote=never,
        fd=never,
        length=np.array([len(content) for content in contents], np.int64),
        data=np.frombuffer(packed, np.uint8).reshape(len(contents), _MOST_BYTES),
    )


_SPACE, _LESS, _GREATER, _DOT = b" <>."
_FRAME_WORD: Final = np.frombuffer(b"< frame ", np.uint8)
_SHORTEST_FRAME_BYTES: Final = len("< frame 101 0.0  >")
_HEX_DIGITS: Final = np.full(256, -1, np.int64)
for _value, _digit in enumerate(b"0123456789ABCDEF"):
    _HEX_DIGITS[_digit] = _HEX_DIGITS[bytes([_digit]).lower()[0]] = _value


def _usual_frames(text: bytes) -> tuple[FrameBatch, int]:
    """Frames at the beginning, up to the first byte that is not as socketcand writes it; and how many bytes.

    Text like this comes without end, and the regular expressions need a core for a few full buses.
    """
    most = len(text) // _SHORTEST_FRAME_BYTES + 1
    room = _Room(
        np.empty(most, np.int64),
        np.empty(most, np.bool_),
        np.empty(most, np.int64),
        np.zeros((most, _MOST_BYTES), np.uint8),
    )
    n, n_taken = _take_usual(np.frombuffer(text, np.uint8), _HEX_DIGITS, room)
    never = np.zeros(n, np.bool_)
    return FrameBatch(
        room.identifiers[:n], room.extended[:n], never, never, room.length[:n], room.data[:n]
    ), n_taken


class _Room(NamedTuple):
    """Room for frames, one row each."""

    identifiers: IntArray
    extended: NDArray[np.bool_]
    length: IntArray
    data: FrameBytes


@njit(cache=True)  # type: ignore[untyped-decorator]
def _take_usual(text: FrameBytes, digits: IntArray, room: _Room) -> tuple[int, int]:
    """``< frame ID SECONDS DATA >`` with single spaces and no others inside DATA; how many, and their bytes."""
    identifiers, extended, length, data = room
    at, n = 0, 0
    while True:
        k = _past_word(text, at)
        start = k
        value = 0
        while 0 <= k < text.size and digits[text[k]] >= 0 and k - start < 9:
            value = 16 * value + digits[text[k]]
            k += 1
        n_digits = k - start
        if start < 0 or (n_digits != 3 and n_digits != 8):
            return n, at
        k = _past_seconds(text, k)
        n_bytes = 0
        while k >= 0 and k + 1 < text.size and digits[text[k]] >= 0 and digits[text[k + 1]] >= 0 and n_bytes < 8:
            data[n, n_bytes] = 16 * digits[text[k]] + digits[text[k + 1]]
            n_bytes += 1
            k += 2
        if k < 0 or k + 1 >= text.size or text[k] != _SPACE or text[k + 1] != _GREATER:
            # the row is used again by the next frame
            data[n] = 0
            return n, at
        identifiers[n], extended[n], length[n] = value & 0x1FFFFFFF, n_digits == 8, n_bytes
        n += 1
        at = k + 2


@njit(cache=True)  # type: ignore[untyped-decorator]
def _past_word(text: FrameBytes, at: int) -> int:
    """Place behind ``< frame `` at `at`; −1 if something else is there."""
    if at + _FRAME_WORD.size > text.size:
        return -1
    for k in range(_FRAME_WORD.size):
        if text[at + k] != _FRAME_WORD[k]:
            return -1
    return at + _FRAME_WORD.size


@njit(cache=True)  # type: ignore[untyped-decorator]
def _past_seconds(text: FrameBytes, at: int) -> int:
    """Place behind the space, digits, point, digits and space at `at`; −1 if something else is there."""
    if at >= text.size or text[at] != _SPACE:
        return -1
    k = at + 1
    start = k
    while k < text.size and 48 <= text[k] <= 57:
        k += 1
    if not 1 <= k - start <= 20 or k >= text.size or text[k] != _DOT:
        return -1
    k += 1
    start = k
    while k < text.size and 48 <= text[k] <= 57:
        k += 1
    if not 1 <= k - start <= 9 or k >= text.size or text[k] != _SPACE:
        return -1
    return k + 1
