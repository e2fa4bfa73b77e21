"""Readings of maps whose values are closed forms of ω̄ and ū."""

import math

import numpy as np
import pytest
import xarray as xr

from sloshlab.maps.map_readings import mean_along_acceleration, region_near_largest

OMEGA_BAR, U_BAR = np.linspace(2.0, 5.0, 61), np.linspace(0.0, 0.5, 101)


def over_plane(function) -> xr.DataArray:
    omega_bar, u_bar = np.meshgrid(OMEGA_BAR, U_BAR, indexing="ij")
    return xr.DataArray(
        function(omega_bar, u_bar),
        coords={"omega_bar": OMEGA_BAR, "u_bar": U_BAR},
        dims=("omega_bar", "u_bar"),
    )


def test_region_above_85_percent_of_a_parabola():
    """1 − ((ū − 0.25)/0.2)² ≥ 0.85 within 0.2 √0.15 of 0.25, at every ω̄, whatever the largest value is."""
    parabola = over_plane(lambda omega_bar, u_bar: 3 - 3 * ((u_bar - 0.25) / 0.2) ** 2)
    region = region_near_largest(parabola, 0.85)
    half = 0.2 * math.sqrt(0.15)
    cell = U_BAR[1]
    assert region.lowest_u_bar == pytest.approx(0.25 - half, abs=cell)
    assert region.highest_u_bar == pytest.approx(0.25 + half, abs=cell)
    assert region.mean_u_bar == pytest.approx(0.25)
    assert region.share == pytest.approx(2 * half / 0.5, abs=2 * cell / 0.5)


def test_what_was_not_measured_is_in_no_region():
    values = over_plane(lambda omega_bar, u_bar: np.where(u_bar < 0.1, np.nan, 1.0))
    region = region_near_largest(values.transpose("u_bar", "omega_bar"), 0.85)
    assert region.lowest_u_bar == pytest.approx(0.1)
    assert region.share == 1.0


def test_mean_along_an_acceleration_of_values_that_depend_on_it_alone():
    """Values ū ω̄² = a₀/g: each is read at most a cell beyond the line, half a cell on the mean."""
    values = over_plane(lambda omega_bar, u_bar: u_bar * omega_bar**2)
    within = 2.0 + U_BAR[1] * (OMEGA_BAR**2).mean()
    assert 2.0 <= mean_along_acceleration(values, 2.0) <= within
    assert mean_along_acceleration(values, 2.0) == pytest.approx(
        2.0 + 0.5 * U_BAR[1] * (OMEGA_BAR**2).mean(), abs=0.3 * U_BAR[1] * (OMEGA_BAR**2).mean()
    )
    assert math.isnan(mean_along_acceleration(values, 13.0))


@pytest.mark.parametrize(("cells_below", "is_read"), [(0.5, True), (1.5, True), (2.5, False)])
def test_a_line_more_than_two_cells_below_what_was_measured_is_not_read(cells_below, is_read):
    values = over_plane(lambda omega_bar, u_bar: np.where(u_bar < 0.4, np.nan, 7.0)).isel(omega_bar=[0])
    found = mean_along_acceleration(values, (0.4 - cells_below * U_BAR[1]) * OMEGA_BAR[0] ** 2)
    assert (found == 7.0) if is_read else math.isnan(found)
