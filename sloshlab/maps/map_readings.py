"""Numbers read from a map over ω̄ and ū: the region near its largest value, the mean along one acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr


@dataclass(frozen=True)
class Region:
    """A part of a map.

    Attributes
    ----------
    lowest_u_bar, mean_u_bar, highest_u_bar : float
        Of its points of the grid.
    share : float
        Of the measured points.
    """

    lowest_u_bar: float
    mean_u_bar: float
    highest_u_bar: float
    share: float


def region_near_largest(values: xr.DataArray, share_of_largest: float) -> Region:
    """Where a map is at least a share of its largest value.

    Parameters
    ----------
    values : xarray.DataArray
        Over `omega_bar` and `u_bar`; NaN outside the measured region, finite somewhere.
    share_of_largest : float
        0 … 1.
    """
    grid = values.transpose("omega_bar", "u_bar").values
    above = grid >= share_of_largest * np.nanmax(grid)
    places = np.broadcast_to(values["u_bar"].values, grid.shape)[above]
    share = float(above.sum() / np.isfinite(grid).sum())
    return Region(float(places.min()), float(places.mean()), float(places.max()), share)


def mean_along_acceleration(values: xr.DataArray, acceleration_g: float) -> float:
    """Mean over ω̄ of the first value at or beyond ū = (a₀/g)/ω̄² that lies within two cells of it.

    Parameters
    ----------
    values : xarray.DataArray
        Over `omega_bar` and `u_bar`; NaN outside the measured region.
    acceleration_g : float
        a₀/g, which is ū ω̄².

    Returns
    -------
    float
        NaN where the map does not reach this acceleration at any ω̄.
    """
    grid = values.transpose("omega_bar", "u_bar")
    u_bar, omega_bar = grid["u_bar"].values, grid["omega_bar"].values
    cell = float(np.median(np.diff(u_bar)))
    found = []
    for row, wanted in zip(grid.values, acceleration_g / omega_bar**2, strict=True):
        known = np.flatnonzero(np.isfinite(row) & (u_bar >= wanted) & (u_bar <= wanted + 2 * cell))
        found += [float(row[known[0]])] if known.size else []
    return float(np.mean(found)) if found else float("nan")
