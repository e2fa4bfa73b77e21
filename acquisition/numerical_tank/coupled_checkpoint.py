"""Checkpoints of a tank on a structure: those of the tank, with the structure and its motion in them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.carried_tank import SloshingTank
from acquisition.numerical_tank.computed_force import PARTICLES, TankMethod
from acquisition.numerical_tank.coupling import CoupledTank
from acquisition.numerical_tank.structures import Mode, Structure
from sloshlab.errors import InputError

_BESIDE: Final = "beside_"


@dataclass(frozen=True)
class CarriedMethod:
    """How a liquid on a structure is computed.

    Attributes
    ----------
    couple : callable
        Takes the setup of a tank and a structure, returns both coupled.
    tank : TankMethod
        Of the tank alone, which keeps and takes up its state.
    """

    couple: Callable[[Any, Structure], SloshingTank]
    tank: TankMethod


CARRIED_PARTICLES: Final = CarriedMethod(CoupledTank, PARTICLES)
"""Smoothed particles and a structure by turns."""


def save(
    coupled: SloshingTank,
    path: str | os.PathLike[str],
    beside: Mapping[str, NDArray[Any]] | None = None,
    method: CarriedMethod = CARRIED_PARTICLES,
) -> None:
    """Write the whole state of a tank and its structure, atomically.

    Parameters
    ----------
    coupled : SloshingTank
    path : path-like
    beside : mapping of str to ndarray, optional
        What the caller needs to go on, for example what was recorded so far.
    method : CarriedMethod
        Of the tank.
    """
    structure = np.frombuffer(json.dumps(asdict(coupled.structure)).encode(), np.uint8)
    more = {_BESIDE + name: values for name, values in (beside or {}).items()}
    method.tank.save(coupled.tank, Path(path), {"structure": structure, **coupled.structure_arrays(), **more})


def load(
    path: str | os.PathLike[str], method: CarriedMethod = CARRIED_PARTICLES
) -> tuple[SloshingTank, dict[str, NDArray[Any]]]:
    """Read a checkpoint; return the run, ready to go on, and what was saved beside it.

    Parameters
    ----------
    path : path-like
    method : CarriedMethod
        With which it was saved.

    Raises
    ------
    InputError
        If the file is no such checkpoint, is damaged, or describes what cannot be.
    """
    tank, arrays = method.tank.load(Path(path))
    try:
        coupled = method.couple(tank.setup, _structure(bytes(arrays["structure"])))
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
