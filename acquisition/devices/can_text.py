"""CAN frames as text: as a socketcand server sends them, and as an slcan adapter does; many at once."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.frames import FrameArray, FrameKind

ByteArray = NDArray[np.uint8]

_HEX: Final = np.frombuffer(b"0123456789ABCDEF", np.uint8)
# the length code of CAN: one digit also for the lengths of CAN FD beyond 8
_DLC: Final = np.zeros(65, np.uint8)
for _code, _length in enumerate((0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)):
    _DLC[_length] = _HEX[_code]
# seconds since 1970 have ten digits until the year 2286
_STAMP_DIGITS = 10


def socketcand_text(frames: FrameArray, stamps_s: NDArray[np.float64]) -> bytes:
    """``< frame 101 1767225600.000250 0011223344556677 >`` …

    Parameters
    ----------
    frames : FrameArray
        Of CAN, classic, 11-bit identifiers.
    stamps_s : ndarray, shape (n_frames,)
        When each was seen on the bus, seconds since 1970.

    Examples
    --------
    >>> from acquisition.devices.frames import can_frame
    >>> frame = np.zeros(1, can_frame(8))
    >>> frame["id"], frame["length"], frame["data"][0, :2] = 0x123, 2, (1, 0xAB)
    >>> socketcand_text(frame, np.array([12.5]))
    b'< frame 123 0000000012.500000 01AB >'
    """
    n, longest = frames["data"].shape
    is_error = frames["kind"] == FrameKind.ERROR
    text = np.empty((n, 33 + 2 * longest), np.uint8)
    text[:, :8] = np.where(is_error[:, None], _letters(b"< error "), _letters(b"< frame "))
    text[:, 8:11] = _hexadecimal(frames["id"].astype(np.int64), 3)
    text[:, 11] = text[:, 29] = ord(" ")
    text[:, 12:29] = _stamps(stamps_s)
    text[:, 30 : 30 + 2 * longest] = _data(frames["data"])
    # frames of different lengths are cut out of one rectangle: frame by frame they would need a core
    used = np.ones(text.shape, bool)
    used[:, 29] = ~is_error
    used[:, 30 : 30 + 2 * longest] = np.arange(2 * longest) < 2 * frames["length"].astype(np.int64)[:, None]
    text[:, -3:-1] = _letters(b" >")
    used[:, -1] = False
    return text[used].tobytes()


def slcan_text(frames: FrameArray, *, fd: bool) -> bytes:
    """``t10180011223344556677`` and carriage return, or ``d…`` for CAN FD; error frames have no text.

    Examples
    --------
    >>> from acquisition.devices.frames import can_frame
    >>> frame = np.zeros(1, can_frame(8))
    >>> frame["id"], frame["length"], frame["data"][0, :2] = 0x123, 2, (1, 0xAB)
    >>> slcan_text(frame, fd=False)
    b't123201AB\\r'
    """
    frames = frames[frames["kind"] != FrameKind.ERROR]
    n, longest = frames["data"].shape
    text = np.empty((n, 6 + 2 * longest), np.uint8)
    text[:, 0] = np.where(fd & (frames["length"] > 8), ord("d"), ord("t"))
    text[:, 1:4] = _hexadecimal(frames["id"].astype(np.int64), 3)
    text[:, 4] = _DLC[frames["length"]]
    text[:, 5 : 5 + 2 * longest] = _data(frames["data"])
    text[:, -1] = ord("\r")
    used = np.ones(text.shape, bool)
    used[:, 5:-1] = np.arange(2 * longest) < 2 * frames["length"].astype(np.int64)[:, None]
    return text[used].tobytes()


def _letters(text: bytes) -> ByteArray:
    return np.frombuffer(text, np.uint8)


def _hexadecimal(values: NDArray[np.int64], n_digits: int) -> ByteArray:
    shifts = np.arange(4 * (n_digits - 1), -1, -4)
    return np.asarray(_HEX[(values[:, None] >> shifts) & 15])


def _data(data: ByteArray) -> ByteArray:
    digits = np.empty((len(data), 2 * data.shape[1]), np.uint8)
    digits[:, ::2], digits[:, 1::2] = _HEX[data >> 4], _HEX[data & 15]
    return digits


def _stamps(stamps_s: NDArray[np.float64]) -> ByteArray:
    """Ten digits, a point, six digits."""
    micro = np.rint(stamps_s * 1e6).astype(np.int64)
    powers = 10 ** np.arange(_STAMP_DIGITS + 5, -1, -1, dtype=np.int64)
    digits = (micro[:, None] // powers % 10 + ord("0")).astype(np.uint8)
    point = np.full((len(micro), 1), ord("."), np.uint8)
    return np.concatenate([digits[:, :_STAMP_DIGITS], point, digits[:, _STAMP_DIGITS:]], axis=1)
