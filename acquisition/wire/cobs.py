"""Consistent overhead byte stuffing: any bytes become bytes without a zero, so that a zero ends a frame.

Cheshire and Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking 7 (1999)
159–172, doi:10.1109/90.769765. One byte of overhead in each 254, whatever the data: the length of a
frame on the wire does not depend on what is measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

ByteArray = NDArray[np.uint8]

_LONGEST_BLOCK: Final = 254


def longest_encoding(n_bytes: int) -> int:
    """Most bytes that `n_bytes` can become, without the zero that ends them.

    Examples
    --------
    >>> longest_encoding(0), longest_encoding(254), longest_encoding(255)
    (1, 255, 257)
    """
    return n_bytes + max(1, -(-n_bytes // _LONGEST_BLOCK))


def encode(body: bytes) -> bytes:
    """Stuff `body`; the zero that ends a frame is not appended.

    Examples
    --------
    >>> encode(b"\\x11\\x22\\x00\\x33").hex(" ")
    '03 11 22 02 33'
    """
    stuffed = np.empty(longest_encoding(len(body)), np.uint8)
    size = _encode(_as_array(body), stuffed)
    return stuffed[:size].tobytes()


def decode(encoded: bytes) -> bytes:
    """Take the stuffing out again.

    Raises
    ------
    ValueError
        If `encoded` is empty, holds a zero, or ends within a block.

    Examples
    --------
    >>> decode(bytes.fromhex("03 11 22 02 33")).hex(" ")
    '11 22 00 33'
    """
    stuffed = _as_array(encoded)
    body = np.empty(len(encoded), np.uint8)
    size = _decode(stuffed, 0, stuffed.size, body, 0)
    if size < 0:
        raise ValueError(f"not stuffed bytes: {encoded[:16].hex(' ')}…, {len(encoded)} bytes")
    return body[:size].tobytes()


@dataclass(frozen=True)
class DecodedRuns:
    """What stood between the zeros of a stream.

    Attributes
    ----------
    bodies : ndarray of uint8
        All decoded runs, one after the other.
    starts, stops : ndarray of int64, shape (n_runs,)
        Where each decoded run lies in `bodies`.
    encoded_sizes : ndarray of int64, shape (n_runs,)
        Bytes of each run on the wire, without its zero.
    n_garbage_bytes : int
        Bytes of runs that are too short, too long or not stuffed bytes.
    n_garbage_runs : int
        How many such runs there were.
    n_used : int
        Bytes up to and including the last zero.
    """

    bodies: ByteArray
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]
    encoded_sizes: NDArray[np.int64]
    n_garbage_bytes: int
    n_garbage_runs: int
    n_used: int


def decode_runs(stream: bytes | bytearray | memoryview, *, shortest: int, longest: int) -> DecodedRuns:
    """Decode everything that a zero ends; empty runs (zeros in a row) mean nothing.

    Parameters
    ----------
    stream : bytes-like
    shortest, longest : int
        Sizes of a decoded body [bytes]; runs that decode to anything else are garbage. `shortest` ≥ 1.

    Examples
    --------
    >>> runs = decode_runs(bytes.fromhex("03 11 22 00 09 09 00 02 33"), shortest=1, longest=254)
    >>> runs.bodies[runs.starts[0]:runs.stops[0]].tobytes().hex(), runs.n_garbage_bytes, runs.n_used
    ('1122', 2, 7)
    """
    data = _as_array(stream)
    bodies = np.empty(data.size, np.uint8)
    # a body of n bytes takes at least n + 1 bytes and a zero on the wire
    places = np.empty((3, data.size // (shortest + 2) + 1), np.int64)
    n_runs, n_garbage_bytes, n_garbage_runs, n_used = _decode_runs(data, bodies, places, shortest, longest)
    starts, stops, sizes = places[:, :n_runs]
    return DecodedRuns(bodies, starts, stops, sizes, int(n_garbage_bytes), int(n_garbage_runs), int(n_used))


def _as_array(data: bytes | bytearray | memoryview) -> ByteArray:
    """Read-only always, so that the kernels are compiled for one kind of array."""
    array = np.frombuffer(data, np.uint8)
    array.flags.writeable = False
    return array


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _encode(body: ByteArray, stuffed: ByteArray) -> int:
    code_at = 0
    write = 1
    code = 1
    for k in range(body.size):
        if code == 255:
            # 254 bytes without a zero; a new block begins only because more data follow
            stuffed[code_at] = 255
            code_at = write
            write += 1
            code = 1
        if body[k] == 0:
            stuffed[code_at] = code
            code_at = write
            write += 1
            code = 1
        else:
            stuffed[write] = body[k]
            write += 1
            code += 1
    stuffed[code_at] = code
    return write


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _decode(data: ByteArray, start: int, stop: int, body: ByteArray, write: int) -> int:
    """Decode ``data[start:stop]`` to ``body[write:]``; where it ends, or -1 if it cannot be decoded."""
    read = start
    if read == stop:
        return -1
    while read < stop:
        code = int(np.int64(data[read]))
        # a code from a damaged stream may point beyond its run, or beyond the buffer
        if code == 0 or read + code > stop:
            return -1
        for k in range(read + 1, read + code):
            if data[k] == 0:
                return -1
            body[write] = data[k]
            write += 1
        read += code
        # neither a block of 254 bytes nor the last one stands for a zero
        if code < 255 and read < stop:
            body[write] = 0
            write += 1
    return write


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _decode_runs(
    data: ByteArray, bodies: ByteArray, places: NDArray[np.int64], shortest: int, longest: int
) -> tuple[int, int, int, int]:
    longest_run = longest + max(1, -(-longest // 254))
    n_runs, n_garbage_bytes, n_garbage_runs, start, write = 0, 0, 0, 0, 0
    for stop in range(data.size):
        if data[stop] != 0:
            continue
        size = stop - start
        if size > 0:
            # what is longer than any frame is not decoded at all
            end = _decode(data, start, stop, bodies, write) if size <= longest_run else -1
            if end - write < shortest or end - write > longest:
                n_garbage_bytes += size
                n_garbage_runs += 1
            else:
                places[0, n_runs] = write
                places[1, n_runs] = end
                places[2, n_runs] = size
                n_runs += 1
                write = end
        start = stop + 1
    return n_runs, n_garbage_bytes, n_garbage_runs, start
