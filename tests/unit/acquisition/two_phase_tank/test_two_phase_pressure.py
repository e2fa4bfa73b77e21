"""Both ways to the pressure agree, and solve what a direct sum of fluxes says."""

import numpy as np
import pytest

from acquisition.two_phase_tank.pressure import Pressure


@pytest.mark.parametrize("searched", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_pressure_gives_the_source_back(searched: bool) -> None:
    rng, nx, nz, dx, dz = np.random.default_rng(5), 20, 12, 0.003, 0.002
    density = np.where(rng.random((nx, nz)) < 0.5, 1.2, 998.0)
    bx, bz = np.zeros((nx + 1, nz)), np.zeros((nx, nz + 1))
    bx[1:-1], bz[:, 1:-1] = 2 / (density[1:] + density[:-1]), 2 / (density[:, 1:] + density[:, :-1])
    source = rng.normal(size=(nx, nz))
    source -= source.mean()
    pressure = np.zeros((nx, nz))
    assert Pressure(nx, nz, dx, dz, 500, searched=searched).solve(bx, bz, source, pressure, 1e-10) > 0
    flow_x, flow_z = np.zeros_like(bx), np.zeros_like(bz)
    flow_x[1:-1] = -bx[1:-1] * np.diff(pressure, axis=0) / dx
    flow_z[:, 1:-1] = -bz[:, 1:-1] * np.diff(pressure, axis=1) / dz
    given_back = np.diff(flow_x, axis=0) / dx + np.diff(flow_z, axis=1) / dz
    assert given_back == pytest.approx(source, abs=1e-7)
