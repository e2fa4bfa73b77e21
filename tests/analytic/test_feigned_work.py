"""What a delay and sensor noise do to a force, against the evaluated loop and against drawn noise."""

import numpy as np
import pytest
import xarray as xr

from sloshlab.conditioning.calibration import DryMass, w_bar_bias_of_delay
from sloshlab.conditioning.combined_channels import dynamic_force_noise_power
from sloshlab.rig import Liquid, Rig, Tank
from sloshlab.sweep.cycles import evaluate_cycles

RIG = Rig(
    tank=Tank(height_m=0.0272, length_m=0.1172, width_m=0.078, dry_mass_kg=0.61),
    liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5),
)


@pytest.mark.parametrize("frequency_hz", [8.0, 20.0])
@pytest.mark.parametrize("delay_s", [2e-4, -3e-4])
def test_a_delayed_force_feigns_the_stated_work(delay_s, frequency_hz):
    """Force of a pure mass, later by τ: the loop itself is evaluated, not the formula."""
    rate_hz = 10_000.0
    omega, mass = 2 * np.pi * frequency_hz, 0.61 + RIG.liquid_mass_kg
    time_s = np.arange(30_000) / rate_hz
    cycles = evaluate_cycles(
        mass * 30.0 * np.cos(omega * (time_s - delay_s)), 30.0 * np.cos(omega * time_s),
        np.arange(1, 19) / frequency_hz, sampling_rate_hz=rate_hz,
    )  # fmt: skip
    w_bar = cycles.work_j.mean() / (RIG.liquid_mass_kg * (30.0 / omega) ** 2)
    dry = DryMass(0.61, 0.0, 0.61, delay_s, 0.0, 1.0, np.nan, ("empty",))
    # sin Ωτ against Ωτ: 2e-4 at the larger delay
    assert w_bar_bias_of_delay(dry, RIG, frequency_hz=frequency_hz) == pytest.approx(w_bar, rel=5e-4)


def test_noise_power_is_the_mean_square_of_drawn_noise():
    """Two force cells and three accelerometers of different noise, m ü − F formed sample by sample."""
    stds = {"force_cell_1": 0.3, "force_cell_2": 0.5, "roof_1": 0.2, "roof_2": 0.1, "roof_3": 0.4}
    rng = np.random.default_rng(3)
    noise = {name: std * rng.standard_normal(200_000) for name, std in stds.items()}
    recording = xr.Dataset({name: ("time", noise[name], {"noise_std": std}) for name, std in stds.items()})
    forces, roofs = list(stds)[:2], list(stds)[2:]
    dynamic = 0.75 * sum(noise[name] for name in roofs) / 3 - sum(noise[name] for name in forces)
    expected = float(np.mean(dynamic**2))
    # standard error of a mean square of 200 000 values: sqrt(2/n) = 0.3 %
    assert dynamic_force_noise_power(recording, forces, roofs, 0.75) == pytest.approx(expected, rel=0.012)
    for name in stds:
        del recording[name].attrs["noise_std"]
    assert dynamic_force_noise_power(recording, forces, roofs, 0.75) == 0.0
