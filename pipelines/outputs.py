"""Writing results: netCDF with the same bytes for the same content."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipelines.results import SweepExperiment
from sloshlab import atomic_file, interrupt
from sloshlab.netcdf_lock import NETCDF_LOCK

_HASH_BLOCK = 1 << 20
_SMALLEST_COMPRESSED_SIZE = 1000


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a result atomically; text is stored as fixed-width characters so that bytes repeat."""
    encoding: dict[str, dict[str, Any]] = {}
    stored = dataset.copy(deep=False)
    for name in [*stored.data_vars, *stored.coords]:
        variable = stored[name]
        if variable.dtype.kind in "OU":
            stored[name] = variable.astype(str)
            encoding[str(name)] = {"dtype": "S1", "char_dim_name": f"{name}_length"}
        elif variable.size >= _SMALLEST_COMPRESSED_SIZE and variable.dtype.kind == "f":
            encoding[str(name)] = {"zlib": True, "complevel": 4, "shuffle": True, "_FillValue": np.nan}
    with atomic_file.replaced(path) as temporary, NETCDF_LOCK, interrupt.held():
        stored.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as source:
        while block := source.read(_HASH_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Versions of everything that a result depends on."""
    import platform
    from importlib.metadata import version

    names = ("sloshlab", "numpy", "scipy", "numba", "xarray", "netCDF4")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


def write_experiment(
    experiment: SweepExperiment, folder: Path, *, command: str, report: bool = True
) -> dict[str, Any]:
    """Write `windows.nc`, `maps.nc` and the report; return the summary of the command.

    Parameters
    ----------
    experiment : SweepExperiment
        What was analysed.
    folder : Path
        Made if it is not there. All files appear together, complete, or none does.
    command : str
        What the user typed, for the report.
    report : bool
        False leaves the report and its figures out.

    Returns
    -------
    dict
        ``lines`` for people, ``flags``, and numbers for machines.
    """
    known = {run.path: run.sha256 for run in experiment.runs}
    provenance = {
        "command": command,
        "inputs": {path.name: known.get(path) or sha256_of(path) for path in experiment.inputs},
        "versions": versions(),
        "n_unsteady_windows": sum(int(run.windows.attrs["n_unsteady_windows"]) for run in experiment.runs),
    }
    with atomic_file.filled_folder(folder) as complete:
        _write_results(experiment, complete, provenance)
        if report:
            from pipelines.report import write_report

            write_report(dataclasses.replace(experiment, provenance=provenance), complete)
    n_windows = int(experiment.windows.sizes["window"])
    n_unsteady = provenance["n_unsteady_windows"]
    left_out = f"; {n_unsteady} left out, their amplitude changes too quickly" if n_unsteady else ""
    lines = [f"windows: {folder / 'windows.nc'} ({n_windows} windows{left_out})", f"maps: {folder / 'maps.nc'}"]
    return {
        "lines": lines + ([f"report: {folder / 'report.html'}"] if report else []),
        "flags": list(experiment.flags),
        "runs": len(experiment.runs),
        "windows": n_windows,
        "unsteady_windows": n_unsteady,
        "output": str(folder),
    }


def _write_results(experiment: SweepExperiment, folder: Path, provenance: dict[str, Any]) -> None:
    for name, dataset in (("windows.nc", experiment.windows), ("maps.nc", experiment.maps)):
        stamped = dataset.assign_attrs(
            title=experiment.title,
            inputs=json.dumps(provenance["inputs"], sort_keys=True),
            versions=json.dumps(provenance["versions"], sort_keys=True),
            half_width_cycles=experiment.settings.half_width_cycles,
            spacing_cycles=experiment.settings.spacing_cycles,
            n_unsteady_windows=provenance["n_unsteady_windows"],
        )
        write_dataset(stamped, folder / name)
