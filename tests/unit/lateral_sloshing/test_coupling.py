"""Transfer to the tank's centre and to structures, frozen liquid, and the whole system."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank, equivalent_model
from sloshlab.lateral_sloshing.coupling import (
    BODY_AXES,
    coupled_system,
    frozen_mass_matrix,
    rigid_motion,
    sloshing_liquid,
)

SQUARE = BoxTank(0.18, 0.18, 0.13, fill_level=0.5, density_kg_per_m3=650.0)
OBLONG = BoxTank(0.18, 0.09, 0.13, fill_level=0.3, density_kg_per_m3=800.0)


def pointwise_inertia(tank: BoxTank, turn: float = 0.0) -> np.ndarray:
    """Mass matrix at the tank's centre by summing the liquid's particles: midpoints of a fine grid and their
    own inertia left out, which is made good by Richardson's extrapolation."""

    def summed(n: int) -> np.ndarray:
        x, y, z = ((np.arange(n) + 0.5) / n - 0.5 for _ in range(3))
        grid = np.stack(np.meshgrid(x * tank.length_m, y * tank.width_m, z * tank.fill_height_m), -1).reshape(
            -1, 3
        )
        grid[:, 2] += -tank.height_m / 2 + tank.fill_height_m / 2
        c, s = np.cos(turn), np.sin(turn)
        grid = grid @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
        mass = np.zeros((6, 6))
        for point in grid:
            velocity = np.hstack([np.eye(3), np.cross(np.eye(3), point).T])  # θ × r, a column per rotation
            mass += velocity.T @ velocity
        return mass * tank.liquid_mass_kg / len(grid)

    return (4 * summed(8) - summed(4)) / 3


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize("tank", [SQUARE, OBLONG])
def test_frozen_liquid_in_six_directions_is_that_of_its_particles(tank: BoxTank, turn: float) -> None:
    assert frozen_mass_matrix(tank, turn_rad=turn) == pytest.approx(pointwise_inertia(tank, turn), abs=1e-12)


def test_slow_motion_moves_the_whole_mass() -> None:
    """At ω → 0 the liquid resists acceleration like its mass in all three directions."""
    coupling = sloshing_liquid(OBLONG, n_modes=3, damping_ratio=0.0)
    force = coupling.transfer_matrix(1e-3j)[:3, :3] / 1e-6
    assert force == pytest.approx(OBLONG.liquid_mass_kg * np.eye(3), rel=1e-6, abs=1e-6)


def test_both_planes_of_a_square_tank_are_alike() -> None:
    """A structure as stiff along x as along y has each pole twice, with rocking in it."""
    coupling = sloshing_liquid(SQUARE, n_modes=3, damping_ratio=0.01)
    mass = np.diag([3.0, 3.0, 3.0, 0.02, 0.02, 0.03])
    stiffness = np.diag([900.0, 900.0, 900.0, 30.0, 30.0, 30.0])
    # coupled by a lever: pulled at a place above its centre
    arm = rigid_motion([0.0, 0.0, 0.04])
    mass, stiffness = arm.T @ mass @ arm, arm.T @ stiffness @ arm + 0.1 * np.eye(6)
    poles = coupled_system(mass, 0 * mass, stiffness, (coupling,)).poles()
    planar = poles[np.abs(poles.imag) > 0]
    apart = [np.sort(np.abs(planar - pole))[1] for pole in planar]
    single = np.sum(np.array(apart) > 1e-6)
    # only the vertical and the yawing mode have no partner, each a pair of poles
    assert single == 4


def test_a_turned_tank_is_the_tank_in_turned_axes() -> None:
    """A quarter turn makes the length lie along y."""
    turned = sloshing_liquid(OBLONG, turn_rad=np.pi / 2)
    lying = sloshing_liquid(BoxTank(0.09, 0.18, 0.13, fill_level=0.3, density_kg_per_m3=800.0), turn_rad=0.0)
    s = 2.0 + 9.0j
    assert turned.transfer_matrix(s) == pytest.approx(lying.transfer_matrix(s), abs=1e-10)


def test_the_arm_to_the_centre_is_the_moment_of_the_force() -> None:
    """A push sideways on the liquid below the centre: about the centre its moment has an arm."""
    s = 8j
    plane = equivalent_model(OBLONG, "x").transfer_matrix(s)
    six = sloshing_liquid(OBLONG).transfer_matrix(s)
    arm = OBLONG.height_m / 2 - OBLONG.fill_height_m / 2
    # force F on G, below O: about y, z up, the moment of F x̂ at −arm ẑ is −arm F
    assert six[0, 0] == pytest.approx(plane[0, 0])
    assert six[4, 0] == pytest.approx(plane[1, 0] - arm * plane[0, 0])
    # tilting by θ_y moves G back
    assert six[4, 4] == pytest.approx(plane[1, 1] - arm * (plane[1, 0] + plane[0, 1]) + arm**2 * plane[0, 0])
    # and along y the other sign of the rotation
    across = equivalent_model(OBLONG, "y").transfer_matrix(s)
    assert six[3, 1] == pytest.approx(-(across[1, 0] - arm * across[0, 0]))


def test_body_axes_turn_both_rotations() -> None:
    coupling = sloshing_liquid(OBLONG)
    body = coupling.transferred(BODY_AXES)
    assert body.rigid[4, 0] == pytest.approx(-coupling.rigid[4, 0])
    assert body.rigid[3, 1] == pytest.approx(-coupling.rigid[3, 1])
    assert body.rigid[0, 0] == pytest.approx(coupling.rigid[0, 0])


def test_a_rigidly_held_tank_has_the_frequencies_of_its_liquid() -> None:
    coupling = sloshing_liquid(OBLONG, n_modes=2, damping_ratio=0.0).transferred(np.zeros((6, 1)))
    poles = coupled_system([[1.0]], [[0.0]], [[1.0]], (coupling,)).poles()
    expected = [1.0] + [
        np.sqrt(9.81 * k * np.tanh(k * 0.039)) for side in (0.18, 0.09) for k in np.pi / side * np.array([1, 3])
    ]
    assert np.sort(poles.imag[poles.imag > 0]) == pytest.approx(np.sort(expected))


def test_two_halves_of_a_tank_at_one_place_are_the_tank() -> None:
    """Half the width at the same place: the same liquid along x; across, it is another tank."""
    half = BoxTank(0.18, 0.045, 0.13, fill_level=0.3, density_kg_per_m3=800.0)
    along = np.eye(6)[:, [0, 4]]
    one, two = sloshing_liquid(OBLONG).transferred(along), sloshing_liquid(half).transferred(along)
    s = 0.3 + 11j
    assert 2 * two.transfer_matrix(s) == pytest.approx(one.transfer_matrix(s), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"height_m": -1.0}, "tank: height_m: got -1.0; allowed: > 0"),
        ({"fill_level": 1.0}, "tank: fill_level: got 1; allowed: 0 < fill_level < 1"),
        ({"density_kg_per_m3": float("nan")}, "tank: density_kg_per_m3: got nan"),
    ],
)
def test_impossible_tanks_are_refused(change: dict[str, float], message: str) -> None:
    numbers = {"length_m": 1.0, "width_m": 1.0, "height_m": 1.0, "fill_level": 0.5, "density_kg_per_m3": 1000.0}
    with pytest.raises(InputError, match=message):
        BoxTank(**{**numbers, **change})


def test_a_mass_matrix_that_is_not_positive_is_refused() -> None:
    coupling = sloshing_liquid(SQUARE)
    nothing = np.diag([-2.0, 1, 1, 1, 1, 1])
    with pytest.raises(InputError, match="mass matrix: got a smallest eigenvalue of -"):
        coupled_system(nothing, np.zeros((6, 6)), np.eye(6), (coupling,))
    skew = np.eye(6)
    skew[0, 1] = 0.1
    with pytest.raises(InputError, match="not symmetric"):
        coupled_system(skew, np.zeros((6, 6)), np.eye(6), ())
