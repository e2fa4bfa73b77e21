"""What the shaker pipeline adds to its stages: flags of the recorder."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pipelines.sweep.stages import not_measured
from sloshlab.conditioning.quality import quality_of


def run_with(flags):
    n = flags.size
    force = ("time", np.sin(np.arange(n) * 0.1), {"units": "N", "quantity": "force"})
    attributes = {"run_id": "run", "sampling_rate_hz": 1000.0}
    return xr.Dataset(
        {"force_cell_1": force, "quality": ("time", flags)}, {"time": np.arange(n) / 1000.0}, attributes
    )


@pytest.mark.parametrize(("flag", "costs"), [(1, True), (2, True), (4, True), (8, False), (16, True)])
def test_flags_of_the_recorder_cost_the_sample(flag, costs):
    """Lost, clipped, repaired and stuck samples were not measured; one that came out of order was."""
    flags = np.zeros(3000, np.uint8)
    flags[1500] = flag
    run = run_with(flags)
    mask = not_measured(run, ["force_cell_1"], quality_of(run))
    assert np.flatnonzero(mask).tolist() == ([1500] if costs else [])
