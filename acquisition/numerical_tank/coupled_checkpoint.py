"""Checkpoints of a tank on a structure: those of the tank, with the structure and its motion in them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank import checkpoint
from acquisition.numerical_tank.coupling import CoupledTank
from acquisition.numerical_tank.structures import Mode, Structure
from sloshlab.errors import InputError

_BESIDE: Final = "beside_"


def save(
    coupled: CoupledTank, path: str | os.PathLike[str], beside: Mapping[str, NDArray[Any]] | None = None
) -> None:
    """Write the whole state of a tank and its structure, atomically.

    Parameters
    ----------
    coupled : CoupledTank
    path : path-like
    beside : mapping of str to ndarray, optional
        What the caller needs to go on, for example what was recorded so far.
    """
    structure = np.frombuffer(json.dumps(asdict(coupled.structure)).encode(), np.uint8)
    more = {_BESIDE + name: values for name, values in (beside or {}).items()}
    checkpoint.save(coupled.tank, path, {"structure": structure, **coupled.structure_arrays(), **more})


def load(path: str | os.PathLike[str]) -> tuple[CoupledTank, dict[str, NDArray[Any]]]:
    """Read a checkpoint; return the run, ready to go on, and what was saved beside it.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    InputError
        If the file is no such checkpoint, is damaged, or describes what cannot be.
    """
    tank, arrays = checkpoint.load_with_extra(path)
    try:
        coupled = CoupledTank(tank.setup, _structure(bytes(arrays["structure"])))
        coupled.restore_structure(arrays)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}",
            got=f"a checkpoint without valid {error}",
            allowed="that of a tank on a structure",
            remedy="start the run again",
        ) from error
    # the tank that was read takes the place of the one at rest
    coupled.tank = tank
    return coupled, {name.removeprefix(_BESIDE): arrays[name] for name in arrays if name.startswith(_BESIDE)}


def _structure(text: bytes) -> Structure:
    values = json.loads(text.decode())
    return Structure(**{**values, "modes": tuple(Mode(**mode) for mode in values["modes"])})
