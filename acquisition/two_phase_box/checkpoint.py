"""Stopping and going on: a checkpoint from which a run continues to the same bytes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Final

from numpy.typing import NDArray

from acquisition.numerical_tank.checkpoint_file import read_run, write_run
from acquisition.numerical_tank.tank import Box, LiquidColumn
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_box.simulation import TwoPhaseBox
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls

MAGIC: Final = b"sloshlab two-phase box checkpoint, version 1\n"
_PARTS: Final[dict[str, Any]] = {
    "box": Box,
    "column": LiquidColumn,
    "fluids": Fluids,
    "walls": Walls,
    "numerics": GridNumerics,
}


def save(tank: TwoPhaseBox, path: str | os.PathLike[str], extra: Mapping[str, NDArray[Any]] | None = None) -> None:
    """Write the whole state of a run, atomically.

    Parameters
    ----------
    tank : TwoPhaseBox
    path : path-like
    extra : mapping of str to ndarray, optional
        What else must be there to go on: forces so far.
    """
    write_run(path, MAGIC, tank, extra)


def load_with_extra(path: str | os.PathLike[str]) -> tuple[TwoPhaseBox, dict[str, NDArray[Any]]]:
    """Read a checkpoint and return the run, ready to go on, and what was saved with it.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    InputError
        If the file is no checkpoint, is damaged, or describes a tank that cannot be.
    """
    return read_run(path, MAGIC, _at_rest)


def _at_rest(values: dict[str, Any]) -> TwoPhaseBox:
    plane = dict(values.pop("plane"))
    parts = {name: part(**plane.pop(name)) for name, part in _PARTS.items()}
    return TwoPhaseBox(TwoPhaseBoxSetup(TwoPhaseSetup(**parts, **plane), **values))
