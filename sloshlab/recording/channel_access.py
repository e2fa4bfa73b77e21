"""Channels of a recording in memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.units import SI_UNITS


def channels(recording: xr.Dataset, quantity: str | None = None) -> list[str]:
    """Names of the channels of a recording, of one quantity if given, sorted.

    Examples
    --------
    >>> channels(xr.Dataset({"force_cell_1": ("time", [0.0], {"quantity": "force"})}))
    ['force_cell_1']
    """
    return sorted(
        str(name)
        for name, variable in recording.data_vars.items()
        if variable.dims == ("time",)
        and variable.attrs.get("quantity") in SI_UNITS
        and quantity in (None, variable.attrs["quantity"])
    )


def with_values(recording: xr.Dataset, channel: str, values: npt.ArrayLike) -> xr.Dataset:
    """The same recording with other values of a channel; nothing else is copied, and nothing compared.

    Parameters
    ----------
    recording : xarray.Dataset
    channel : str
        Which it has.
    values : array_like, shape (n_times,)
    """
    # `assign` compares all coordinates, which takes ten times as long as all that is needed here
    changed = recording.copy(deep=False)
    changed[channel].variable.data = np.asarray(values)
    return changed


def is_channel(name: str, dimensions: tuple[Any, ...], attributes: Mapping[str, Any]) -> bool:
    """Whether a variable is one: over time, with a quantity that its attributes or its name tell."""
    if tuple(dimensions) != ("time",) or name == "quality":
        return False
    return "quantity" in attributes or name.partition("_")[0] in SI_UNITS
