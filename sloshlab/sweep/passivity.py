"""A structure without a drive of its own takes energy from what moves it, and gives none."""

from __future__ import annotations

from typing import Final

import numpy as np
import xarray as xr

_SIGMA: Final = 5.0
"""Median of work over its standard error: single windows may be negative while a resonance gives energy back."""
_SHARE: Final = 0.9


def gives_energy(windows: xr.Dataset) -> bool:
    """Whether the work is negative throughout, which for a passive structure means a wrong sign of a channel.

    Parameters
    ----------
    windows : xarray.Dataset
        With `dissipated_mass_kg` and its standard error.
    """
    work = windows["dissipated_mass_kg"].values
    # a run without scatter has error zero, and the sign decides
    error = np.maximum(windows["dissipated_mass_kg_std"].values, np.finfo(float).tiny)
    return bool(work.size and np.median(work / error) < -_SIGMA and np.mean(work < 0) > _SHARE)
