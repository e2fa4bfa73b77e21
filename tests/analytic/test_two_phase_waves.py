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
