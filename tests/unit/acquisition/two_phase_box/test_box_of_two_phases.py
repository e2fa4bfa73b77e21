"""The box: the plane's flow where it is one cell deep, the same along every axis, volume, rest, checkpoint."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank.forced_motion import HarmonicMotion
from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_box import checkpoint
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_box.simulation import TwoPhaseBox
from acquisition.two_phase_tank.setup import GridNumerics, TwoPhaseSetup, Walls, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from sloshlab.errors import InputError

EXACT = GridNumerics(tolerance=1e-11)


def filled(box: Box, cells: int, *, hold: bool = True) -> TwoPhaseSetup:
    return filled_two_phase_tank(box, 0.5, cells, walls=Walls(hold=hold), numerics=EXACT, seed=3)


def test_one_cell_deep_it_computes_the_flow_of_the_plane() -> None:
    """The plane's tank is another program with another solver; chaos parts them only after many steps."""
    setup = filled(Box(0.06, 0.03, 0.004), 12)
    plane, box = TwoPhaseTank(setup), TwoPhaseBox(TwoPhaseBoxSetup(setup, 1, hold_front_and_back=False))
    box.set_fractions(plane.liquid_fraction[:, None, :])
    motion = HarmonicMotion(4 * 9.81, 11.4, rise_s=0.02)(plane.times_s(260))
    one, other = plane.advance(motion), box.advance(motion)
    strongest = float(np.abs(one.vertical_n).max())
    assert float(np.abs(plane.velocities()[0]).max()) > 0.1
    assert other.vertical_n == pytest.approx(one.vertical_n, abs=1e-6 * strongest)
    assert box.liquid_fraction[:, 0] == pytest.approx(plane.liquid_fraction, abs=1e-5)
    assert box.account().tank_work_j_per_m == pytest.approx(plane.account().tank_work_j_per_m, rel=1e-6)
    assert box.account().viscosity_j_per_m == pytest.approx(plane.account().viscosity_j_per_m, rel=1e-6)


@pytest.mark.parametrize(("along_depth", "hold"), [(False, True), (True, False)])
def test_several_cells_deep_it_computes_the_flow_of_the_plane(along_depth: bool, hold: bool) -> None:
    """A wave that is the same all along one side of the box, which runs along the other."""
    n_long, n_short, n_up, cell_m = 24, 8, 12, 0.0025
    plane = TwoPhaseTank(filled(Box(n_long * cell_m, n_up * cell_m, cell_m), n_up, hold=hold))
    length, depth = (n_short, n_long) if along_depth else (n_long, n_short)
    setup = filled(Box(length * cell_m, n_up * cell_m, depth * cell_m), n_up, hold=hold)
    # walls that hold would hold those of the short side, too
    box = TwoPhaseBox(TwoPhaseBoxSetup(setup, depth, hold_front_and_back=False))
    surface = 6.2 + 1.5 * np.cos(np.pi * (np.arange(n_long) + 0.5) / n_long)
    wave = np.clip(surface[:, None] - np.arange(n_up), 0, 1)
    plane.set_fractions(wave)
    box.set_fractions(np.broadcast_to(wave if along_depth else wave[:, None], box.setup.cells))
    upward = HarmonicMotion(1.5 * 9.81, 11.4, rise_s=0.02)(plane.times_s(60))
    sideways = HarmonicMotion(0.2 * 9.81, 7.0)(plane.times_s(60))
    still = np.zeros(60)
    one = plane.advance(np.stack([sideways, upward], axis=1))
    other = box.advance(np.stack([still, sideways, upward] if along_depth else [sideways, still, upward], axis=1))
    strongest = float(np.abs(one.vertical_n).max())
    assert float(np.abs(plane.velocities()[0]).max()) > 0.05
    assert float(np.abs(one.horizontal_n).max()) > 0.05 * strongest
    # of six steps two take depth and height in the other order than the plane takes length and height
    exact = 1e-5 if along_depth else 1e-6
    assert other.vertical_n / n_short == pytest.approx(one.vertical_n, abs=exact * strongest)
    along = other.sideways_n if along_depth else other.horizontal_n
    assert along / n_short == pytest.approx(one.horizontal_n, abs=exact * strongest)
    # per metre of depth, which is the wave's way where it runs along it
    share = n_short / n_long if along_depth else 1.0
    expected = share * plane.account().viscosity_j_per_m
    assert box.account().viscosity_j_per_m == pytest.approx(expected, rel=10 * exact)
    across = box.velocities()[0 if along_depth else 1]
    # what the search for the pressure leaves
    assert float(np.abs(across).max()) < 1e-7


def test_it_is_the_same_along_length_and_depth() -> None:
    """A heap of liquid that falls, and the same heap with both sides exchanged."""
    setup = TwoPhaseBoxSetup(filled(Box(0.04, 0.04, 0.04), 8), 8)
    x = np.arange(8)[:, None, None]
    y, z = np.arange(8)[:, None], np.arange(8)
    heap = np.clip(6.3 - 0.9 * x - 0.35 * y - z, 0, 1)
    one, other = TwoPhaseBox(setup), TwoPhaseBox(setup)
    one.set_fractions(heap)
    other.set_fractions(heap.swapaxes(0, 1))
    volume = one.liquid_volume_m3()
    for tank in (one, other):
        tank.advance(np.zeros(60))
    assert float(np.abs(one.velocities()[0]).max()) > 0.1
    # the order in which the axes are carried differs: of the order of the step
    assert other.liquid_fraction.swapaxes(0, 1) == pytest.approx(one.liquid_fraction, abs=0.05)
    assert other.centre_height_m() == pytest.approx(one.centre_height_m(), rel=2e-3)
    assert one.liquid_volume_m3() == pytest.approx(volume, rel=1e-8)
    assert abs(one.account().residual_share) < 1e-3


def test_liquid_at_rest_stays_at_rest_wherever_its_surface_lies() -> None:
    # the pressure is searched for so closely that what is left of divergence moves nothing
    numerics = GridNumerics(disturbance=0.0, tolerance=1e-12)
    level = filled_two_phase_tank(Box(0.05, 0.03, 0.04), 0.43, 8, numerics=numerics)
    tank = TwoPhaseBox(TwoPhaseBoxSetup(level))
    forces = tank.advance(np.zeros(50))
    assert forces.vertical_n[10:] == pytest.approx(-tank.setup.fluid_mass_kg * 9.81, rel=1e-4)
    assert max(float(np.abs(v).max()) for v in tank.velocities()) < 1e-8
    assert np.abs(forces.sideways_n).max() < 1e-9


def test_a_stopped_run_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    setup = TwoPhaseBoxSetup(filled(Box(0.04, 0.03, 0.03), 8))
    tank = TwoPhaseBox(setup)
    motion = 20 * np.sin(np.arange(40))
    tank.advance(motion[:20])
    checkpoint.save(tank, tmp_path / "run")
    again, _ = checkpoint.load_with_extra(tmp_path / "run")
    assert again.setup == setup
    whole, rest = tank.advance(motion[20:]), again.advance(motion[20:])
    assert whole.vertical_n.tobytes() == rest.vertical_n.tobytes()
    assert tank.liquid_fraction.tobytes() == again.liquid_fraction.tobytes()


@pytest.mark.parametrize(
    ("walls", "match"),
    [
        (Walls(layer_frequency_hz=5.0), "layer_frequency_hz"),
        (Walls(advancing_angle_deg=100.0), "contact angles"),
        (Walls(line_sticks=True), "contact angles"),
    ],
)
def test_what_only_the_plane_has_is_refused(walls: Walls, match: str) -> None:
    plane = filled_two_phase_tank(Box(0.04, 0.03, 0.03), 0.5, 8, walls=walls)
    with pytest.raises(InputError, match=match):
        TwoPhaseBoxSetup(plane)


def test_no_cells_and_too_many_are_refused() -> None:
    plane = filled(Box(0.04, 0.03, 0.03), 8)
    with pytest.raises(InputError, match="cells over the depth"):
        TwoPhaseBoxSetup(plane, 0)
    with pytest.raises(InputError, match="cells"):
        TwoPhaseBoxSetup(plane, 1_000_000)
