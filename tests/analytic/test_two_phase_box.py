"""Liquid and gas in a box against potential flow, in three dimensions; formulas in the books' symbols."""

import math

import numpy as np
import pytest

from acquisition.numerical_tank.tank import Box, LiquidColumn
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_box.simulation import TwoPhaseBox
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls, filled_two_phase_tank
from studies.two_phase_verification.linear_theory import Layers

g, rho, rho_gas, sigma = 9.81, 998.2, 1.204, 0.0728
STILL = GridNumerics(disturbance=0.0)


def crossings(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    return np.asarray(times[at] + (times[at + 1] - times[at]) * values[at] / (values[at] - values[at + 1]))


def wave_over_both_sides(fluids: Fluids, n_periods: float) -> tuple[TwoPhaseBox, float, np.ndarray]:
    """Half a wave over length and depth, walls that slip, 12 cells; the tank, k, and rows of time and size."""
    length, depth, height, n = 0.1, 0.08, 0.06, 12
    plane = filled_two_phase_tank(
        Box(length, height, depth), 0.5, n, fluids=fluids, walls=Walls(hold=False), numerics=STILL
    )
    tank = TwoPhaseBox(TwoPhaseBoxSetup(plane))
    nx, ny, nz = tank.setup.cells
    kx, ky = math.pi / length, math.pi / depth
    k = math.hypot(kx, ky)
    x, y = (np.arange(nx) + 0.5) / nx * length, (np.arange(ny) + 0.5) / ny * depth
    shape = np.cos(kx * x)[:, None] * np.cos(ky * y)
    surface = 0.5 * nz + 0.02 / k / (height / nz) * shape
    tank.set_fractions(np.clip(surface[:, :, None] - np.arange(nz), 0, 1))
    rows = []
    while tank.time_s < n_periods * 2 * math.pi / free_wave(k, height / 2):
        rows.append((tank.time_s, float((tank.liquid_fraction.sum(axis=2) * shape).sum())))
        tank.advance(np.zeros(2))
    return tank, k, np.array(rows)


def free_wave(k: float, h: float) -> float:
    """ω² = ((ρ − ρ') g k + σ k³)/(ρ coth kh + ρ' coth kh'), h' = h, Lamb art. 257, 267."""
    return math.sqrt(((rho - rho_gas) * g * k + sigma * k**3) / (rho + rho_gas) * math.tanh(k * h))


def test_standing_wave_over_both_sides_has_the_frequency_of_two_layers() -> None:
    """k² = (π/l)² + (π/b)²."""
    tank, k, rows = wave_over_both_sides(Fluids(), 2.2)
    at = crossings(*rows.T)
    assert math.pi / np.diff(at).mean() == pytest.approx(free_wave(k, 0.03), rel=0.01)
    # what nobody accounts for, of the energy that the wave had
    assert abs(tank.account().residual_share) < 1e-2


def test_a_thick_one_decays_as_two_viscous_layers() -> None:
    """Between walls that slip waves of one k = |(kx, ky)| are alike: the plane's linear theory has the decay."""
    thick = Fluids(viscosity_m2_per_s=2e-4)
    _, k, rows = wave_over_both_sides(thick, 3.2)
    time, size = rows.T
    _, decay = Layers(thick, k, 0.03, 0.03, g).free_wave()
    # its turning points, half a period apart
    turning = np.flatnonzero((size[1:-1] - size[:-2]) * (size[2:] - size[1:-1]) < 0) + 1
    slope = np.polyfit(time[turning], np.log(np.abs(size[turning])), 1)[0]
    assert -slope == pytest.approx(decay, rel=0.05)


@pytest.mark.parametrize(("radius", "scatter"), [(3, 0.12), (5, 0.03), (8, 0.03)])
def test_a_ball_is_as_curved_as_its_radius_says(radius: int, scatter: float) -> None:
    """κ = 2/R all over it, R in cells, wherever its centre lies in a cell."""
    n, fine, side = 20, 12, 0.02
    setup = TwoPhaseSetup(
        Box(side, side, side),
        LiquidColumn(side, side / 2),
        n,
        Fluids(),
        Walls(hold=False),
        STILL,
        gravity_m_per_s2=0.0,
    )
    tank = TwoPhaseBox(TwoPhaseBoxSetup(setup))
    a, b, c = n / 2 + 0.31, n / 2 - 0.22, n / 2 + 0.47
    at = (np.arange(fine * n) + 0.5) / fine
    half = np.sqrt(np.maximum(radius**2 - (at[:, None] - a) ** 2 - (at - b) ** 2, 0.0))[:, :, None]
    filled = np.clip(c + half - np.arange(n), 0, 1) - np.clip(c - half - np.arange(n), 0, 1)
    tank.set_fractions(filled.reshape(n, fine, n, fine, n).mean(axis=(1, 3)))
    kappa = tank.curvature_per_m()
    found = kappa[np.isfinite(kappa)] * radius * side / n / 2
    assert found.size > 10 * radius**2
    assert found.mean() == pytest.approx(1.0, abs=0.03)
    assert found.std() < scatter


def eighth_of_a_drop(n: int, side: float, radius: float, stretch: float) -> np.ndarray:
    """Volume fractions of x² s + y² s + z²/s² < R² in the corner of a cube; exact along z."""
    fine = 24
    at = (np.arange(fine * n) + 0.5) / (fine * n) * side
    top = stretch * np.sqrt(np.maximum(radius**2 - (at[:, None] ** 2 + at**2) * stretch, 0.0))
    filled = np.clip(top[:, :, None] / (side / n) - np.arange(n), 0, 1)
    return np.asarray(filled.reshape(n, fine, n, fine, n).mean(axis=(1, 3)))


@pytest.mark.parametrize(
    ("n", "within"), [(12, 0.05), pytest.param(24, 0.02, marks=pytest.mark.slow)], ids=["coarse", "fine"]
)
def test_drop_oscillates_as_lamb_says(n: int, within: float) -> None:
    """ω² = n (n + 1)(n − 1)(n + 2) σ/(((n + 1) ρ + n ρ') R³), Lamb art. 275, n = 2; from its second moments.

    An eighth of it: the walls are its planes of symmetry.
    """
    radius, side = 0.01, 0.02
    column = LiquidColumn(side, side / 2)
    setup = TwoPhaseSetup(
        Box(side, side, side), column, n, Fluids(), Walls(hold=False), STILL, gravity_m_per_s2=0.0
    )
    tank = TwoPhaseBox(TwoPhaseBoxSetup(setup))
    tank.set_fractions(eighth_of_a_drop(n, side, radius, 1.06))
    volume = tank.liquid_volume_m3()
    middles = (np.arange(n) + 0.5) / n * side
    weights = middles**2 - 0.5 * (middles[:, None, None] ** 2 + middles[:, None] ** 2)
    omega = math.sqrt(24 * sigma / ((3 * rho + 2 * rho_gas) * radius**3))
    rows = []
    while tank.time_s < 1.4 * 2 * math.pi / omega:
        rows.append((tank.time_s, float((tank.liquid_fraction * weights).sum())))
        tank.advance(np.zeros(1))
    at = crossings(*np.array(rows).T)
    # a whole period, for the drop of the grid is not quite round
    assert 2 * math.pi / (at[2] - at[0]) == pytest.approx(omega, rel=within)
    assert tank.liquid_volume_m3() == pytest.approx(volume, rel=1e-5)
