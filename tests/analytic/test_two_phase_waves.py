"""Liquid and gas against potential flow; formulas written here in the books' symbols."""

import math

import numpy as np
import pytest

from acquisition.numerical_tank.tank import Box, LiquidColumn
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank

g, rho, rho_gas, sigma = 9.81, 998.2, 1.204, 0.0728
STILL = GridNumerics(disturbance=0.0)


def crossings(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    return times[at] + (times[at + 1] - times[at]) * values[at] / (values[at] - values[at + 1])


@pytest.mark.parametrize(("mode", "n"), [(1, 16), (2, 32)])
def test_standing_wave_has_the_frequency_of_two_layers(mode: int, n: int) -> None:
    """ω² = ((ρ − ρ') g k + σ k³)/(ρ coth kh + ρ' coth kh'), Lamb art. 231, 267; from zero crossings."""
    length = 0.1
    setup = filled_two_phase_tank(Box(length, length), 0.5, n, walls=Walls(hold=False), numerics=STILL)
    tank, k = TwoPhaseTank(setup), mode * math.pi / length
    x = (np.arange(n) + 0.5) / n * length
    height = 0.5 * n + 0.02 / k / (length / n) * np.cos(k * x)
    tank.set_fractions(np.clip(height[:, None] - np.arange(n), 0, 1))
    stiffness = (rho - rho_gas) * g * k + sigma * k**3
    omega = math.sqrt(stiffness / (rho + rho_gas) * math.tanh(k * length / 2))
    rows = []
    while tank.time_s < 2.2 * 2 * math.pi / omega:
        rows.append((tank.time_s, float((tank.liquid_fraction.sum(axis=1) * np.cos(k * x)).sum())))
        tank.advance(np.zeros(2))
    at = crossings(*np.array(rows).T)
    assert math.pi / np.diff(at).mean() == pytest.approx(omega, rel=0.01)


def test_drop_oscillates_as_lamb_says() -> None:
    """ω² = n (n² − 1) σ/((ρ + ρ') R³) of a cylinder, n = 2; from zero crossings of its second moments."""
    n, radius, side = 24, 0.01, 0.04
    fluids = Fluids()
    setup = TwoPhaseSetup(
        Box(side, side), LiquidColumn(0.02, 0.02), n, fluids, Walls(hold=False), STILL, gravity_m_per_s2=0.0
    )
    tank = TwoPhaseTank(setup)
    fine = ((np.arange(8 * n) + 0.5) / (8 * n) - 0.5) * side
    x, z = np.meshgrid(fine, fine, indexing="ij")
    inside = np.hypot(x * 0.975, z / 0.975) < radius
    tank.set_fractions(inside.reshape(n, 8, n, 8).mean(axis=(1, 3)))
    coarse = ((np.arange(n) + 0.5) / n - 0.5) * side
    weights = coarse[:, None] ** 2 - coarse[None, :] ** 2
    omega = math.sqrt(6 * sigma / ((rho + rho_gas) * radius**3))
    rows = []
    while tank.time_s < 1.6 * 2 * math.pi / omega:
        rows.append((tank.time_s, float((tank.liquid_fraction * weights).sum())))
        tank.advance(np.zeros(1))
    at = crossings(*np.array(rows).T)
    assert math.pi / np.diff(at).mean() == pytest.approx(omega, rel=0.02)
    volume = float(tank.liquid_fraction.sum()) * (side / n) ** 2
    assert volume == pytest.approx(inside.mean() * side**2, rel=1e-9)


@pytest.mark.parametrize(("share", "slides"), [(0.8, False), (1.5, True)])
def test_drop_that_sticks_is_held_up_to_the_difference_of_its_angles(share: float, slides: bool) -> None:
    """In the plane m x'' = (ρ − ρ') A a − σ (cos θ_r − cos θ_a), Furmidge 1962; below that it hangs still."""
    nx, nz, length, height, R = 128, 20, 0.08, 0.0125, 0.005
    theta_a, theta_r = math.radians(100), math.radians(60)
    walls = Walls(hold=False, advancing_angle_deg=100, receding_angle_deg=60, line_sticks=True)
    fluids, column = Fluids(viscosity_m2_per_s=1e-5), LiquidColumn(0.01, 0.005)
    setup = TwoPhaseSetup(Box(length, height), column, nz, fluids, walls, STILL, gravity_m_per_s2=0.0)
    tank = TwoPhaseTank(setup)
    x = ((np.arange(8 * nx) + 0.5) / (8 * nx) - 0.7) * length
    z = (np.arange(8 * nz) + 0.5) / (8 * nz) * height
    tank.set_fractions((np.hypot(x[:, None], z) < R).reshape(nx, 8, nz, 8).mean(axis=(1, 3)))
    area = math.pi * R**2 / 2
    a = share * sigma * (math.cos(theta_r) - math.cos(theta_a)) / ((rho - rho_gas) * area)
    times, places = tank.times_s(round(0.4 / setup.step_s)), []
    for pull in a * np.minimum(times / 0.2, 1):
        # the tank goes to the right, the drop to the left
        tank.advance([[pull, 0.0]])
        places.append(float(tank.liquid_fraction.sum(axis=1) @ np.arange(nx)) / tank.liquid_fraction.sum())
    course = -np.array(places) * length / nx
    late = times > 0.25
    acceleration, speed = np.polyfit(times[late] - times[-1], course[late], 2)[:2] * (2, 1)
    expected = (share - 1) / share * a if slides else 0.0
    # the drop still swings a little about its new shape
    assert acceleration == pytest.approx(expected, abs=0.05 * a)
    assert speed == pytest.approx(0.0, abs=0.005) if not slides else speed > 0.05
