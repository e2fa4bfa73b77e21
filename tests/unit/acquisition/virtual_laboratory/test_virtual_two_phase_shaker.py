"""The shaker whose liquid is computed with its gas: what it records, and that a stopped computation goes on."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank.computed_force import ComputationInterruptedError, computed_force
from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_tank.method import LIQUID_AND_GAS
from acquisition.two_phase_tank.setup import Fluids, filled_two_phase_tank
from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid, two_phase_setup
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run
from sloshlab.rig import Rig

TEXT = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.078
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
surface_tension_n_per_m = 0.05
"""
RIG = Rig.from_toml_text(TEXT)


def test_what_the_rig_tells_is_computed_and_the_rest_is_water_and_air() -> None:
    setup = two_phase_setup(RIG, cells_per_height=8, seed=4, sampling_rate_hz=512.0)
    assert setup.fluids == Fluids(density_kg_per_m3=1000.0, surface_tension_n_per_m=0.05)
    assert (setup.seed, setup.cells_per_height, setup.box.depth_m) == (4, 8, 0.078)
    assert setup.liquid_mass_kg == pytest.approx(1000.0 * 0.1172 * 0.0136 * 0.078)


def test_a_weak_start_moves_the_liquid_as_a_whole() -> None:
    """At 0.1 g nothing sloshes within a few cycles: F_ext = (M_dry + m_l + m_gas) ü, from masses alone."""
    run = virtual_shaker_run(
        RIG,
        experiment="sudden_start",
        acceleration_g=0.1,
        start_hz=11.4,
        duration_s=5.0,
        imperfect=False,
        numerical=NumericalLiquid(8, with_gas=True),
    )
    assert run.attrs["liquid"] == "two_phase_tank"
    assert run.attrs["cells_per_height"] == 8
    force = sum(run[name].to_numpy() for name in run.data_vars if str(name).startswith("force_cell"))
    acceleration = run["acceleration_control"].to_numpy()
    used = slice(200, 1200)
    slope = float(np.vdot(acceleration[used], force[used]) / np.vdot(acceleration[used], acceleration[used]))
    volume = 0.1172 * 0.0136 * 0.078
    assert slope == pytest.approx(0.61 + (1000.0 + 1.204) * volume, rel=0.01)


def test_stopped_and_started_again_it_ends_with_the_same_bytes(tmp_path: Path) -> None:
    setup = filled_two_phase_tank(Box(0.06, 0.03, 0.05), 0.5, 8, sampling_rate_hz=200.0)

    def motion(time_s: np.ndarray) -> np.ndarray:
        return np.asarray(30 * np.sin(70 * time_s))

    through = computed_force(setup, motion, 0.5, method=LIQUID_AND_GAS)

    def stop(share: float) -> None:
        if share > 0.4:
            raise KeyboardInterrupt

    path = tmp_path / "kept"
    with pytest.raises(ComputationInterruptedError):
        computed_force(setup, motion, 0.5, method=LIQUID_AND_GAS, checkpoint=path, progress=stop)
    again = computed_force(setup, motion, 0.5, method=LIQUID_AND_GAS, checkpoint=path)
    assert again.vertical_n.tobytes() == through.vertical_n.tobytes()
    assert np.abs(through.vertical_n).max() > 20 * setup.liquid_mass_kg
