"""A case recorded almost the same again: an answer that this changes is an answer by chance."""

from __future__ import annotations

import shutil
import zlib
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.netcdf_lock import NETCDF_LOCK

FloatArray = npt.NDArray[np.float64]

MOVED_BY: Final = 1e-6
"""Of the root mean square of a channel: far below the step of any converter (issue 31, "not by chance")."""


def write_perturbed_case(case: Path, target: Path, seed: int) -> None:
    """Copy a case with every channel moved.

    Parameters
    ----------
    case : Path
        With `rig.toml` and `recordings/*.nc`.
    target : Path
        Made.
    seed : int
        Of the moves, which are others in every case.
    """
    shutil.copytree(case, target, ignore=shutil.ignore_patterns("*.nc"))
    for number, path in enumerate(sorted((case / "recordings").glob("*.nc"))):
        generator = np.random.default_rng([seed, zlib.crc32(case.name.encode()), number])
        # the netCDF library is not made for threads, and several cases are prepared at once
        with NETCDF_LOCK:
            with xr.open_dataset(path, mask_and_scale=False, decode_times=False) as recording:
                moved = _moved(recording.load(), generator)
            # no fill value beside the one that is an attribute already
            encoding = {str(name): {"_FillValue": None} for name in moved.variables}
            moved.to_netcdf(
                target / "recordings" / path.name, format="NETCDF4", engine="netcdf4", encoding=encoding
            )


def _moved(recording: xr.Dataset, generator: np.random.Generator) -> xr.Dataset:
    channels = {
        str(name): ("time", perturbed(channel.values, generator), _attributes(channel))
        for name, channel in recording.data_vars.items()
    }
    return recording.assign(channels)


def perturbed(values: npt.NDArray[np.generic], generator: np.random.Generator) -> FloatArray:
    """Values moved by a normal deviate of `MOVED_BY` times their RMS; equal values move equally.

    So a held or clipped reading stays one, as if the steps of the converter were a little uneven.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Counts or physical values; NaN stays.
    generator : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n,)
        In the same unit, never as integers.
    """
    exact = np.asarray(values, dtype=float)
    distinct, place = np.unique(exact, return_inverse=True)
    size = float(np.sqrt(np.nanmean(exact**2))) if np.isfinite(exact).any() else 0.0
    moves = MOVED_BY * size * generator.standard_normal(distinct.size)
    return exact + moves[place]


def _attributes(channel: xr.DataArray) -> dict[str, object]:
    """Those of the channel; clipping is judged by the step of the converter, which floats no longer show."""
    attributes = dict(channel.attrs)
    if channel.dtype.kind in "iu":
        attributes["adc_step"] = abs(float(attributes.get("scale_factor", 1.0)))
    return attributes
