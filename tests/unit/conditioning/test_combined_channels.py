import numpy as np
import pytest
import xarray as xr

from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    force_channels,
    mean_acceleration,
    total_force,
    weights_by_noise,
)
from sloshlab.errors import AnalysisError


def recording(**values):
    variables = {
        name: ("time", np.array(row), {"quantity": name.partition("_")[0]}) for name, row in values.items()
    }
    return xr.Dataset(variables, coords={"time": np.arange(3) / 100})


def test_cells_add_up_and_roof_accelerometers_average():
    run = recording(
        force_cell_1=np.array([1, 2, 3], np.float32),
        force_cell_2=[10.0, np.nan, 30.0],
        force_other=[9.0, 9.0, 9.0],
        acceleration_roof_1=[1.0, 2.0, np.nan],
        acceleration_roof_2=[3.0, 6.0, 0.0],
        acceleration_control=[99.0, 99.0, 99.0],
    )
    force, acceleration = total_force(run), mean_acceleration(run)
    assert force.values == pytest.approx([11, np.nan, 33], nan_ok=True)
    assert acceleration.values == pytest.approx([2, 4, np.nan], nan_ok=True)
    assert force.dtype == acceleration.dtype == np.float64
    assert (force.attrs["units"], force.attrs["quantity"]) == ("N", "force")
    assert (acceleration.attrs["units"], acceleration.attrs["quantity"]) == ("m s-2", "acceleration")
    assert run["force_cell_1"].values.tolist() == [1, 2, 3]
    assert run["force_cell_1"].attrs == {"quantity": "force"}
    assert np.array_equal(force["time"], run["time"])


def test_weights_by_noise_give_the_mean_the_least_variance():
    """1/σ²: a sensor of twice the noise counts a quarter of the other one."""
    run = recording(acceleration_roof_1=[1.0, 2.0, 5.0], acceleration_roof_2=[6.0, 7.0, 0.0])
    run["acceleration_roof_1"].attrs["noise_std"], run["acceleration_roof_2"].attrs["noise_std"] = 0.2, 0.1
    names = ["acceleration_roof_1", "acceleration_roof_2"]
    assert weights_by_noise(run, names) == pytest.approx([0.2, 0.8])
    weighted = mean_acceleration(run, names, weights_by_noise(run, names))
    assert weighted.values == pytest.approx([5.0, 6.0, 1.0])
    for unknown in (0.0, np.nan, np.inf):
        run["acceleration_roof_2"].attrs["noise_std"] = unknown
        assert weights_by_noise(run, names) == [0.5, 0.5]
    del run["acceleration_roof_1"].attrs["noise_std"]
    assert weights_by_noise(run, ["acceleration_roof_1"]) == [1.0]


def test_single_channels_are_copied_not_shared():
    run = recording(force_interface=[1.0, 2.0, 3.0], acceleration_tip=[1.0, 2.0, 3.0])
    total_force(run)[:] = 0.0
    mean_acceleration(run)[:] = 0.0
    assert run["force_interface"].values.tolist() == run["acceleration_tip"].values.tolist() == [1, 2, 3]


def test_a_force_of_the_tank_enters_with_a_minus():
    run = recording(force_cell_1=[1.0, 2.0, 3.0], force_cell_2=[10.0, 20.0, 30.0])
    run["force_cell_2"].attrs.update(block_from="tank", block_to="shaker")
    assert total_force(run).values.tolist() == [-9, -18, -27]
    assert total_force(run, ["force_cell_2"]).values.tolist() == [-10, -20, -30]


def test_which_channels_are_taken():
    assert force_channels(recording(force_interface=[0.0] * 3)) == ["force_interface"]
    assert acceleration_channels(recording(acceleration_control=[0.0] * 3)) == ["acceleration_control"]
    tip_and_root = recording(acceleration_tip=[0.0] * 3, acceleration_root=[0.0] * 3)
    assert acceleration_channels(tip_and_root) == ["acceleration_tip"]
    assert acceleration_channels(recording(acceleration_point_2=[0.0] * 3)) == ["acceleration_point_2"]


def test_missing_channels_are_named():
    run = recording(force_a=[0.0] * 3, acceleration_a=[0.0] * 3, acceleration_b=[0.0] * 3)
    with pytest.raises(
        AnalysisError, match=r"force on the tank: got force channels force_a; allowed: force_cell_1"
    ):
        total_force(run)
    with pytest.raises(AnalysisError, match="acceleration_a, acceleration_b"):
        mean_acceleration(run)
    with pytest.raises(AnalysisError, match="channel force_b: got not in the recording; allowed: acceleration_a"):
        total_force(run, ["force_b"])
    with pytest.raises(AnalysisError, match="channel force_a: got quantity 'force'; allowed: 'acceleration'"):
        mean_acceleration(run, ["force_a"])
    with pytest.raises(AnalysisError, match="got an empty list"):
        total_force(run, [])
