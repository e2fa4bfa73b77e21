"""Liquid, gas and structure move each other in the same instant, and a stopped run goes on."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank import coupled_checkpoint
from acquisition.numerical_tank.carried_tank import FrozenTank
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.structures import Mode, Structure
from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_tank.coupling import CoupledTwoPhaseTank
from acquisition.two_phase_tank.method import CARRIED_LIQUID_AND_GAS
from acquisition.two_phase_tank.setup import GridNumerics, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from sloshlab.errors import InputError

FINE = GridNumerics(longest_step_s=4e-4)
SETUP = filled_two_phase_tank(Box(0.06, 0.03, 0.05), 0.5, 8, seed=2, numerics=FINE)
FLUID_KG = SETUP.fluid_mass_kg
BEAM = Structure(
    (
        Mode.of_frequency(10.87, 0.0032, 0.8956, 1.0, 1.21),
        Mode.of_frequency(78.31, 0.0090, 1.0692, 1.0, -1.05),
    ),
    included_mass_kg=FLUID_KG,
    coulomb_force_n=0.05,
)
LIGHT = Structure(
    (Mode.of_frequency(10.0, 0.0, 1.25 * FLUID_KG, 1.0, 1.25 * FLUID_KG),), included_mass_kg=FLUID_KG
)
"""A quarter of the fluids' mass: taking turns would blow up."""


def vertical_momentum_kg_m_per_s(tank: TwoPhaseTank) -> float:
    """In the frame of the tank, from fractions and velocities."""
    c, w, (dx, dz), fluids = tank.liquid_fraction, tank.velocities()[1], tank.setup.cell_m, tank.setup.fluids
    density = fluids.gas_density_kg_per_m3 * (1 - c) + fluids.density_kg_per_m3 * c
    return float((density * 0.5 * (w[:, 1:] + w[:, :-1])).sum()) * dx * dz * tank.setup.box.depth_m


def released(structure: Structure, displacement_m: float) -> CoupledTwoPhaseTank:
    tank = CoupledTwoPhaseTank(SETUP, structure)
    tank.deflect(displacement_m)
    return tank


def test_momentum_of_tank_and_fluids_together() -> None:
    """Nothing but the spring acts on both: Δ(M v + m v + P) = −∫ k q dt, four times as heavy as the tank."""
    tank = released(LIGHT, 0.02)
    history = tank.advance(np.zeros(400))
    dry_kg, k = 0.25 * FLUID_KG, LIGHT.modes[0].stiffness_n_per_m
    v, momentum = tank.tank_velocity_m_per_s, vertical_momentum_kg_m_per_s(tank.tank)
    impulse = -k * float(history.modal_displacement_m.sum()) * SETUP.step_s
    # the tank that the fluids feel may lag by what the last trials left
    lag = float(tank.structure_arrays()["structure_carried"][-1])
    assert abs(momentum) > 1e-2 * FLUID_KG
    assert abs(lag) < 1e-4
    assert (dry_kg + FLUID_KG) * v - FLUID_KG * lag + momentum == pytest.approx(impulse, rel=1e-9)


def test_energy_that_fluids_give_the_structure_takes() -> None:
    """As for particles, Δ(v P + ½ m v²) = −∫ f v dt − W, but for the parts of a step: P is not straight in it."""
    tank = released(BEAM, -0.0146)
    tank.advance(np.zeros(1200))
    v, momentum = tank.tank_velocity_m_per_s, vertical_momentum_kg_m_per_s(tank.tank)
    inertial_work_j = tank.tank.account().tank_work_j_per_m * SETUP.box.depth_m
    account = tank.account()
    left = v * momentum + 0.5 * FLUID_KG * v**2
    assert inertial_work_j > 0.01
    assert left == pytest.approx(-account.handed_over_j - inertial_work_j, abs=0.02 * inertial_work_j)
    assert account.handed_over_j == pytest.approx(account.liquid_work_j, rel=1e-5)
    assert abs(account.residual_share) < 1e-11
    assert min(account.viscosity_j, account.friction_j) > 0


def test_fluids_moved_as_the_structure_moved_push_as_they_did() -> None:
    """The tank alone, given the acceleration that came out, has the force that moved the structure."""
    tank = released(BEAM, -0.0146)
    history = tank.advance(np.zeros(150))
    alone = TwoPhaseTank(SETUP).advance(history.tank_acceleration_m_per_s2)
    force = alone.vertical_n + SETUP.gravity_m_per_s2 * FLUID_KG
    scale = np.abs(history.liquid_force_n).max()
    assert scale > 3 * FLUID_KG * SETUP.gravity_m_per_s2
    assert history.liquid_force_n == pytest.approx(force, abs=1e-3 * scale)


def test_gentle_motion_moves_the_fluids_like_frozen_ones() -> None:
    """Below g the liquid stays where it is: 10 Hz with the mass of the fluids, 22 Hz without."""
    u = released(LIGHT, 0.0005).advance(np.zeros(1200)).tank_displacement_m
    crossings = np.flatnonzero((u[:-1] < 0) & (u[1:] >= 0))
    between = crossings + u[crossings] / (u[crossings] - u[crossings + 1])
    frequency_hz = (between.size - 1) / ((between[-1] - between[0]) * SETUP.step_s)
    assert between.size >= 4
    assert frequency_hz == pytest.approx(10.0, rel=0.002)
    assert frequency_hz < 0.5 * LIGHT.natural_frequencies_hz()[0]


def test_sloshing_damps_more_than_frozen() -> None:
    late = []
    for tank in (CoupledTwoPhaseTank(SETUP, BEAM), FrozenTank(FLUID_KG, BEAM, SETUP.step_s)):
        tank.deflect(-0.0146)
        u = tank.advance(np.zeros(1500)).tank_displacement_m
        assert u[0] == pytest.approx(-0.0146, rel=1e-2)
        late.append(np.abs(u[-250:]).max())
    assert late[0] < 0.95 * late[1]


@pytest.mark.parametrize("stop", [1, 83])
def test_restart_reaches_the_same_bytes(tmp_path: Path, stop: int) -> None:
    base = 90 * np.sin(0.1 * np.arange(160))
    through, first = released(BEAM, 0.01), released(BEAM, 0.01)
    whole = through.advance(base)
    first.advance(base[:stop])
    method = CARRIED_LIQUID_AND_GAS
    coupled_checkpoint.save(first, tmp_path / "saved", {"heard": np.arange(3)}, method)
    again, beside = coupled_checkpoint.load(tmp_path / "saved", method)
    rest = again.advance(base[stop:])
    assert beside["heard"].tolist() == [0, 1, 2]
    assert again.structure == BEAM
    assert rest.liquid_force_n.tobytes() == whole.liquid_force_n[stop:].tobytes()
    assert rest.modal_acceleration_m_per_s2.tobytes() == whole.modal_acceleration_m_per_s2[stop:].tobytes()
    assert again.account() == through.account()
    with pytest.raises(InputError, match="another file"):
        coupled_checkpoint.load(tmp_path / "saved")


def test_instability_keeps_what_is_valid() -> None:
    tank, base = CoupledTwoPhaseTank(SETUP, LIGHT), np.zeros(40)
    base[20:] = 1e12
    with pytest.raises(InstabilityError, match="a fluid moves so fast") as caught:
        tank.advance(base)
    history = caught.value.valid
    assert 20 <= history.liquid_force_n.size < 40
    assert history.modal_displacement_m.shape == (history.time_s.size, 1)
    assert np.isfinite(history.tank_acceleration_m_per_s2).all()
