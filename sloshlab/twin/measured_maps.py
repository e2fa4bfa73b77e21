"""Tank models from the measured maps W̄(ω̄, ū) and β(ω̄, ū): dampers of Appendix E, fixed or following the motion.

In a rig file::

    [twin]
    tank_model = "viscous"
    parameters = { maps = "maps.nc", metric = "c_1" }     # or c_2, c_3, c_rand, map

c₁, c₂, c₃ and c_rand are constants (E.5, E.6); ``map`` lets c follow the frequency and amplitude of the motion
(E.4), and with ``effective_mass = true`` the mass as well. The first mode of the structure is the application's
frequency unless ``frequency_hz`` says another; c_rand needs ``u_bar``, the mean amplitude over h.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.ndimage import distance_transform_edt

from sloshlab import interrupt, viscous_equivalent
from sloshlab.errors import InputError
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.physical_ranges import AMPLITUDE_OVER_HEIGHT, FREQUENCY_HZ, PhysicalRange
from sloshlab.rig import Rig
from sloshlab.twin.structure import structure_of_rig
from sloshlab.twin.structure_forces import VISCOUS_DAMPING
from sloshlab.twin.tank_forces import EFFECTIVE_MASS_MAP, VISCOUS_MAP, table_of
from sloshlab.twin.terms import Term

FloatArray = npt.NDArray[np.float64]

METRICS: Final = ("c_1", "c_2", "c_3", "c_rand", "map")
_PARAMETERS: Final = ("maps", "metric", "frequency_hz", "u_bar", "effective_mass", "time_constant_s")
_LARGEST_FILE_BYTES = 200_000_000
_LARGEST_GRID = 4_000_000
_DEFAULT_FREQUENCY_HZ = 10.0


def terms_from_maps(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
    """Forces of the liquid for a [twin] table that names maps.

    Raises
    ------
    InputError
        If a parameter is unknown, missing or impossible, or the maps cannot be read.
    """
    unknown = sorted(set(parameters) - set(_PARAMETERS))
    if unknown:
        raise InputError("viscous", got=", ".join(unknown), allowed=", ".join(("damping_kg_per_s", *_PARAMETERS)))
    metric = parameters.get("metric", "map")
    if metric not in METRICS:
        raise InputError("viscous: metric", got=repr(metric)[:80], allowed=", ".join(METRICS))
    maps = read_maps(folder / str(parameters["maps"]), fill_level=rig.liquid.fill_level)
    frequency = _frequency_hz(rig, parameters)
    if metric != "map":
        damping = _damping_kg_per_s(rig, maps["w_bar"], str(metric), frequency, parameters)
        return (VISCOUS_DAMPING(place="tank", damping_n_s_per_m=damping),)
    following: dict[str, Any] = {"liquid_mass_kg": rig.liquid_mass_kg, "height_m": rig.tank.height_m}
    # a map needs a frequency before the motion has shown one
    following["start_frequency_hz"] = frequency
    if "time_constant_s" in parameters:
        following["time_constant_s"] = parameters["time_constant_s"]
    terms = [VISCOUS_MAP(**following, table=_table(maps["w_bar"]))]
    if parameters.get("effective_mass", False):
        terms.append(EFFECTIVE_MASS_MAP(**following, table=_table(maps["beta"])))
    return tuple(terms)


def _table(grid: xr.DataArray) -> FloatArray:
    return table_of(filled(grid), measured=grid.notnull())


def read_maps(path: Path, *, fill_level: float) -> xr.Dataset:
    """`w_bar` and `beta` of a `maps.nc`, of the nearest fill level where there are several.

    Raises
    ------
    InputError
        If it is not such a file.
    """
    what = f"maps {path}"
    try:
        if path.stat().st_size > _LARGEST_FILE_BYTES:
            raise InputError(what, got=f"{path.stat().st_size} bytes", allowed=f"≤ {_LARGEST_FILE_BYTES}")
        with NETCDF_LOCK, interrupt.held(), xr.open_dataset(path, engine="netcdf4", decode_times=False) as source:
            missing = [name for name in ("w_bar", "beta") if name not in source]
            if missing or max(source[name].size for name in ("w_bar", "beta")) > _LARGEST_GRID:
                raise InputError(what, got=f"without {', '.join(missing) or 'bounds'}", allowed="a maps.nc")
            # loaded under the lock: the library is not made for threads
            maps = source[["w_bar", "beta"]].load()
    except (OSError, ValueError, RuntimeError, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            what, got=f"a file that cannot be read ({error})"[:200], allowed="maps.nc of `sloshlab shaker`"
        ) from error
    return maps.sel(fill_level=fill_level, method="nearest") if "fill_level" in maps.dims else maps


def filled(grid: xr.DataArray) -> xr.DataArray:
    """The map with every gap filled by the nearest measured grid point: constant beyond the measured region.

    Raises
    ------
    InputError
        If nothing is measured.

    Examples
    --------
    >>> grid = xr.DataArray([[np.nan, 1.0, 2.0]], dims=("omega_bar", "u_bar"))
    >>> filled(grid).values.tolist()
    [[1.0, 1.0, 2.0]]
    """
    gaps = ~np.isfinite(grid.values)
    if gaps.all():
        raise InputError(f"map {grid.name}", got="no measured point", allowed="a measured region")
    # by grid points, not by physical distances: both axes count alike
    nearest = distance_transform_edt(gaps, return_distances=False, return_indices=True)
    return grid.copy(data=grid.values[tuple(nearest)])


def _frequency_hz(rig: Rig, parameters: Mapping[str, Any]) -> float:
    if parameters.get("frequency_hz") is not None:
        return _in_range(parameters, "frequency_hz", FREQUENCY_HZ)
    return _DEFAULT_FREQUENCY_HZ if rig.structure is None else float(structure_of_rig(rig).frequencies_hz[0])


def _damping_kg_per_s(
    rig: Rig, w_bar: xr.DataArray, metric: str, frequency_hz: float, parameters: Mapping[str, Any]
) -> float:
    tank = {"liquid_mass_kg": rig.liquid_mass_kg, "tank_height_m": rig.tank.height_m}
    omega_bar = 2 * np.pi * frequency_hz / rig.frequency_scale_rad_per_s
    if metric == "c_1":
        return viscous_equivalent.damping_mean_over_amplitude_kg_per_s(w_bar, omega_bar, **tank)
    if metric == "c_2":
        return viscous_equivalent.damping_at_maximum_kg_per_s(w_bar, **tank)
    if metric == "c_3":
        return viscous_equivalent.damping_of_maximum_kg_per_s(w_bar, omega_bar, **tank)
    u_bar = _in_range(parameters, "u_bar", AMPLITUDE_OVER_HEIGHT)
    return viscous_equivalent.damping_at_amplitude_kg_per_s(w_bar, omega_bar, u_bar, **tank)


def _in_range(parameters: Mapping[str, Any], name: str, possible: PhysicalRange) -> float:
    value = parameters.get(name)
    try:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(str(possible))
        return float(possible.checked(value))
    except ValueError as error:
        raise InputError(f"viscous: {name}", got=repr(value)[:80], allowed=str(error)) from error
