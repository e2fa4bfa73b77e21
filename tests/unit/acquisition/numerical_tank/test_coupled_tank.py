"""Tank and structure move each other: what one gives the other takes, and a stopped run goes on."""

import math
from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank import checkpoint, coupled_checkpoint
from acquisition.numerical_tank.carried_tank import FrozenTank
from acquisition.numerical_tank.coupling import CoupledTank
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.structures import Mode, Structure
from acquisition.numerical_tank.tank import Box, filled_tank
from sloshlab.errors import InputError

SETUP = filled_tank(Box(0.06, 0.03, 0.05), 0.5, 12, seed=2)
LIQUID_KG = SETUP.liquid_mass_kg
BEAM = Structure(
    (
        Mode.of_frequency(10.87, 0.0032, 0.8956, 1.0, 1.21),
        Mode.of_frequency(78.31, 0.0090, 1.0692, 1.0, -1.05),
    ),
    included_mass_kg=LIQUID_KG,
    coulomb_force_n=0.05,
)
LIGHT = Structure((Mode.of_frequency(10.0, 0.0, 3 * LIQUID_KG, 1.0, 3 * LIQUID_KG),), included_mass_kg=LIQUID_KG)


def test_what_the_liquid_gives_the_structure_takes() -> None:
    """With v and P the velocity of the tank and the momentum of the liquid in it, and the base at rest,

        Δ(v P + ½ m v²) = −∫ f v dt − W

    where f is the force on the tank without the weight and W the work of inertia in the frame of the tank.
    Left and W are known to the liquid, f v to the structure; all three are of double precision.
    """
    tank = CoupledTank(SETUP, BEAM)
    tank.deflect(-0.0146)
    history = tank.advance(np.zeros(2500))
    v, momentum = tank.tank_velocity_m_per_s, tank.tank.vertical_momentum_kg_m_per_s()
    inertial_work_j = tank.tank.account().tank_work_j_per_m * SETUP.box.depth_m
    account = tank.account()
    left = v * momentum + 0.5 * LIQUID_KG * v**2
    assert inertial_work_j > 0.01
    assert left == pytest.approx(-account.handed_over_j - inertial_work_j, abs=1e-10 * inertial_work_j)
    # impulses at walls come one step later: half a step's change of velocity each
    assert account.handed_over_j == pytest.approx(account.liquid_work_j, rel=0.01)
    taken = float(history.liquid_force_n @ history.tank_velocity_m_per_s) * SETUP.step_s
    assert account.liquid_work_j == pytest.approx(taken, rel=1e-9)
    assert abs(account.residual_share) < 1e-11
    assert min(account.viscosity_j, account.friction_j) > 0


def test_momentum_of_tank_and_liquid_together() -> None:
    """Nothing but the spring acts on both: Δ(M v + m v + P) = −∫ k q dt."""
    tank = CoupledTank(SETUP, LIGHT)
    tank.deflect(0.02)
    history = tank.advance(np.zeros(1500))
    dry_kg, k = 2 * LIQUID_KG, LIGHT.modes[0].stiffness_n_per_m
    v, momentum = tank.tank_velocity_m_per_s, tank.tank.vertical_momentum_kg_m_per_s()
    impulse = -k * float(history.modal_displacement_m.sum()) * SETUP.step_s
    assert abs(momentum) > 1e-3 * LIQUID_KG
    on_its_way = float(tank.structure_arrays()["structure_carried"][0]) * SETUP.step_s
    assert (dry_kg + LIQUID_KG) * v + momentum + on_its_way == pytest.approx(impulse, abs=1e-12)


def test_gentle_motion_moves_the_liquid_like_a_frozen_one() -> None:
    """Below g the liquid stays where it is: 10 Hz with its mass, 12.2 Hz without."""
    tank = CoupledTank(SETUP, LIGHT)
    tank.deflect(0.0005)
    u = tank.advance(np.zeros(4000)).tank_displacement_m
    crossings = np.flatnonzero((u[:-1] < 0) & (u[1:] >= 0))
    between = crossings + u[crossings] / (u[crossings] - u[crossings + 1])
    frequency_hz = (between.size - 1) / ((between[-1] - between[0]) * SETUP.step_s)
    assert between.size >= 5
    assert frequency_hz == pytest.approx(10.0, rel=0.01)
    assert frequency_hz < 0.9 * LIGHT.natural_frequencies_hz()[0]


def test_sloshing_damps_more_than_frozen() -> None:
    coupled, frozen = CoupledTank(SETUP, BEAM), FrozenTank(LIQUID_KG, BEAM, SETUP.step_s)
    late = []
    for tank in (coupled, frozen):
        tank.deflect(-0.0146)
        u = tank.advance(np.zeros(3500)).tank_displacement_m
        assert u[0] == pytest.approx(-0.0146, rel=1e-3)
        late.append(np.abs(u[-500:]).max())
    assert late[0] < 0.9 * late[1]


def after_an_impulse_at_a_wall(tank: CoupledTank, base: np.ndarray) -> int:
    """Advance at least 300 steps and until a particle has just crossed floor or roof; return how many."""
    tank.advance(base[:300])
    while tank.structure_arrays()["structure_carried"][0] == 0:
        tank.advance(base[tank.n_steps : tank.n_steps + 1])
    return tank.n_steps


@pytest.mark.parametrize("stop", [1, 403, None])
def test_restart_reaches_the_same_bytes(tmp_path: Path, stop: int | None) -> None:
    base = 90 * np.sin(0.02 * np.arange(1500))
    through, first = CoupledTank(SETUP, BEAM), CoupledTank(SETUP, BEAM)
    through.deflect(0.01)
    first.deflect(0.01)
    whole = through.advance(base)
    if stop is None:
        stop = after_an_impulse_at_a_wall(first, base)
    else:
        first.advance(base[:stop])
    coupled_checkpoint.save(first, tmp_path / "saved", {"heard": np.arange(3)})
    again, beside = coupled_checkpoint.load(tmp_path / "saved")
    rest = again.advance(base[stop:])
    assert beside["heard"].tolist() == [0, 1, 2]
    assert again.structure == BEAM
    assert rest.liquid_force_n.tobytes() == whole.liquid_force_n[stop:].tobytes()
    assert rest.modal_acceleration_m_per_s2.tobytes() == whole.modal_acceleration_m_per_s2[stop:].tobytes()
    assert rest.time_s.tobytes() == whole.time_s[stop:].tobytes()
    assert again.account() == through.account()
    coupled_checkpoint.save(again, tmp_path / "again")
    coupled_checkpoint.save(through, tmp_path / "through")
    assert (tmp_path / "again").read_bytes() == (tmp_path / "through").read_bytes()


def test_checkpoint_of_a_tank_alone_is_refused(tmp_path: Path) -> None:
    checkpoint.save(CoupledTank(SETUP, BEAM).tank, tmp_path / "alone")
    with pytest.raises(InputError, match="on a structure"):
        coupled_checkpoint.load(tmp_path / "alone")


def test_state_of_another_structure_is_refused() -> None:
    with pytest.raises(InputError, match="structure_q"):
        CoupledTank(SETUP, LIGHT).restore_structure(CoupledTank(SETUP, BEAM).structure_arrays())


def test_instability_keeps_what_is_valid() -> None:
    tank = CoupledTank(SETUP, LIGHT)
    base = np.zeros(300)
    base[100:] = 1e6
    with pytest.raises(InstabilityError, match="moves faster than sound at") as caught:
        tank.advance(base)
    history = caught.value.valid
    assert 100 <= history.liquid_force_n.size < 300
    assert history.modal_displacement_m.shape == (history.time_s.size, 1)
    assert np.isfinite(history.tank_acceleration_m_per_s2).all()


def test_blocks_are_the_same_as_one_go() -> None:
    uninterrupted, in_blocks = CoupledTank(SETUP, BEAM), CoupledTank(SETUP, BEAM)
    base = 20 * np.cos(0.01 * np.arange(120))
    whole = uninterrupted.advance(base)
    parts = [in_blocks.advance(block) for block in np.split(base, [1, 50])]
    assert np.concatenate([p.liquid_force_n for p in parts]).tobytes() == whole.liquid_force_n.tobytes()
    assert np.concatenate([p.time_s for p in parts]).tobytes() == whole.time_s.tobytes()


def test_a_running_tank_is_not_deflected() -> None:
    tank = CoupledTank(SETUP, BEAM)
    tank.advance([0.0])
    for displacement_m in (0.01, math.nan):
        with pytest.raises(InputError, match="initial displacement"):
            tank.deflect(displacement_m)
