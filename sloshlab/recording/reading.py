"""Reading recordings, each in a process of its own with limits: files are not trusted."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import xarray as xr

from sloshlab.errors import RecordingError, SloshlabError
from sloshlab.file_structure import require_recording_file, require_sound_structure
from sloshlab.hdf5_contents import require_self_contained
from sloshlab.limited_process import ReadingLimits, UntrustedFile
from sloshlab.netcdf_lock import NETCDF_ERRORS, NETCDF_LOCK
from sloshlab.recording.attributes import RunAttributes, attributes_of, validated_attributes
from sloshlab.recording.decoding import MAXIMUM_DECODED_BYTES, decoded
from sloshlab.recording.time_axis import time_coordinate

_LIMITS: Final = ReadingLimits(memory_bytes=MAXIMUM_DECODED_BYTES + 2**31, computing_s=300.0)
"""Beside the recording its time coordinate and blocks are in memory. The largest recording takes 90 s to decode
(70 MB/s, raw_data/numerical_tank on one core of 2 GHz); more than three times that is no reading any more."""


def read_recording(
    path: str | os.PathLike[str],
    *,
    maximum_decoded_bytes: int = MAXIMUM_DECODED_BYTES,
) -> xr.Dataset:
    """Read and validate one recording.

    Parameters
    ----------
    path : path-like
        A netCDF-4 file in the recording format.
    maximum_decoded_bytes : int
        Recordings that need more memory than this are refused before anything is allocated.

    Returns
    -------
    xarray.Dataset
        Dimension ``time``; channels float64 (float32 where stored so, or as counts of up to 16 bits) in
        SI units, NaN where lost; ``quality`` uint8 where present. Upward positive.

    Raises
    ------
    RecordingError
        If the file is not a recording, or holds what no analysis can use.
    """
    read = _untrusted(Path(path)).read(_read_here, os.fspath(path), maximum_decoded_bytes)
    variables = {name: xr.Variable(*parts) for name, parts in read["variables"].items()}
    recording = xr.Dataset(variables, coords=time_coordinate(read["time"]), attrs=read["attributes"])
    recording["time"].attrs["units"] = "s"
    return recording


def read_attributes(path: str | os.PathLike[str]) -> RunAttributes:
    """Read and validate only the global attributes of a recording.

    Raises
    ------
    RecordingError
        If the file cannot be opened, or an attribute is missing or of a wrong type.
    """
    attributes = _untrusted(Path(path)).read(_attributes_here, os.fspath(path))
    return validated_attributes(RunAttributes, attributes, what=str(path))


def read_attributes_of_many(paths: Sequence[str | os.PathLike[str]]) -> list[RunAttributes]:
    """Read and validate the global attributes of recordings; many in one go, which costs a fraction.

    Raises
    ------
    RecordingError
        As `read_attributes`, for the first recording of which it would be raised.
    """
    try:
        read = _untrusted(Path(paths[0])).read(_attributes_of_many_here, [os.fspath(path) for path in paths])
    except SloshlabError:
        # one of them has ended the process that read them: which, and why, tells a process each
        read = [None] * len(paths)
    return [
        read_attributes(path)
        if attributes is None
        else validated_attributes(RunAttributes, attributes, what=str(path))
        for path, attributes in zip(paths, read, strict=True)
    ]


def _untrusted(file: Path) -> UntrustedFile:
    """The file, after what can be told without a child process."""
    require_recording_file(file)
    # heavy, and so imported only where a file is opened; here, so that every child has them already
    import h5py  # noqa: F401
    import netCDF4  # noqa: F401

    return UntrustedFile(f"recording {file}", _LIMITS, RecordingError)


def _read_here(path: str, maximum_decoded_bytes: int) -> dict[str, Any]:
    """The parts of a recording, read in this process."""
    with _opened(Path(path)) as source:
        recording = decoded(source, path, maximum_decoded_bytes)
    return {
        "attributes": recording.attrs,
        "time": recording["time"].values,
        "variables": {
            name: (variable.dims, variable.values, variable.attrs)
            for name, variable in recording.data_vars.items()
        },
    }


def _attributes_here(path: str) -> dict[str, Any]:
    with _opened(Path(path)) as source:
        return attributes_of(source)


def _attributes_of_many_here(paths: list[str]) -> list[dict[str, Any] | None]:
    found: list[dict[str, Any] | None] = []
    for path in paths:
        try:
            found.append(_attributes_here(path))
        except RecordingError:
            found.append(None)
    return found


@contextlib.contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Open a netCDF file for reading; whatever the reader stumbles over becomes one `RecordingError`."""
    import netCDF4

    try:
        # before the library opens it: a damaged heap keeps HDF5 busy for ever, and no exception ends that
        require_sound_structure(file)
        require_self_contained(file, what=f"recording {file}")
        with NETCDF_LOCK, netCDF4.Dataset(file, mode="r") as source:
            # counts are scaled here, block by block, so that only the result is large
            source.set_auto_maskandscale(False)
            yield source
    except RecordingError:
        raise
    except NETCDF_ERRORS as error:
        raise RecordingError(
            f"recording {file}",
            got=f"a file that cannot be read ({error})",
            allowed="a complete netCDF-4 file",
            remedy="the file is cut short, damaged or of another format; copy it again or use `sloshlab import`",
        ) from error
