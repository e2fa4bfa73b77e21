"""Stopping and going on: a checkpoint from which a run continues to the same bytes.

A file is a magic line, the SHA-256 of the rest, and an npz archive of plain arrays; no pickle. It is
written atomically. What a step needs beyond the state is listed anew from the positions at which it was
last listed, so that pairs have the same order and sums the same rounding.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, LiquidColumn, Numerics, TankSetup
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError

MAGIC: Final = b"sloshlab numerical tank checkpoint, version 1\n"
# looked at before the file is read into memory
LARGEST_FILE_BYTES: Final = 256 * 2**20
_HASH_BYTES: Final = 32
_EXTRA: Final = "extra_"


def save(
    tank: NumericalTank, path: str | os.PathLike[str], extra: Mapping[str, NDArray[Any]] | None = None
) -> None:
    """Write the whole state of a run, atomically.

    Parameters
    ----------
    tank : NumericalTank
    path : path-like
    extra : mapping of str to ndarray, optional
        What else must be there to go on: forces so far, the state of a structure.
    """
    setup = np.frombuffer(json.dumps(asdict(tank.setup)).encode(), np.uint8)
    content = io.BytesIO()
    more = {_EXTRA + name: values for name, values in (extra or {}).items()}
    arrays: dict[str, Any] = {"setup": setup, **tank.checkpoint_arrays(), **more}
    np.savez(content, **arrays)
    body = content.getvalue()
    write_bytes(path, MAGIC + hashlib.sha256(body).digest() + body)


def load(path: str | os.PathLike[str]) -> NumericalTank:
    """Read a checkpoint and return the run, ready to go on.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    InputError
        If the file is no checkpoint, is damaged, or describes a tank that cannot be.
    """
    return load_with_extra(path)[0]


def load_with_extra(path: str | os.PathLike[str]) -> tuple[NumericalTank, dict[str, NDArray[Any]]]:
    """Read a checkpoint and return the run and what was saved with it.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    InputError
        As in `load`.
    """
    arrays = _arrays(Path(path))
    try:
        tank = NumericalTank(_setup(bytes(arrays.pop("setup"))))
        tank.restore(arrays)
    except (KeyError, TypeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}", got=f"a checkpoint without valid {error}", remedy="start the run again"
        ) from error
    return tank, {name.removeprefix(_EXTRA): arrays[name] for name in arrays if name.startswith(_EXTRA)}


def _arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of a file after its hash was found right."""
    size = path.stat().st_size
    if size > LARGEST_FILE_BYTES:
        raise InputError(f"{path}", got=f"{size} bytes", allowed=f"at most {LARGEST_FILE_BYTES}")
    content = path.read_bytes()
    if not content.startswith(MAGIC):
        raise InputError(f"{path}", got="another file", allowed="a checkpoint of the numerical tank, version 1")
    digest, body = content[len(MAGIC) : len(MAGIC) + _HASH_BYTES], content[len(MAGIC) + _HASH_BYTES :]
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


def _setup(text: bytes) -> TankSetup:
    # built anew by their classes, so that all checks of a setup are made again
    values = json.loads(text.decode())
    return TankSetup(
        **{
            **values,
            "box": Box(**values["box"]),
            "column": LiquidColumn(**values["column"]),
            "liquid": Liquid(**values["liquid"]),
            "numerics": Numerics(**values["numerics"]),
        }
    )
