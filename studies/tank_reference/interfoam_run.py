"""Running a case: mesh, solver, and one line where either is not there or fails."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Final

from sloshlab.errors import InputError, SloshlabError
from studies.tank_reference.interfoam_case import InterfoamCase, write_case

_PROJECT_FOLDER: Final = "WM_PROJECT_DIR"
_DEBIAN_FOLDER: Final = "/usr/share/openfoam"
"""Where Debian's package has OpenFOAM's own settings, which every program of it reads first."""
_REMEDY: Final = "apt-get install openfoam (or source OpenFOAM's bashrc); results are kept in the repository"


class SolverError(SloshlabError, RuntimeError):
    """OpenFOAM stopped before the end of a case."""


def found_program(name: str) -> str:
    """Path of a program of OpenFOAM.

    Raises
    ------
    InputError
        If it is not on PATH.
    """
    path = shutil.which(name)
    if path is None:
        raise InputError(name, got="no such program on PATH", remedy=_REMEDY)
    return path


def run_case(case: InterfoamCase, folder: Path, *, niceness: int = 15) -> None:
    """Write a case and compute it to its end.

    Parameters
    ----------
    case : InterfoamCase
    folder : Path
        What is in it from before is removed.
    niceness : int
        Added to that of this process.

    Raises
    ------
    InputError
        If OpenFOAM is not installed.
    SolverError
        If it stops before the end; its own words are in ``log.PROGRAM`` of the folder.
    """
    programs = [found_program(name) for name in ("blockMesh", case.solver)]
    shutil.rmtree(folder, ignore_errors=True)
    write_case(case, folder)
    environment = {_PROJECT_FOLDER: _DEBIAN_FOLDER, **os.environ}
    for program in programs:
        log = folder / f"log.{Path(program).name}"
        with log.open("wb") as file:
            ended = subprocess.run(
                [program],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                preexec_fn=lambda: os.nice(niceness),
                check=False,
            )
        if ended.returncode:
            raise SolverError(f"{Path(program).name}: exit status {ended.returncode}; remedy: read {log}")
