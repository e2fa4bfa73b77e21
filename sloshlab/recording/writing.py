"""Writing recordings."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import xarray as xr

from sloshlab import atomic_file, interrupt
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.recording.validation import validate_recording


def write_recording(
    recording: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    encoding: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Validate a recording and write it atomically.

    Parameters
    ----------
    recording : xarray.Dataset
        In the recording format, units stated on every channel.
    path : path-like
        Where to write.
    encoding : mapping, optional
        Per variable, as for `xarray.Dataset.to_netcdf`; scaled integers are given here.

    Raises
    ------
    RecordingError
        If the data set breaks the format; nothing is written then.
    """
    # nothing is written that `read_recording` would refuse
    validate_recording(recording, name=str(path))
    chosen: dict[str, dict[str, Any]] = {}
    for name, variable in recording.variables.items():
        compressed = {"zlib": True, "complevel": 4, "shuffle": True} if variable.ndim else {}
        # texts of varying length cannot be compressed
        if variable.dtype.kind not in "fiu":
            compressed = {}
        chosen[str(name)] = {**compressed, **(encoding or {}).get(str(name), {})}
    # an interrupt within xarray's call would leave its lock taken and closing would wait for ever: it is held
    # back
    with atomic_file.replaced(path) as temporary, NETCDF_LOCK, interrupt.held():
        recording.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=chosen)
