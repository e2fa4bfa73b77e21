"""The file of a checkpoint: a magic line, the SHA-256 of the rest, and an npz archive of plain arrays.

No pickle; written atomically.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError

# looked at before the file is read into memory
LARGEST_FILE_BYTES: Final = 256 * 2**20
_HASH_BYTES: Final = 32
_EXTRA: Final = "extra_"


class StoredRun(Protocol):
    """A computation that can be stopped and taken up."""

    setup: Any  # a frozen dataclass

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Copies of everything that a later step depends on."""

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take up the state that `checkpoint_arrays` returned."""


R = TypeVar("R", bound=StoredRun)


def write_run(
    path: str | os.PathLike[str], magic: bytes, run: StoredRun, extra: Mapping[str, NDArray[Any]] | None
) -> None:
    """Write the whole state of a run, atomically.

    Parameters
    ----------
    path : path-like
    magic : bytes
    run : StoredRun
    extra : mapping of str to ndarray, optional
        What else must be there to go on.
    """
    setup = np.frombuffer(json.dumps(asdict(run.setup)).encode(), np.uint8)
    more = {_EXTRA + name: values for name, values in (extra or {}).items()}
    write_arrays(path, magic, {"setup": setup, **run.checkpoint_arrays(), **more})


def read_run(
    path: str | os.PathLike[str], magic: bytes, at_rest: Callable[[dict[str, Any]], R]
) -> tuple[R, dict[str, NDArray[Any]]]:
    """Read what `write_run` wrote; return the run, ready to go on, and what was saved with it.

    Parameters
    ----------
    path : path-like
    magic : bytes
    at_rest : callable
        The run of a setup that is given as plain values, built anew so that all its checks are made again.

    Raises
    ------
    InputError
        If the file is no checkpoint, is damaged, or describes a run that cannot be.
    """
    arrays = read_arrays(path, magic)
    try:
        run = at_rest(json.loads(bytes(arrays.pop("setup")).decode()))
        run.restore(arrays)
    except (AttributeError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}", got=f"a checkpoint without valid {error}", remedy="start the run again"
        ) from error
    return run, {name.removeprefix(_EXTRA): arrays[name] for name in arrays if name.startswith(_EXTRA)}


def take_up(targets: Mapping[str, NDArray[Any]], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Fill arrays in place from those of a checkpoint.

    Parameters
    ----------
    targets : mapping of str to ndarray
        By their names in the checkpoint.
    arrays : mapping of str to ndarray

    Raises
    ------
    KeyError
        If one is missing.
    InputError
        If one has another shape or type, or is not finite.
    """
    for name, target in targets.items():
        given = arrays[name]
        # the file may belong to another tank; an array of another shape would be broadcast without a word
        if given.shape != target.shape or given.dtype != target.dtype or not np.isfinite(given).all():
            raise InputError(
                f"checkpoint, {name}",
                got=f"{given.dtype} {given.shape}",
                allowed=f"finite {target.dtype} {target.shape}",
            )
        target[...] = given


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
