"""Writing results: netCDF with the same bytes for the same content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

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
    # the netCDF library is not made for threads; an interrupt within xarray would leave its lock taken for ever
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


def provenance_of(
    command: str, inputs: Iterable[Path], known_sha256: Mapping[Path, str] | None = None
) -> dict[str, Any]:
    """What a result rests on: the command, hashes of the input files and versions.

    Parameters
    ----------
    command : str
        What the user typed.
    inputs : iterable of Path
        Every file that the results depend on.
    known_sha256 : mapping of Path to str, optional
        Hashes that need not be computed again.
    """
    known = known_sha256 or {}
    return {
        "command": command,
        "inputs": {path.name: known.get(path) or sha256_of(path) for path in inputs},
        "versions": versions(),
    }


def stamp_of(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of a result that say what it rests on; the command stands in the report only.

    Files of the same inputs then have the same bytes, wherever they are written.
    """
    return {name: json.dumps(provenance.get(name, {}), sort_keys=True) for name in ("inputs", "versions")}


def report_lines(folder: Path, *, written: bool = True) -> list[str]:
    """Where the report is, for the summary of a command; nothing if none was asked for."""
    return [f"report: {folder / 'report.html'}"] if written else []
