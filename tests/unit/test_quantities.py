"""The table of quantities is what results carry."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from sloshlab.quantities import QUANTITIES, described


def test_stale_attributes_are_replaced():
    dataset = xr.Dataset({"work_j": ("window", [1.0], {"units": "N", "note": "from a product"})})
    result = described(dataset)
    assert result.work_j.attrs == {"long_name": QUANTITIES["work_j"].long_name, "units": "J"}
    assert dataset.work_j.attrs["units"] == "N"


def test_standard_errors_take_the_units_of_their_quantity():
    result = described(xr.Dataset({"work_j_std": ("x", [1.0]), "gamma_kg_per_s_std": ("x", [1.0])}))
    assert result.work_j_std.attrs["units"] == "J"
    assert result.gamma_kg_per_s_std.attrs["units"] == "kg s-1"


def test_text_has_no_units():
    assert "units" not in described(xr.Dataset({"run": ("window", np.array(["a"], dtype=object))})).run.attrs


def test_what_is_not_in_the_table_is_refused():
    with pytest.raises(KeyError):
        described(xr.Dataset({"novelty": ("x", [1.0])}))


def test_axis_labels():
    assert QUANTITIES["work_j"].label == "W [J]"
    assert QUANTITIES["w_bar"].label == "W̄"
    assert QUANTITIES["gamma_kg_per_s"].label == "γ [kg/s]"
