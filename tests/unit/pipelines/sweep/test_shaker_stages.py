"""What the shaker pipeline adds to its stages: flags of the recorder, and the bias of a delayed force."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pipelines.sweep.shaker import w_bar_bias_of_delay
from pipelines.sweep.stages import not_measured
from sloshlab.conditioning.calibration import DryMass
from sloshlab.conditioning.quality import quality_of
from sloshlab.rig import Liquid, Rig, Tank
from sloshlab.sweep.cycles import evaluate_cycles

RIG = Rig(
    tank=Tank(height_m=0.0272, length_m=0.1172, width_m=0.078, dry_mass_kg=0.61),
    liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5),
)


@pytest.mark.parametrize("delay_s", [2e-4, -3e-4])
def test_a_delayed_force_feigns_the_work_that_the_flag_states(delay_s):
    """Force of a pure mass, later by τ, at 20 Hz: the loop itself is evaluated, not the formula."""
    rate_hz, frequency_hz = 10_000.0, 20.0
    omega, mass = 2 * np.pi * frequency_hz, 0.61 + RIG.liquid_mass_kg
    time_s = np.arange(10_000) / rate_hz
    cycles = evaluate_cycles(
        mass * 30.0 * np.cos(omega * (time_s - delay_s)), 30.0 * np.cos(omega * time_s),
        np.arange(1, 19) / frequency_hz, sampling_rate_hz=rate_hz,
    )  # fmt: skip
    w_bar = cycles.work_j.mean() / (RIG.liquid_mass_kg * (30.0 / omega) ** 2)
    dry = DryMass(0.61, 0.0, 0.61, delay_s, 0.0, 1.0, np.nan, ("empty",))
    # sin Ωτ against Ωτ: 2e-4 at the larger delay
    assert w_bar_bias_of_delay(dry, RIG) == pytest.approx(w_bar, rel=5e-4)


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
