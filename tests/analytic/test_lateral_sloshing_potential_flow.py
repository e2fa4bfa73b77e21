"""The equivalent mechanical model against the exact linear potential flow in a box that moves and rocks.

The flow is found without the model: a potential that satisfies the walls (for rocking, cosines over the height,
after Stokes and Joukowski), waves of the free surface that satisfy walls and floor, their amplitudes from the
condition s²Φ + gΦ_z = 0 at the surface, and force and moment by integrating the pressure over the walls.
"""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.lateral_sloshing.box_tank import BoxTank, closed_box_inertia_ratio, equivalent_model

G, RHO = 9.81, 650.0
N_SERIES = 1200
PLACES = [0.5j, 12.5j, 30j, 77j, 200j, 3 + 7j]
# one, two and three times the breadth, flat to deep
BOXES = [(0.18, 0.18, 0.065), (0.09, 0.18, 0.065), (0.05, 0.12, 0.11), (1.8, 2.4, 0.35)]


class Flow:
    """Potential per unit of Y (`rocks` False) or φ (True), divided by s; y sideways, z up from the centre."""

    def __init__(self, s: complex, rocks: bool, side: float, fill: float) -> None:
        self.rocks, self.side, self.fill = rocks, side, fill
        n = np.arange(1, N_SERIES + 1)
        odd, sign = 2 * n - 1, (-1.0) ** (n - 1)
        self.k, self.wall = odd * np.pi / side, odd * np.pi / fill
        # 2z = Σ d_j cos(λ_j (z + h/2)) and y = Σ c_n sin(k_n y)
        self.d = -8 * fill / (np.pi * odd) ** 2
        c = 4 * sign / (side * self.k**2)
        if rocks:
            # the walls' potential at the surface, where cos(λ_j h) = −1, in the sines of the waves
            overlap = 4 / side * sign[:, None] / (self.k[:, None] ** 2 + self.wall[None, :] ** 2)
            at_surface = -overlap @ self.d
            missing = s**2 * (-fill / 2 * c + at_surface) - G * c
        else:
            missing = s**2 * c
        self.waves = -missing / (s**2 + G * self.k * np.tanh(self.k * fill))

    def potential(self, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        up = z[:, None] + self.fill / 2
        decay = np.exp(self.k * (up - self.fill))
        cosh = decay * (1 + np.exp(-2 * self.k * up)) / (1 + np.exp(-2 * self.k * self.fill))
        waves = (np.sin(self.k * y[:, None]) * cosh) @ self.waves
        if not self.rocks:
            return y + waves
        far = np.exp(self.wall * (np.abs(y[:, None]) - self.side / 2))
        sinh = np.sign(y[:, None]) * far * (1 - np.exp(-2 * self.wall * np.abs(y[:, None])))
        sinh /= 1 + np.exp(-self.wall * self.side)
        return -y * z + (np.cos(self.wall * up) * sinh) @ (self.d / self.wall) + waves

    def force_and_moment(self, s: complex, breadth: float) -> tuple[complex, complex]:
        z, dz = graded(-self.fill / 2, self.fill / 2)
        y, dy = graded(-self.side / 2, self.side / 2)
        side_wall = -RHO * s**2 * self.potential(np.full_like(z, self.side / 2), z)
        floor = -RHO * s**2 * self.potential(y, np.full_like(y, -self.fill / 2))
        force = 2 * breadth * np.sum(side_wall * dz)
        moment = 2 * breadth * np.sum(side_wall * z * dz) + breadth * np.sum(floor * y * dy)
        # the level stays as the box tilts: hydrostatic pressure on its floor
        return force, moment + self.rocks * RHO * G * breadth * self.side**3 / 12


def graded(low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of Gauss, in panels that shrink towards both ends, where the flow has corners."""
    shares = 0.5 * 2.0 ** -np.arange(11.0)
    edges = low + (high - low) * np.concatenate([[0.0], shares[::-1], 1 - shares[1:], [1.0]])
    x, w = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()


@pytest.mark.parametrize("rocks", [False, True])
def test_the_reference_flow_is_one(rocks: bool) -> None:
    """Walls, floor and surface, by differences of the potential away from the corners."""
    side, fill, s, e = 0.18, 0.065, 3 + 7j, 1e-5
    flow = Flow(s, rocks, side, fill)
    at = np.array([-0.6, -0.2, 0.4, 0.7])

    def slope(y: np.ndarray, z: np.ndarray, dy: float, dz: float) -> np.ndarray:
        ahead = flow.potential(y + dy, z + dz)
        back = flow.potential(y - dy, z - dz)
        return (ahead - back) / (2 * np.hypot(dy, dz))

    z = at * fill / 2
    assert slope(np.full(4, side / 2), z, e, 0) == pytest.approx(z if rocks else np.ones(4), abs=2e-5)
    y = at * side / 2
    assert slope(y, np.full(4, -fill / 2), 0, e) == pytest.approx(-y if rocks else np.zeros(4), abs=2e-5)
    top = np.full(4, fill / 2)
    surface = s**2 * flow.potential(y, top) + G * slope(y, top, 0, e)
    assert np.abs(surface).max() < 2e-5 * np.abs(s**2 * flow.potential(y, top)).max()


@pytest.mark.parametrize(("side", "breadth", "fill"), BOXES)
@pytest.mark.parametrize("s", PLACES)
def test_force_and_moment_are_those_of_the_flow(s: complex, side: float, breadth: float, fill: float) -> None:
    """All entries to 1e-6 of the size of their kind; what is left is the quadrature of the reference."""
    tank = BoxTank(side, breadth, 2 * fill, fill_level=0.5, density_kg_per_m3=RHO)
    model = equivalent_model(tank, "x", n_modes=N_SERIES, damping_ratio=0.0)
    expected = np.array([Flow(s, rocks, side, fill).force_and_moment(s, breadth) for rocks in (False, True)]).T
    assert model.transfer_matrix(s) == pytest.approx(expected, rel=1e-6)


def test_the_static_limit_is_the_moment_of_the_free_surface() -> None:
    tank = BoxTank(0.18, 0.09, 0.13, fill_level=0.5, density_kg_per_m3=RHO)
    static = equivalent_model(tank, "x", n_modes=2000).transfer_matrix(0.0)
    assert static == pytest.approx(np.diag([0.0, RHO * G * 0.18**3 * 0.09 / 12]), rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("ratio", [0.02, 0.3, 1.0])
def test_the_closed_box_is_one_on_its_side(ratio: float) -> None:
    """The series as it is printed, with tanh in the other side's place: it converges the faster way round."""
    odd = 2 * np.arange(1, 200_000) - 1.0
    r = ratio
    as_printed = (
        1 - 4 / (1 + r * r) + 768 / (np.pi**5 * r * (1 + r * r)) * np.sum(np.tanh(odd * np.pi * r / 2) / odd**5)
    )
    assert closed_box_inertia_ratio(r) == pytest.approx(as_printed, abs=1e-9)
    assert closed_box_inertia_ratio(1 / r) == pytest.approx(as_printed, abs=1e-9)
