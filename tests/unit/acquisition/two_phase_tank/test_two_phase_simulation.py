"""Balances of the tank of liquid and gas, what it continues to after a stop, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_tank import checkpoint
from acquisition.two_phase_tank.contact_line import NO_LINE
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from sloshlab.errors import InputError

g = 9.81
SETUP = filled_two_phase_tank(Box(0.06, 0.03, 0.05), 0.5, 12, seed=3, numerics=GridNumerics(disturbance=0.2))


def shaken(setup: TwoPhaseSetup = SETUP, n_steps: int = 400) -> tuple[TwoPhaseTank, np.ndarray]:
    tank = TwoPhaseTank(setup)
    times = tank.times_s(n_steps)
    motion = np.stack([5 * np.sin(40 * times), 45 * np.cos(75 * times)], axis=1)
    return tank, motion


def test_liquid_stays_and_forces_are_what_momentum_says() -> None:
    """∫ (F + m (g + ü)) dt is minus the momentum, summed here from fractions and velocities."""
    tank, motion = shaken()
    volume = tank.liquid_volume_m2()
    forces = tank.advance(motion)
    c, (u, w), (dx, dz) = tank.liquid_fraction, tank.velocities(), SETUP.cell_m
    fluids = SETUP.fluids
    mass = (fluids.gas_density_kg_per_m3 * (1 - c) + fluids.density_kg_per_m3 * c) * dx * dz * SETUP.box.depth_m
    up = float((mass * 0.5 * (w[:, 1:] + w[:, :-1])).sum())
    along = float((mass * 0.5 * (u[1:] + u[:-1])).sum())
    for force, momentum, body in (
        (forces.vertical_n, up, -g - motion[:, 1]),
        (forces.horizontal_n, along, -motion[:, 0]),
    ):
        impulse = float((mass.sum() * body - force).sum() * SETUP.step_s)
        assert momentum == pytest.approx(impulse, abs=1e-9 * mass.sum() * np.abs(body).sum() * SETUP.step_s)
    assert tank.liquid_volume_m2() == pytest.approx(volume, rel=1e-9)
    assert np.abs(forces.vertical_n).max() > 3 * SETUP.fluid_mass_kg * g
    assert ((c >= 0) & (c <= 1)).all()


def test_velocities_have_no_divergence() -> None:
    tank, motion = shaken(n_steps=100)
    tank.advance(motion)
    (u, w), (dx, dz) = tank.velocities(), SETUP.cell_m
    divergence = np.diff(u, axis=0) / dx + np.diff(w, axis=1) / dz
    assert np.abs(u).max() > 0.1
    assert np.abs(divergence).max() < 1e-9 * np.abs(u).max() / dx


def test_energy_account_closes() -> None:
    tank, motion = shaken(n_steps=600)
    tank.advance(motion)
    account = tank.account()
    assert account.tank_work_j_per_m > 0.01
    assert min(account.viscosity_j_per_m, account.advection_j_per_m, account.pressure_j_per_m) > 0
    assert abs(account.residual_j_per_m) < 0.02 * account.tank_work_j_per_m
    assert (account - account).residual_j_per_m == 0.0


def test_liquid_at_rest_stays_at_rest() -> None:
    """With a surface that lies within cells: pressure, weight and its place balance to rounding."""
    setup = filled_two_phase_tank(Box(0.06, 0.03), 0.43, 12, numerics=GridNumerics(disturbance=0.0))
    tank = TwoPhaseTank(setup)
    forces = tank.advance(np.zeros(50))
    assert forces.vertical_n == pytest.approx(-g * setup.fluid_mass_kg, rel=1e-9)
    assert max(np.abs(velocity).max() for velocity in tank.velocities()) < 1e-9


def test_a_tank_that_falls_freely_carries_no_weight() -> None:
    setup = filled_two_phase_tank(
        SETUP.box, 0.5, 12, fluids=Fluids(surface_tension_n_per_m=0.0), numerics=SETUP.numerics
    )
    forces = TwoPhaseTank(setup).advance(np.full(20, -g))
    assert np.abs(forces.vertical_n).max() < 1e-12 * g * setup.fluid_mass_kg


def test_sideways_acceleration_mirrors() -> None:
    setup = filled_two_phase_tank(Box(0.06, 0.03), 0.5, 12, numerics=GridNumerics(disturbance=0.0))
    left, right = TwoPhaseTank(setup), TwoPhaseTank(setup)
    push = np.zeros((60, 2))
    push[:, 0] = 6.0
    force, mirrored = left.advance(push), right.advance(-push)
    assert mirrored.horizontal_n == pytest.approx(-force.horizontal_n, rel=1e-6, abs=1e-9)
    assert left.liquid_fraction == pytest.approx(right.liquid_fraction[::-1], abs=1e-6)


def test_roll_turns_gravity() -> None:
    """A tank turned by 0.1 rad and stopped: the liquid at rest leans on a wall with m g sin 0.1."""
    setup = filled_two_phase_tank(Box(0.04, 0.03), 0.5, 12, fluids=Fluids(viscosity_m2_per_s=3e-4))
    tank = TwoPhaseTank(setup)
    n = round(0.2 / setup.step_s)
    motion = np.zeros((2 * n, 3))
    rate = 0.1 / (n * n * setup.step_s**2)
    motion[:n, 2], motion[n:, 2] = rate, -rate
    tank.advance(motion)
    forces = tank.advance(np.zeros((round(1.0 / setup.step_s), 3)))
    used = forces.horizontal_n[-n:]
    assert float(used.mean()) == pytest.approx(-g * setup.fluid_mass_kg * np.sin(0.1), rel=0.02)


def test_same_seed_same_bytes_other_seed_other_liquid() -> None:
    ends = []
    for seed in (3, 3, 4):
        setup = filled_two_phase_tank(SETUP.box, 0.5, 12, seed=seed, numerics=SETUP.numerics)
        tank, motion = shaken(setup, 60)
        tank.advance(motion)
        ends.append(tank.liquid_fraction.tobytes())
    assert ends[0] == ends[1] != ends[2]


@pytest.mark.parametrize("stop", [1, 137])
def test_restart_reaches_the_same_bytes(tmp_path: Path, stop: int) -> None:
    through, motion = shaken(n_steps=200)
    forces = through.advance(motion)
    first, _ = shaken()
    first.advance(motion[:stop])
    checkpoint.save(first, tmp_path / "tank.checkpoint", {"more": np.arange(3)})
    again, extra = checkpoint.load_with_extra(tmp_path / "tank.checkpoint")
    assert again.setup == through.setup
    assert extra["more"].tolist() == [0, 1, 2]
    assert again.advance(motion[stop:]).vertical_n.tobytes() == forces.vertical_n[stop:].tobytes()
    assert again.account() == through.account()
    checkpoint.save(again, tmp_path / "again")
    checkpoint.save(through, tmp_path / "through")
    assert (tmp_path / "again").read_bytes() == (tmp_path / "through").read_bytes()


def test_lines_that_stick_are_part_of_what_is_continued(tmp_path: Path) -> None:
    walls = Walls(advancing_angle_deg=110.0, receding_angle_deg=60.0, line_sticks=True)
    setup = filled_two_phase_tank(SETUP.box, 0.5, 12, seed=3, numerics=SETUP.numerics, walls=walls)
    through, motion = shaken(setup, 120)
    through.advance(motion)
    first, _ = shaken(setup)
    first.advance(motion[:77])
    checkpoint.save(first, tmp_path / "tank.checkpoint")
    again = checkpoint.load(tmp_path / "tank.checkpoint")
    again.advance(motion[77:])
    assert again.liquid_fraction.tobytes() == through.liquid_fraction.tobytes()
    # without the places of the lines the liquid would go on otherwise
    lost = checkpoint.load(tmp_path / "tank.checkpoint")
    lost.restore({**lost.checkpoint_arrays(), "state_lines": np.full((4, 2, 24), NO_LINE)})
    lost.advance(motion[77:])
    assert lost.liquid_fraction.tobytes() != through.liquid_fraction.tobytes()


def test_a_line_with_one_angle_sticks_nowhere() -> None:
    """Between equal angles nothing is left to stick: the same bytes as with a contact angle alone."""
    ends = []
    for sticks in (False, True):
        walls = Walls(advancing_angle_deg=70.0, receding_angle_deg=70.0, line_sticks=sticks)
        tank, motion = shaken(filled_two_phase_tank(SETUP.box, 0.5, 12, numerics=SETUP.numerics, walls=walls), 60)
        tank.advance(motion)
        ends.append(tank.liquid_fraction.tobytes())
    assert ends[0] == ends[1]


def test_a_damaged_checkpoint_or_one_of_another_tank_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tank.checkpoint"
    checkpoint.save(TwoPhaseTank(SETUP), path)
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    (tmp_path / "bad").write_bytes(bytes(content))
    with pytest.raises(InputError, match="damaged"):
        checkpoint.load(tmp_path / "bad")
    other = TwoPhaseTank(filled_two_phase_tank(Box(0.06, 0.03), 0.5, 6))
    with pytest.raises(InputError, match=r"checkpoint, state_c"):
        other.restore(checkpoint.load(path).checkpoint_arrays())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cells_per_height": 5}, "cells over the height"),
        ({"cells_per_height": 9000}, "cells: got"),
        ({"box": Box(float("nan"), 0.03)}, r"box\.length_m"),
        ({"fluids": Fluids(surface_tension_n_per_m=-1.0)}, "surface_tension"),
        ({"numerics": GridNumerics(courant_number=0.6)}, "courant_number"),
        ({"walls": Walls(advancing_angle_deg=60.0)}, "receding_angle_deg"),
        ({"gravity_m_per_s2": float("inf")}, "gravity"),
    ],
)
def test_what_cannot_be_computed_is_refused(change: dict[str, object], message: str) -> None:
    values = {"box": SETUP.box, "column": SETUP.column, "cells_per_height": 12, **change}
    with pytest.raises(InputError, match=message):
        TwoPhaseSetup(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize("motion", [[np.nan], np.zeros((2, 4)), np.zeros((2, 2, 2))])
def test_motion_that_is_none_is_refused(motion: object) -> None:
    with pytest.raises(InputError, match="acceleration"):
        TwoPhaseTank(SETUP).advance(motion)  # type: ignore[arg-type]


def test_instability_keeps_what_was_computed() -> None:
    tank = TwoPhaseTank(SETUP)
    with pytest.raises(InstabilityError, match=r"so fast.*other cells") as caught:
        tank.advance([0.0, 1e12, 0.0])
    assert caught.value.valid.vertical_n.size == tank.n_steps
