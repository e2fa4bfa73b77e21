"""Balances that hold to rounding, the same bytes for a seed, and what happens when it goes wrong."""

import numpy as np
import pytest

from acquisition.numerical_tank.forced_motion import HarmonicMotion, averaged, moved
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, LiquidColumn, Numerics, TankSetup, filled_tank
from sloshlab.errors import InputError

G = 9.81
SETUP = filled_tank(Box(0.06, 0.03, 0.05), 0.5, 12, seed=2)


def shaken(setup: TankSetup = SETUP, duration_s: float = 0.25, acceleration_g: float = 4.0) -> NumericalTank:
    tank = NumericalTank(setup)
    times = tank.times_s(round(duration_s / setup.step_s))
    tank.advance(acceleration_g * G * np.cos(2 * np.pi * 12 * times))
    return tank


def test_force_on_the_walls_is_what_the_momentum_of_the_liquid_says() -> None:
    """m Δv̄ = ∫ (−F − m (g + ü)) dt with F summed over the walls; both sides of double precision."""
    tank = NumericalTank(SETUP)
    mass, step = SETUP.liquid_mass_kg, SETUP.step_s
    motion = np.stack([3 * np.sin(90 * tank.times_s(2500)), 40 * np.cos(75 * tank.times_s(2500))], axis=1)
    forces = tank.advance(motion)
    state = tank.state()
    for force, v, body in (
        (forces.vertical_n, state.vz_m_per_s, -G - motion[:, 1]),
        (forces.horizontal_n, state.vx_m_per_s, -motion[:, 0]),
    ):
        impulse = float((mass * body - force).sum() * step)
        assert mass * v.mean() == pytest.approx(impulse, abs=1e-9 * mass * np.abs(body).sum() * step)
    assert np.abs(forces.vertical_n).max() > 3 * mass * G


def test_energy_account_closes() -> None:
    account = shaken(duration_s=0.6).account()
    assert account.tank_work_j_per_m > 0.01
    assert min(account.viscosity_j_per_m, account.density_diffusion_j_per_m) > 0
    assert abs(account.residual_share) < 0.02
    halves = account - account
    assert halves.residual_j_per_m == 0.0


def test_without_losses_energy_stays() -> None:
    """No viscosity, no diffusion, no corrections: the scheme itself neither makes nor takes energy."""
    none = Numerics(artificial_viscosity=0.0, density_diffusion=0.0, packing_strength=0.0, shift_strength=0.0)
    tank = NumericalTank(
        filled_tank(Box(0.06, 0.03), 0.5, 12, numerics=none, liquid=Liquid(viscosity_m2_per_s=0.0))
    )
    tank.set_velocity(0.1 * np.sin(50 * tank.state().x_m), 0.0)
    before = 0.5 * tank.setup.particle_mass_kg_per_m * float((tank.state().vx_m_per_s ** 2).sum())
    tank.advance(np.zeros(400))
    account = tank.account()
    assert abs(account.lost_j_per_m) < 1e-15
    assert abs(account.gained_j_per_m) < 0.01 * before


def test_a_step_runs_backwards() -> None:
    """Without losses, reversing all velocities retraces the path."""
    none = Numerics(artificial_viscosity=0.0, density_diffusion=0.0, packing_strength=0.0, shift_strength=0.0)
    tank = NumericalTank(
        filled_tank(Box(0.06, 0.03), 0.5, 12, numerics=none, liquid=Liquid(viscosity_m2_per_s=0.0))
    )
    start = tank.state()
    motion = 20 * np.sin(0.05 * np.arange(150))
    tank.advance(motion)
    gone = np.abs(tank.state().z_m - start.z_m).max()
    middle = tank.state()
    tank.set_velocity(-middle.vx_m_per_s, -middle.vz_m_per_s)
    tank.advance(motion[::-1])
    assert gone > 1e-5
    assert np.abs(tank.state().z_m - start.z_m).max() < 1e-8 * gone / 1e-5


def test_same_seed_same_bytes_other_seed_other_liquid() -> None:
    first, same = shaken().state(), shaken().state()
    assert first.x_m.tobytes() == same.x_m.tobytes()
    assert first.pressure_pa.tobytes() == same.pressure_pa.tobytes()
    other = shaken(filled_tank(Box(0.06, 0.03, 0.05), 0.5, 12, seed=3)).state()
    assert not np.array_equal(first.x_m, other.x_m)


def test_single_steps_are_the_same_as_many() -> None:
    many, single = NumericalTank(SETUP), NumericalTank(SETUP)
    motion = 30 * np.cos(75 * many.times_s(60))
    forces = many.advance(motion)
    for k in range(60):
        vertical, horizontal = single.step(motion[k])
        assert vertical == forces.vertical_n[k]
        assert horizontal == forces.horizontal_n[k]
    assert single.state().x_m.tobytes() == many.state().x_m.tobytes()


@pytest.mark.slow  # everything is compiled once more
def test_single_precision_stays_close_for_a_while() -> None:
    setup = filled_tank(Box(0.06, 0.03, 0.05), 0.5, 12, seed=2, numerics=Numerics(precision="single"))
    single, double = NumericalTank(setup), NumericalTank(SETUP)
    weight = SETUP.liquid_mass_kg * G
    forces = [tank.advance(np.full(100, 5.0)).vertical_n / weight for tank in (single, double)]
    assert np.abs(forces[0] - forces[1]).max() < 0.01


def test_instability_says_where_and_keeps_what_is_valid() -> None:
    tank = NumericalTank(SETUP)
    motion = np.zeros(300)
    motion[200:] = 1e6
    with pytest.raises(
        InstabilityError, match=r"moves faster than sound at .* s, x = .* m, z = .* m; remedy"
    ) as caught:
        tank.advance(motion)
    valid = caught.value.valid
    assert valid is not None
    assert 200 <= valid.vertical_n.size < 300
    assert np.isfinite(valid.vertical_n).all()
    assert caught.value.time_s == pytest.approx(valid.vertical_n.size * SETUP.step_s)


@pytest.mark.parametrize(
    "bad", [np.array([0.0, np.nan]), np.array([np.inf]), np.zeros((4, 3)), np.zeros((2, 2, 2))]
)
def test_impossible_motion_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(InputError, match="acceleration"):
        NumericalTank(SETUP).advance(bad)


def test_any_column_may_be_let_go() -> None:
    tank = NumericalTank(TankSetup(Box(0.2, 0.1), LiquidColumn(0.04, 0.05), 0.005))
    tank.advance(np.zeros(300))
    assert tank.state().x_m.max() > 0.041


def test_moved_goes_on_from_where_the_tank_is() -> None:
    tank, motion = NumericalTank(SETUP), HarmonicMotion(5.0, 12.0, rise_s=0.01)
    blocks = list(moved(tank, motion, 0.02, block_s=0.006))
    times = np.concatenate([block.time_s for block in blocks])
    assert len(blocks) == 4
    assert np.allclose(np.diff(times), SETUP.step_s)
    whole = NumericalTank(SETUP).advance(motion(times)).vertical_n
    assert np.array_equal(np.concatenate([block.forces.vertical_n for block in blocks]), whole)
    assert averaged(whole, 7).size == whole.size // 7


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_moved_refuses_no_duration(duration_s: float) -> None:
    with pytest.raises(InputError, match="duration_s"):
        next(moved(NumericalTank(SETUP), HarmonicMotion(1.0, 1.0), duration_s))
