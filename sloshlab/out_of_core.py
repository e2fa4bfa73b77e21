"""Arrays that need not fit into memory, gone through in blocks.

An array of more than `LARGEST_IN_MEMORY_BYTES` lies in a file without a name. It is an ordinary array, of which
only those pages are in memory that somebody has touched; whoever goes through it in `blocks` gives them back after
each, so that a recording of any length takes the memory of a few blocks. A short one is one block, in the same
way.

The file is in the folder for temporary files (`TMPDIR`), as large as the array, and gone with the last reference,
also after a kill -9. Where there is no room for it, or no such file, the array is in memory.
"""

from __future__ import annotations

import contextlib
import errno
import math
import mmap
import os
import sys
import tempfile
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

LARGEST_IN_MEMORY_BYTES: Final = 4 << 20
"""A channel of 240 s at 10 kHz in single precision takes more than twice as much."""
BLOCK_SAMPLES: Final = 1 << 18
"""Of one channel: two megabytes in double precision, which a processor's cache holds."""
_TOGETHER_BYTES: Final = 2 << 20
"""Linux keeps files in pieces of up to so much, and maps all of a piece when one of its pages is touched."""

HAS_UNNAMED_FILES: Final = sys.platform != "win32"


def empty(n: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Array of shape (n,) whose values are not set; of a large one, zero.

    Parameters
    ----------
    n : int
        Elements.
    dtype : data type
    """
    kind = np.dtype(dtype)
    if n * kind.itemsize <= LARGEST_IN_MEMORY_BYTES:
        return np.empty(n, kind)
    with contextlib.suppress(OSError), unnamed_file() as descriptor:
        reserve(descriptor, 0, n * kind.itemsize)
        return np.frombuffer(mmap.mmap(descriptor, n * kind.itemsize), kind)
    return np.empty(n, kind)


def zeros(n: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Array of shape (n,) of zeros."""
    array = empty(n, dtype)
    if _mapping(array) is None:
        array[:] = 0
    return array


@contextlib.contextmanager
def unnamed_file() -> Iterator[int]:
    """Descriptor of a file on the disk that goes with it.

    Raises
    ------
    OSError
        Where there is none.
    """
    if not HAS_UNNAMED_FILES:
        raise OSError(errno.ENOTSUP, "files without a name")
    with tempfile.TemporaryFile() as file:
        yield file.fileno()


def reserve(descriptor: int, offset: int, n_bytes: int) -> None:
    """Lengthen a file by bytes that the disk has: found full while pages are written, it would end the process.

    Raises
    ------
    OSError
        If there is no room.
    """
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(descriptor, offset, n_bytes)
    else:
        os.truncate(descriptor, offset + n_bytes)


def blocks(n: int, *arrays: npt.NDArray[Any], of: int | None = None) -> Iterator[slice]:
    """Slices of at most so many samples, one after the other; what they touched of the arrays is given back.

    Parameters
    ----------
    n : int
        Samples in all.
    *arrays : ndarray
        With samples along the first axis; those that lie in memory stay there.
    of : int, optional
        Samples of a block, `BLOCK_SAMPLES` if not given.

    Examples
    --------
    >>> list(blocks(5, of=2))
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    n_of_block = BLOCK_SAMPLES if of is None else of
    for start in range(0, n, n_of_block):
        part = slice(start, min(start + n_of_block, n))
        yield part
        for array in arrays:
            release(array[part])


def release_behind(block: int, n_of_block: int, *arrays: npt.NDArray[Any]) -> None:
    """Give back what lies before a block, for one who goes through short blocks in order.

    Parameters
    ----------
    block : int
        Whose samples are no longer used, nor those before it.
    n_of_block : int
        Samples.
    *arrays : ndarray
    """
    # some at once: each time costs a call of the system, and the pages at the border twice
    n_at_once = max(BLOCK_SAMPLES // n_of_block, 1)
    if (block + 1) % n_at_once == 0:
        for array in arrays:
            release(array[max(block + 1 - 2 * n_at_once, 0) * n_of_block : (block + 1) * n_of_block])


def release(array: npt.NDArray[Any]) -> None:
    """Give back the memory of an array that lies in a file; its values are kept there.

    Parameters
    ----------
    array : ndarray
        Also part of a larger one; nothing is done if it lies in memory.
    """
    mapping = _mapping(array)
    if mapping is None or not array.size or not hasattr(mapping, "madvise"):
        return
    ends = [(n - 1) * stride for n, stride in zip(array.shape, array.strides, strict=True)]
    address = array.__array_interface__["data"][0]
    low = address + sum(min(end, 0) for end in ends)
    high = address + sum(max(end, 0) for end in ends) + array.itemsize
    begins = np.frombuffer(mapping, np.uint8).__array_interface__["data"][0]
    # whole pages, those of the neighbours with them: the system brings them together, and they come back
    first = max((low - begins) // _TOGETHER_BYTES - 1, 0) * _TOGETHER_BYTES
    last = min((math.ceil((high - begins) / _TOGETHER_BYTES) + 1) * _TOGETHER_BYTES, len(mapping))
    if last > first:
        mapping.madvise(mmap.MADV_DONTNEED, first, last - first)


def _mapping(array: npt.NDArray[Any]) -> mmap.mmap | None:
    """The file in which an array lies; None if it is in memory."""
    base: object = array
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, memoryview):
        base = base.obj
    return base if isinstance(base, mmap.mmap) else None
