"""The file of a checkpoint: a magic line, the SHA-256 of the rest, and an npz archive of plain arrays.

No pickle; written atomically.
"""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError

# looked at before the file is read into memory
LARGEST_FILE_BYTES: Final = 256 * 2**20
_HASH_BYTES: Final = 32


def write_arrays(path: str | os.PathLike[str], magic: bytes, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays to a file, atomically.

    Parameters
    ----------
    path : path-like
    magic : bytes
        A line that says whose checkpoint it is, and in which version.
    arrays : mapping of str to ndarray
    """
    content = io.BytesIO()
    named: dict[str, Any] = dict(arrays)
    np.savez(content, **named)
    body = content.getvalue()
    write_bytes(path, magic + hashlib.sha256(body).digest() + body)


def read_arrays(path: str | os.PathLike[str], magic: bytes) -> dict[str, Any]:
    """Return the arrays of a file after its hash was found right.

    Parameters
    ----------
    path : path-like
    magic : bytes
        With which the file must begin.

    Raises
    ------
    InputError
        If it is another file, damaged, or too large.
    """
    path = Path(path)
    size = path.stat().st_size
    if size > LARGEST_FILE_BYTES:
        raise InputError(f"{path}", got=f"{size} bytes", allowed=f"at most {LARGEST_FILE_BYTES}")
    content = path.read_bytes()
    if not content.startswith(magic):
        allowed = f"a {magic.decode().strip().removeprefix('sloshlab ')}"
        raise InputError(f"{path}", got="another file", allowed=allowed)
    digest, body = content[len(magic) : len(magic) + _HASH_BYTES], content[len(magic) + _HASH_BYTES :]
    # before anything is unpacked: a damaged archive may declare any sizes
    if hashlib.sha256(body).digest() != digest:
        raise InputError(f"{path}", got="a damaged checkpoint", remedy="go on from an earlier one")
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{path}", got="a checkpoint that cannot be unpacked", remedy="go on from an earlier one"
        ) from error
