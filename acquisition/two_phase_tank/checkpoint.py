"""Stopping and going on: a checkpoint from which a run continues to the same bytes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.checkpoint_file import read_arrays, write_arrays
from acquisition.numerical_tank.tank import Box, LiquidColumn
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from sloshlab.errors import InputError

MAGIC: Final = b"sloshlab two-phase tank checkpoint, version 2\n"
_EXTRA: Final = "extra_"
_PARTS: Final = {
    "box": Box,
    "column": LiquidColumn,
    "fluids": Fluids,
    "walls": Walls,
    "numerics": GridNumerics,
}


def save(
    tank: TwoPhaseTank, path: str | os.PathLike[str], extra: Mapping[str, NDArray[Any]] | None = None
) -> None:
    """Write the whole state of a run, atomically.

    Parameters
    ----------
    tank : TwoPhaseTank
    path : path-like
    extra : mapping of str to ndarray, optional
        What else must be there to go on: forces so far.
    """
    setup = np.frombuffer(json.dumps(asdict(tank.setup)).encode(), np.uint8)
    more = {_EXTRA + name: values for name, values in (extra or {}).items()}
    write_arrays(path, MAGIC, {"setup": setup, **tank.checkpoint_arrays(), **more})


def load(path: str | os.PathLike[str]) -> TwoPhaseTank:
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


def load_with_extra(path: str | os.PathLike[str]) -> tuple[TwoPhaseTank, dict[str, NDArray[Any]]]:
    """Read a checkpoint and return the run and what was saved with it.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    InputError
        As in `load`.
    """
    arrays = read_arrays(path, MAGIC)
    try:
        values = json.loads(bytes(arrays.pop("setup")).decode())
        # built anew by their classes, so that all checks of a setup are made again
        parts = {name: part(**values.pop(name)) for name, part in _PARTS.items()}
        tank = TwoPhaseTank(TwoPhaseSetup(**parts, **values))
        tank.restore(arrays)
    except (KeyError, TypeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}", got=f"a checkpoint without valid {error}", remedy="start the run again"
        ) from error
    return tank, {name.removeprefix(_EXTRA): arrays[name] for name in arrays if name.startswith(_EXTRA)}
