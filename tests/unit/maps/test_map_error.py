"""Error of a predicted map against numbers that were put into it."""

import numpy as np
import pytest
import xarray as xr

from sloshlab.maps.map_error import MapError


def test_a_constant_offset_is_the_mean_and_the_rms():
    measured = xr.DataArray([[1.0, -2.0], [0.5, np.nan]], dims=("omega_bar", "u_bar"))
    works = xr.DataArray([1.0, 1.2], dims="window")
    found = MapError.between(measured, measured + 0.25, (works, works + xr.DataArray([0.3, -0.4], dims="window")))
    assert (found.largest, found.rms, found.mean) == (2.0, 0.25, 0.25)
    assert found.rms_of_windows == pytest.approx(np.sqrt(0.125))
    assert found.relative_rms == 0.125


def test_an_offset_of_both_signs_has_no_mean():
    measured = xr.DataArray([1.0, 1.0, 1.0, 1.0], dims="u_bar")
    predicted = xr.DataArray([1.5, 0.5, 1.5, 0.5], dims="u_bar")
    found = MapError.between(measured, predicted, (measured, measured))
    assert (found.mean, found.rms, found.rms_of_windows) == (0.0, 0.5, 0.0)
