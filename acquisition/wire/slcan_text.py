"""The text of serial CAN adapters (Lawicel's ASCII protocol, "slcan"), as pure functions.

A frame is a line that ends with a carriage return: a letter, the identifier with three hexadecimal
digits (small letter) or eight (capital), one digit for the length, two for each byte, and from some
adapters four or eight more for a time. Many frames are taken apart at once, because one by one they
would need a processor core.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_bits import IntArray
from sloshlab.errors import InputError

LONGEST_LINE_BYTES: Final = 160
"""A longer line is garbage."""

_ByteArray = NDArray[np.uint8]
_LENGTHS: Final = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.int64)
_TIME_DIGITS: Final = (0, 4, 8)
_NO_DIGIT: Final = 255
_DIGIT: Final = np.full(256, _NO_DIGIT, np.uint8)
for _digit in "0123456789abcdefABCDEF":
    _DIGIT[ord(_digit)] = int(_digit, 16)

_IS_FRAME: Final = np.isin(np.arange(256), np.frombuffer(b"tTrRdDbB", np.uint8))
_IS_FD: Final = np.isin(np.arange(256), np.frombuffer(b"dDbB", np.uint8))
_IS_REMOTE: Final = np.isin(np.arange(256), np.frombuffer(b"rR", np.uint8))
_IS_EXTENDED: Final = np.isin(np.arange(256), np.frombuffer(b"TRDB", np.uint8))
_IS_ANSWER: Final = np.isin(np.arange(256), np.frombuffer(b"zZVvNFA", np.uint8))
_LONGEST_ANSWER: Final = 16
_LARGEST_STANDARD: Final = 0x7FF
_LARGEST_EXTENDED: Final = 0x1FFF_FFFF
# the bell, which refuses a command, ends a line as well
_LINE_ENDS: Final = bytes.maketrans(b"\a\n", b"\r\r")


class SlcanText(NamedTuple):
    """What a piece of text holds.

    Attributes
    ----------
    batch : FrameBatch
    rest : bytes
        Beginning of a line whose end has not come; put it before the next piece.
    n_bells : int
        How often the adapter refused a command.
    n_garbage_bytes : int
        Bytes of lines that are no frame and no answer.
    """

    batch: FrameBatch
    rest: bytes
    n_bells: int
    n_garbage_bytes: int


def parse_slcan(text: bytes) -> SlcanText:
    """Take the text apart that an adapter sends; what is no frame is skipped up to the next line.

    Never raises. Taking a text apart in pieces, each with the rest of the one before, gives the same frames.

    Parameters
    ----------
    text : bytes

    Examples
    --------
    >>> parsed = parse_slcan(bytes([7]) + b"t10120AFF" + bytes([13]) + b"t1?" + bytes([13]) + b"T0000")
    >>> parsed.batch.arbitration_id.tolist(), parsed.batch.data[:, :3].tolist()
    ([257], [[10, 255, 0]])
    >>> parsed.rest, parsed.n_bells, parsed.n_garbage_bytes
    (b'T0000', 1, 3)
    """
    n_bells = text.count(b"\a")
    text = text.translate(_LINE_ENDS)
    end = text.rfind(b"\r") + 1
    rest = text[end : end + LONGEST_LINE_BYTES + 1]
    n_garbage = len(text) - end - len(rest)  # the rest stays too long for a frame, whatever comes
    letters = np.frombuffer(text, np.uint8)[:end]
    stop = np.flatnonzero(letters == ord("\r"))
    start = np.concatenate([[0], stop[:-1] + 1]) if stop.size else stop
    filled = stop > start
    batch, n_lines_garbage = _frames(letters, start[filled], (stop - start)[filled])
    return SlcanText(batch, rest, n_bells, n_garbage + n_lines_garbage)


def _frames(letters: _ByteArray, start: IntArray, size: IntArray) -> tuple[FrameBatch, int]:
    kind = letters[start]
    n_id = np.where(_IS_EXTENDED[kind], 8, 3)
    code = _DIGIT[letters[np.minimum(start + 1 + n_id, max(len(letters) - 1, 0))]]
    allowed = _IS_FRAME[kind] & (size >= n_id + 2) & (code <= np.where(_IS_FD[kind], 15, 8))
    length = np.where(allowed & ~_IS_REMOTE[kind], _LENGTHS[np.minimum(code, 15)], 0)
    allowed &= np.isin(size - (n_id + 2 + 2 * length), _TIME_DIGITS)
    identifier = np.zeros(len(start), np.int64)
    data = np.zeros((len(start), 64 if (length[allowed] > 8).any() else 8), np.uint8)
    shape = size << 16 | length << 8 | n_id
    # frames of one shape are a rectangle of letters; a bus has few shapes
    for frame_shape in np.unique(shape[allowed]).tolist():
        these = np.flatnonzero(allowed & (shape == frame_shape))
        digits = _DIGIT[letters[start[these, np.newaxis] + np.arange(1, frame_shape >> 16)]]
        n_letters, n_bytes = frame_shape & 0xFF, frame_shape >> 8 & 0xFF
        identifier[these] = _number(digits[:, :n_letters])
        pairs = digits[:, n_letters + 1 : n_letters + 1 + 2 * n_bytes]
        data[these, :n_bytes] = pairs[:, ::2] << 4 | pairs[:, 1::2] & 15
        allowed[these] = (digits != _NO_DIGIT).all(axis=1)
    # three and eight hexadecimal digits hold more than 11 and 29 bits
    allowed &= identifier <= np.where(n_id == 8, _LARGEST_EXTENDED, _LARGEST_STANDARD)
    answered = _IS_ANSWER[kind] & (size <= _LONGEST_ANSWER)
    n_garbage = int(size[~allowed & ~answered].sum())
    batch = FrameBatch(identifier, _IS_EXTENDED[kind], _IS_REMOTE[kind], _IS_FD[kind], length, data)
    return batch[allowed], n_garbage


def _number(digits: _ByteArray) -> IntArray:
    weights = 1 << np.arange(4 * (digits.shape[1] - 1), -1, -4, dtype=np.int64)
    number: IntArray = (digits.astype(np.int64) * weights).sum(axis=1)
    return number


def slcan_send(
    arbitration_id: int, data: bytes, *, extended: bool = False, fd: bool = False, remote: bool = False
) -> bytes:
    """Line that asks an adapter to send a frame.

    Parameters
    ----------
    arbitration_id : int
    data : bytes
        At most 8, or 64 with `fd`; for a remote frame as many as are asked for.
    extended : bool
        29-bit identifier.
    fd : bool
        CAN FD, with the faster data rate.
    remote : bool

    Raises
    ------
    InputError
        If there is no frame of that length or with that identifier.

    Examples
    --------
    >>> slcan_send(0x80, bytes([1, 0xAB])) == b"t080201AB" + bytes([13])
    True
    """
    lengths = _LENGTHS.tolist() if fd else _LENGTHS[:9].tolist()
    if len(data) not in lengths or (fd and remote):
        raise InputError("frame over slcan", got=f"{len(data)} bytes", allowed=", ".join(map(str, lengths)))
    if not 0 <= arbitration_id <= (_LARGEST_EXTENDED if extended else _LARGEST_STANDARD):
        raise InputError(
            "frame over slcan", got=f"identifier {arbitration_id:#x}", allowed="11 bits, or 29 extended"
        )
    kind = "b" if fd else "r" if remote else "t"
    identifier = f"{arbitration_id:08X}" if extended else f"{arbitration_id:03X}"
    content = "" if remote else data.hex().upper()
    return f"{kind.upper() if extended else kind}{identifier}{lengths.index(len(data)):X}{content}\r".encode()
