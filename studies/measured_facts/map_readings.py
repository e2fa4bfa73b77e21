"""Numbers of a map that were measured too: the largest W̄ and its place, W̄ where the beam works, β."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import xarray as xr

from sloshlab.errors import InputError
from sloshlab.maps.map_readings import mean_along_acceleration, region_near_largest
from sloshlab.viscous_equivalent import maximum_of
from studies.measured_facts.laboratory import (
    BEAM,
    FILLING_LEVEL,
    SHARE_OF_LARGEST,
    WEAKEST_G,
    MeasuredWork,
)

NEEDED: Final = ("w_bar", "beta")


@dataclass(frozen=True)
class FactsOfMap:
    """The numbers of a map that were measured too; NaN where the map has none.

    Attributes
    ----------
    largest : MeasuredWork
        Largest W̄ and its place.
    w_bar_of_beam : float
        W̄ at `BEAM`.
    u_bar_above_85 : tuple of float
        Smallest and largest ū at which W̄ is at least 85 % of the largest.
    largest_beta : float
        Negative if β is negative everywhere.
    beta_at_weakest : float
        Mean of β along 0.25 g, where the map reaches it.
    """

    largest: MeasuredWork
    w_bar_of_beam: float
    u_bar_above_85: tuple[float, float]
    largest_beta: float
    beta_at_weakest: float


def half_filled(maps: xr.Dataset) -> xr.Dataset:
    """Return the maps of the half-filled tank over ω̄ and ū from the result of `sloshlab shaker`.

    Parameters
    ----------
    maps : xarray.Dataset
        `maps.nc`, of one fill level, or of several along `fill_level`.

    Raises
    ------
    InputError
        If W̄ or β is missing, empty, or not of the half-filled tank.
    """
    missing = [name for name in NEEDED if name not in maps]
    if missing:
        raise InputError("maps", got=f"no {', '.join(missing)}", remedy="give the maps.nc of `sloshlab shaker`")
    if "fill_level" in maps.dims:
        levels = maps["fill_level"].values
        if not np.isclose(levels, FILLING_LEVEL, atol=1e-6).any():
            got = ", ".join(f"{level:g}" for level in levels)
            raise InputError("maps, fill level", got=got, allowed=f"one of {FILLING_LEVEL:g}")
        maps = maps.sel(fill_level=FILLING_LEVEL, method="nearest")
    for name in NEEDED:
        if set(maps[name].dims) != {"omega_bar", "u_bar"} or not np.isfinite(maps[name].values).any():
            raise InputError(f"maps, {name}", got="no map with finite values over ω̄ and ū")
    kept = maps.where(maps["measured"].astype(bool)) if "measured" in maps else maps
    return kept[list(NEEDED)].transpose("omega_bar", "u_bar").load()


def facts_of(maps: xr.Dataset) -> FactsOfMap:
    """Read from a map what was measured too.

    Parameters
    ----------
    maps : xarray.Dataset
        From `half_filled`.
    """
    work = maps["w_bar"]
    largest = MeasuredWork(*maximum_of(work))
    region = region_near_largest(work, SHARE_OF_LARGEST)
    return FactsOfMap(
        largest,
        float(work.interp(omega_bar=BEAM.omega_bar, u_bar=BEAM.u_bar)),
        (region.lowest_u_bar, region.highest_u_bar),
        float(np.nanmax(maps["beta"].values)),
        mean_along_acceleration(maps["beta"], WEAKEST_G),
    )
