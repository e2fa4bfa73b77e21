"""Recordings as xarray: one as a data set, a folder of them as a tree."""

from __future__ import annotations

import os
from pathlib import Path

import xarray as xr

from sloshlab.errors import InputError
from sloshlab.recording import read_recording


def open_recording(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read and validate one recording.

    Parameters
    ----------
    path : path-like
        A netCDF-4 file in the recording format.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` [s]; one variable a channel, in SI units, NaN where lost, upward positive; ``quality``
        where the recorder flagged samples. Its attributes say what was recorded.

    Raises
    ------
    RecordingError
        If the file is no recording, or holds what no analysis can use.
    """
    return read_recording(path)


def open_campaign(folder: str | os.PathLike[str], pattern: str = "*.nc") -> xr.DataTree:
    """Read all recordings of a folder.

    Parameters
    ----------
    folder : path-like
    pattern : str
        Of the file names that count.

    Returns
    -------
    xarray.DataTree
        One node a recording, called by its file name without ``.nc``, in the order of the names; each is as
        `open_recording` gives it. All of them are in memory.

    Raises
    ------
    InputError
        If there is no such folder, or no recording in it.
    RecordingError
        If a file is no recording.
    """
    place = Path(folder)
    files = sorted(place.glob(pattern)) if place.is_dir() else []
    if not files:
        got = f"no file {pattern}" if place.is_dir() else "a file" if place.exists() else "no such folder"
        raise InputError(f"campaign {place}", got=got, allowed="a folder with recordings", remedy="check the path")
    return xr.DataTree.from_dict({file.stem: read_recording(file) for file in files}, name=place.resolve().name)
