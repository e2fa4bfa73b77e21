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

from acquisition.wire.can_batch import FrameBatch
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
    found = _FRAME.findall(whole)
    others, n_error_frames = _ERROR.subn(b"", _FRAME.sub(b"", whole))
    n_garbage_bytes = len(_HARMLESS.sub(b"", others)) + len(_HARMLESS.sub(b"", between))
    if len(rest) > LONGEST_MESSAGE_BYTES:
        n_garbage_bytes, rest = n_garbage_bytes + len(rest), b""
    return SocketcandText(_batch(found), rest, n_error_frames, n_garbage_bytes)


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
