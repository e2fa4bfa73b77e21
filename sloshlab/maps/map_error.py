"""How far a predicted map is from the measured one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr


@dataclass(frozen=True)
class MapError:
    """Predicted − measured over a map.

    Attributes
    ----------
    largest : float
        Largest absolute value of the measured map.
    rms, mean : float
        Of the difference over the measured region.
    rms_of_windows : float
        Of the difference over the windows, without interpolation.
    """

    largest: float
    rms: float
    mean: float
    rms_of_windows: float

    @property
    def relative_rms(self) -> float:
        """RMS over the largest value."""
        return self.rms / self.largest if self.largest > 0 else float("nan")

    @classmethod
    def between(
        cls, measured: xr.DataArray, predicted: xr.DataArray, windows: tuple[xr.DataArray, xr.DataArray]
    ) -> MapError:
        """Error of a predicted map.

        Parameters
        ----------
        measured, predicted : xarray.DataArray
            On one grid; NaN outside the measured region.
        windows : tuple of xarray.DataArray
            The values that the two maps were made of, window by window.
        """
        difference = (predicted - measured).values
        # without the interpolation, whose own error is in both maps
        by_window = windows[1].values - windows[0].values
        return cls(
            largest=float(np.nanmax(np.abs(measured.values))),
            rms=float(np.sqrt(np.nanmean(difference**2))),
            mean=float(np.nanmean(difference)),
            rms_of_windows=float(np.sqrt(np.nanmean(by_window**2))),
        )
