"""Stopping and going on: a checkpoint from which a run continues to the same bytes.

What a step needs beyond the state is listed anew from the positions at which it was
last listed, so that pairs have the same order and sums the same rounding.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Final

from numpy.typing import NDArray

from acquisition.numerical_tank.checkpoint_file import read_run, write_run
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, LiquidColumn, Numerics, TankSetup

MAGIC: Final = b"sloshlab numerical tank checkpoint, version 1\n"
_PARTS: Final[dict[str, Any]] = {"box": Box, "column": LiquidColumn, "liquid": Liquid, "numerics": Numerics}


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
    write_run(path, MAGIC, tank, extra)


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
    return read_run(path, MAGIC, _at_rest)


def _at_rest(values: dict[str, Any]) -> NumericalTank:
    parts = {name: part(**values.pop(name)) for name, part in _PARTS.items()}
    return NumericalTank(TankSetup(**parts, **values))
