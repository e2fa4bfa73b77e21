"""Signals of a training in a file, for processes that train on them."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.regressors import Run

_GROUPS: Final = ("training", "validation")


def write_signals(file: Path, training: Sequence[Run], validation: Sequence[Run]) -> None:
    """Write runs into an archive of arrays.

    Parameters
    ----------
    file : Path
        Of suffix ``.npz``.
    training, validation : sequence of Run
    """
    arrays = {
        f"{group}_{number}_{axis}": getattr(run, axis)
        for group, runs in zip(_GROUPS, (training, validation), strict=True)
        for number, run in enumerate(runs)
        for axis in ("x", "y")
    }
    with atomic_file.replaced(file) as place:
        np.savez(place, **arrays)


def read_signals(file: Path) -> tuple[tuple[Run, ...], tuple[Run, ...]]:
    """Runs for training and for validation that `write_signals` wrote.

    Parameters
    ----------
    file : Path

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        with np.load(file, allow_pickle=False) as arrays:
            groups = []
            for group in _GROUPS:
                n_runs = sum(name.startswith(f"{group}_") for name in arrays.files) // 2
                groups.append(
                    tuple(
                        Run(arrays[f"{group}_{number}_x"], arrays[f"{group}_{number}_y"])
                        for number in range(n_runs)
                    )
                )
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"signals {file}", got=str(error), allowed="what the study wrote") from error
    return groups[0], groups[1]
