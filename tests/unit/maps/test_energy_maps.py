"""Maps of windows whose W̄ and β are known functions."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import AnalysisError
from sloshlab.maps.energy_maps import energy_maps
from sloshlab.rig import Liquid, Rig, Tank

RIG = Rig(
    tank=Tank(height_m=0.0272, length_m=0.1172, width_m=0.078, dry_mass_kg=0.61),
    liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5),
)
LIQUID_KG = 500.0 * 0.0272 * 0.1172 * 0.078
SCALE = np.sqrt(9.81 / 0.0272)


def w_bar_law(omega_bar, a_over_g):
    return 1.2 * np.exp(-(np.log(omega_bar / 3.8) ** 2) / 0.3 - np.log(a_over_g / 3.5) ** 2 / 0.9)


def windows_of(levels=(0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0), n=40):
    frequency = np.tile(np.geomspace(5.0, 20.0, n), len(levels))
    level = np.repeat(levels, n)
    omega = 2 * np.pi * frequency
    u0 = level * 9.81 / omega**2
    w_bar = w_bar_law(omega / SCALE, level)
    columns = {
        "run": np.repeat([f"run {level}" for level in levels], n),
        "frequency_hz": frequency,
        "amplitude_m": u0,
        "acceleration_g": level,
        "work_j": w_bar * LIQUID_KG * (omega * u0) ** 2,
        "dissipated_mass_kg": w_bar * LIQUID_KG,
        "dissipated_mass_kg_std": 0.02 * LIQUID_KG * np.ones_like(w_bar),
        "beta": -0.1 - 0.05 * np.log(level),
        "beta_std": 0.01 * np.ones_like(w_bar),
    }
    return xr.Dataset({name: ("window", values) for name, values in columns.items()})


@pytest.fixture(scope="module")
def maps():
    return energy_maps(windows_of(), RIG)


def test_maps_over_both_planes_are_the_law(maps):
    data = maps.dataset
    for suffix, amplitude in (("", "u_bar"), ("_over_v_bar", "v_bar")):
        omega_bar, second = np.meshgrid(data.omega_bar, data[amplitude], indexing="ij")
        a_over_g = second * omega_bar ** (2 if suffix == "" else 1)
        for name, law in (("w_bar", w_bar_law(omega_bar, a_over_g)), ("beta", -0.1 - 0.05 * np.log(a_over_g))):
            values = data[name + suffix].values
            drawn = np.isfinite(values)
            assert drawn.mean() > 0.2
            error, scale = (values - law)[drawn], np.sqrt(np.mean(law[drawn] ** 2))
            assert np.sqrt(np.mean(error**2)) < 0.02 * scale
            assert np.abs(error).max() < 0.1 * scale


def test_work_map_is_the_same_map_in_joule(maps):
    data = maps.dataset
    frequency, u0 = np.meshgrid(data.frequency_hz, data.amplitude_m, indexing="ij")
    omega = 2 * np.pi * frequency
    law = w_bar_law(omega / SCALE, omega**2 * u0 / 9.81) * LIQUID_KG * (omega * u0) ** 2
    drawn = data.measured_work_j.values == 1
    np.testing.assert_array_equal(drawn, np.isfinite(data.work_j.values))
    assert np.abs(data.work_j.values - law)[drawn].max() < 0.03 * law[drawn].max()


def test_nothing_is_drawn_outside_the_iso_acceleration_lines_measured(maps):
    data = maps.dataset
    omega_bar, u_bar = np.meshgrid(data.omega_bar, data.u_bar, indexing="ij")
    level = u_bar * omega_bar**2
    outside = (level > 6.3) | (level < 0.47)
    for name in ("w_bar", "w_bar_std", "beta", "beta_std"):
        assert np.isnan(data[name].values[outside]).all()
    well_inside = (level > 0.7) & (level < 5.5) & (omega_bar > 1.7) & (omega_bar < 6.5)
    assert np.isfinite(data.w_bar.values[well_inside]).all()


def test_standard_errors_are_carried_through(maps):
    inside = maps.dataset.w_bar_std.values[np.isfinite(maps.dataset.w_bar_std.values)]
    # a mean of neighbours is better than one window, and between runs hardly worse
    assert 0.1 * 0.02 < np.median(inside) < 0.02
    assert inside.max() < 0.04


def test_cross_validated_errors_are_in_the_units_of_the_maps(maps):
    assert maps.validation["w_bar"].left_out_runs_rms == pytest.approx(
        maps.validation["work_j"].left_out_runs_rms / LIQUID_KG, rel=1e-12
    )
    assert 0 < maps.validation["w_bar"].left_out_windows_rms < 0.05


def test_without_a_tank_only_the_work_is_mapped():
    data = energy_maps(windows_of()).dataset
    assert "w_bar" not in data
    assert {"work_j", "work_j_std", "measured_work_j"} <= set(data.data_vars)


def test_too_few_windows_are_refused():
    with pytest.raises(AnalysisError, match="2 windows"):
        energy_maps(windows_of().isel(window=slice(0, 2)), RIG)
