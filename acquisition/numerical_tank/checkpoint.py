"""Stopping and going on: a checkpoint from which a run continues to the same bytes.

What a step needs beyond the state is listed anew from the positions at which it was
last listed, so that pairs have the same order and sums the same rounding.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.checkpoint_file import read_arrays, write_arrays
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, LiquidColumn, Numerics, TankSetup
from sloshlab.errors import InputError

MAGIC: Final = b"sloshlab numerical tank checkpoint, version 1\n"
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
    more = {_EXTRA + name: values for name, values in (extra or {}).items()}
    write_arrays(path, MAGIC, {"setup": setup, **tank.checkpoint_arrays(), **more})


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
    arrays = read_arrays(path, MAGIC)
    try:
        tank = NumericalTank(_setup(bytes(arrays.pop("setup"))))
        tank.restore(arrays)
    except (KeyError, TypeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}", got=f"a checkpoint without valid {error}", remedy="start the run again"
        ) from error
    return tank, {name.removeprefix(_EXTRA): arrays[name] for name in arrays if name.startswith(_EXTRA)}


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
