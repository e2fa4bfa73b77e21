"""What is checked of a netCDF-4 file before its library opens it, or is loaded at all.

The HDF5 library (seen in 1.14 and 2.2) walks its global heaps, which hold text attributes and the
references between dimensions and variables, object by object. A free object of size zero, as a damaged
file may hold, sends it round for ever. No exception ends that, so such files are found out here.
"""

from __future__ import annotations

import mmap
import os
import struct
from pathlib import Path

from sloshlab.errors import RecordingError

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HEAP = b"GCOL\x01\x00\x00\x00"
_HEAP_HEADER_BYTES = 16
_OBJECT_HEADER = struct.Struct("<HHIQ")
_SEARCHED_AT_ONCE = 16 << 20
# Objects of a heap are padded to it.
_ALIGNMENT = 8


def require_recording_file(file: Path) -> None:
    """Refuse what is no file; needs no library, so that a misspelt name is told at once.

    Raises
    ------
    RecordingError
    """
    if not file.is_file():
        got = "a folder" if file.is_dir() else "no such file"
        raise RecordingError(f"recording {file}", got=got, allowed="a netCDF-4 file", remedy="check the path")


def require_sound_structure(path: str | os.PathLike[str]) -> None:
    """Refuse a file that is not HDF5, or in which the HDF5 library would never come to an end.

    Parameters
    ----------
    path : path-like
        An existing file. It is searched once, without a copy in memory.

    Raises
    ------
    RecordingError
        If the signature is missing or a global heap is damaged.
    """
    with open(path, "rb") as file:
        head = file.read(len(_SIGNATURE))
        if head != _SIGNATURE:
            raise RecordingError(
                f"recording {path}",
                got="an empty file" if not head else f"a file that begins with {head!r}",
                allowed="a netCDF-4 file",
                remedy="use `sloshlab import` for other formats",
            )
    require_sound_heaps(path, what=f"recording {path}")


def require_sound_heaps(path: str | os.PathLike[str], *, what: str) -> None:
    """Refuse a file in which the HDF5 library would never come to an end; other formats pass.

    Parameters
    ----------
    path : path-like
        An existing, non-empty file. It is searched once, without a copy in memory.
    what : str
        What the message calls the file.

    Raises
    ------
    RecordingError
        If a global heap is damaged.
    """
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        damaged = _first_endless_heap(content)
    if damaged >= 0:
        raise RecordingError(
            what,
            got=f"a damaged heap at byte {damaged}",
            allowed="a complete HDF5 file",
            remedy="the file is damaged; copy it again",
        )


def _first_endless_heap(content: mmap.mmap) -> int:
    """Position of the first heap whose objects do not lead to its end; -1 if there is none."""
    for begin in range(0, len(content), _SEARCHED_AT_ONCE):
        # to the end of a name that begins in this part
        end = min(begin + _SEARCHED_AT_ONCE + len(_HEAP) - 1, len(content))
        start = content.find(_HEAP, begin, end)
        while start >= 0:
            if not _leads_to_its_end(content, start):
                return start
            start = content.find(_HEAP, start + len(_HEAP), end)
        if hasattr(content, "madvise"):
            # what was searched need not stay in memory
            content.madvise(mmap.MADV_DONTNEED, begin, end - begin)
    return -1


def _leads_to_its_end(content: mmap.mmap, start: int) -> bool:
    (size,) = struct.unpack_from("<Q", content, start + 8) if start + 16 <= len(content) else (0,)
    stop = min(start + size, len(content))
    position = start + _HEAP_HEADER_BYTES
    while position + _OBJECT_HEADER.size <= stop:
        index, _, _, n_bytes = _OBJECT_HEADER.unpack_from(content, position)
        # a free object counts its header in its size, a used one does not
        step = n_bytes if index == 0 else _OBJECT_HEADER.size + -(-n_bytes // _ALIGNMENT) * _ALIGNMENT
        if step < _OBJECT_HEADER.size or step > stop - position:
            return False
        position += step
    return True
