"""Signals of the liquid on a motion in closed form; scaling to other tanks against the equations."""

import math

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.liquid_signals import liquid_signals
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.scaling_error import scaling_error
from sloshlab.reduced_order_model.tank_scaling import HYPOTHESES, TankScaling, scaled_to
from sloshlab.rig import Rig

RATE_HZ, OMEGA, DAMPING = 512.0, 2 * math.pi * 10, 3.0
TEXT = """
[tank]
height_m = {height}
length_m = {length}
width_m = {width}
dry_mass_kg = 0.6
[liquid]
density_kg_per_m3 = {density}
kinematic_viscosity_m2_per_s = {viscosity}
surface_tension_n_per_m = {tension}
fill_level = {fill}
"""
WATER = {
    "height": 0.0272, "length": 0.1172, "width": 0.078, "density": 1000.0, "viscosity": 1e-6, "tension": 0.0728,
    "fill": 0.5,
}  # fmt: skip


def rig(**changes) -> Rig:
    return Rig.from_toml_text(TEXT.format(**{**WATER, **changes}))


@pytest.fixture
def recording() -> xr.Dataset:
    """ü = 20 cos Ωt; the liquid takes Δf = −c u̇, so F_ext = (M + m_l) ü + c u̇; weights are on top."""
    time = np.arange(4096) / RATE_HZ
    acceleration = 20 * np.cos(OMEGA * time)
    velocity = 20 / OMEGA * np.sin(OMEGA * time)
    force = (0.6 + rig().liquid_mass_kg) * acceleration + DAMPING * velocity
    run = xr.Dataset(
        {
            "force_cell_1": ("time", 0.25 * force + 3.0, {"quantity": "force", "units": "N"}),
            "force_cell_2": ("time", 0.75 * force + 5.0, {"quantity": "force", "units": "N"}),
            "acceleration_roof_1": ("time", acceleration + 0.1, {"quantity": "acceleration", "units": "m s-2"}),
        },
        {"time": time},
        {"run_id": "closed form", "sampling_rate_hz": RATE_HZ},
    )
    return run


def test_velocity_and_force_of_a_viscous_liquid(recording):
    signals = liquid_signals(recording, rig())
    time, inner = recording.time.values, slice(1024, -1024)
    velocity = 20 / OMEGA * np.sin(OMEGA * time)
    assert signals.velocity_m_per_s[inner] == pytest.approx(velocity[inner], abs=1e-3 * 20 / OMEGA)
    largest = DAMPING * 20 / OMEGA
    assert signals.dynamic_force_n[inner] == pytest.approx(-DAMPING * velocity[inner], abs=2e-2 * largest)
    assert signals.sampling_rate_hz == pytest.approx(RATE_HZ)


def test_a_lower_rate_has_the_same_phase(recording):
    signals = liquid_signals(recording, rig()).at_rate(192.0)
    time = np.arange(signals.velocity_m_per_s.size) / 192.0
    inner = slice(400, -400)
    assert signals.velocity_m_per_s[inner] == pytest.approx(
        20 / OMEGA * np.sin(OMEGA * time[inner]), abs=1e-3 * 20 / OMEGA
    )
    with pytest.raises(AnalysisError, match="sampling rate"):
        liquid_signals(recording, rig()).at_rate(1000.0)


def test_scaling_is_that_of_the_equations():
    """A tank four times as high: times and velocities double; forces grow with the liquid's mass."""
    other = rig(height=4 * 0.0272, length=0.2, width=0.1, density=800.0, viscosity=2e-6, tension=0.0364)
    factors = TankScaling.between(rig(), other)
    assert (factors.time, factors.velocity) == pytest.approx((2, 2))
    assert factors.force == pytest.approx(800 / 1000 * 4 * 0.2 * 0.1 / (0.1172 * 0.078))
    assert factors.reynolds == pytest.approx(2 * 4 / 2)
    assert factors.bond == pytest.approx(0.8 * 16 / 0.5)
    with pytest.raises(InputError, match="fill level"):
        TankScaling.between(rig(), rig(fill=0.75))


def test_a_scaled_model_dissipates_the_same_share():
    """W̄ of the scaled model at similar conditions is that of the model; no sample is interpolated."""
    network = NormalisedRadialBasis(3, 4)
    rng = np.random.default_rng(3)
    model = ReducedOrderModel(
        network, rng.normal(size=network.n_parameters), Delays.tapped(3), Scaling(0, 0.5, 0, 2), 200
    )
    other = rig(height=4 * 0.0272, length=0.2, width=0.1)
    scaled = scaled_to(model, TankScaling.between(rig(), other))
    assert scaled.sampling_rate_hz == pytest.approx(100)
    found = []
    for tank_model, tank in ((model, rig()), (scaled, other)):
        time = np.arange(2000) / tank_model.sampling_rate_hz
        omega = 4.0 * tank.frequency_scale_rad_per_s
        speed = 0.6 * tank.velocity_scale_m_per_s
        velocity = speed * np.sin(omega * time)
        force = tank_model.simulate(velocity)
        known = np.isfinite(force)
        power = -np.mean(force[known] * velocity[known])
        found.append(power * 2 * math.pi / omega / (tank.liquid_mass_kg * speed**2))
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert scaled.facts["scaled"]["hypotheses"] == list(HYPOTHESES)
    # Re × 8 and Bo × 16: of one liquid, four times as high
    assert scaled.facts["scaled"]["error"] == vars(scaling_error(8.0, 16.0))
