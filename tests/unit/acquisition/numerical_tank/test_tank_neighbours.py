"""Neighbour lists and mirror images against brute force over all particles."""

import numpy as np
import pytest

from acquisition.numerical_tank.equations import measure_pairs, rate_of_density
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Numerics, filled_tank
from acquisition.numerical_tank.walls import exchange_with_images, mirror_velocity

LENGTH, HEIGHT = 0.06, 0.03


@pytest.fixture(scope="module")
def tank() -> NumericalTank:
    return NumericalTank(filled_tank(Box(LENGTH, HEIGHT), 0.7, 16, numerics=Numerics(jitter=0.2), seed=5))


def mirrored(x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All eight reflections of the liquid, whether near a wall or not."""
    places = []
    for xs in (x, -x, 2 * LENGTH - x):
        for zs in (z, -z, 2 * HEIGHT - z):
            places.append((xs, zs))
    return np.concatenate([p[0] for p in places[1:]]), np.concatenate([p[1] for p in places[1:]])


def test_pairs_in_reach_are_all_pairs_in_reach(tank: NumericalTank) -> None:
    state, n = tank.state(), tank.setup.n_particles
    reach = 2 * tank.setup.smoothing_length_m
    measure_pairs(tank._particles, tank._pairs, tank._constants)
    distance = np.hypot(state.x_m[:, None] - state.x_m, state.z_m[:, None] - state.z_m)
    gx, gz = mirrored(state.x_m, state.z_m)
    to_images = np.hypot(state.x_m[:, None] - gx, state.z_m[:, None] - gz)
    starts, middles = tank._pairs.near_start, tank._pairs.near_middle
    assert (middles - starts[:n]).sum() == (distance[np.triu_indices(n, 1)] < reach).sum()
    assert (starts[1:] - middles).sum() == (to_images < reach).sum()


def test_rate_of_density_is_the_sum_over_all_particles_and_reflections(tank: NumericalTank) -> None:
    """v = (x, −2z)-like field, mirrored by hand; the sum is written with a numerical derivative of the kernel."""
    state, n, h = tank.state(), tank.setup.n_particles, tank.setup.smoothing_length_m
    vx, vz = np.sin(40 * state.x_m), np.cos(90 * state.z_m)
    tank.set_velocity(vx, vz)
    particles, images = tank._particles, tank._images
    mirror_velocity(particles, images, n)
    measure_pairs(particles, tank._pairs, tank._constants)
    rate_of_density(particles, tank._pairs, tank._constants)
    expected = np.zeros(n)
    for sx, x0 in ((1, 0.0), (-1, 0.0), (-1, 2 * LENGTH)):
        for sz, z0 in ((1, 0.0), (-1, 0.0), (-1, 2 * HEIGHT)):
            rx = state.x_m[:, None] - (x0 + sx * state.x_m)
            rz = state.z_m[:, None] - (z0 + sz * state.z_m)
            q = np.hypot(rx, rz) / h
            factor = np.where(q < 2, -35 / (4 * np.pi * h**4) * (1 - q / 2) ** 3, 0.0)
            closing = (vx[:, None] - sx * vx) * rx + (vz[:, None] - sz * vz) * rz
            expected += tank.setup.particle_volume_m2 * (factor * closing).sum(axis=1)
    assert np.allclose(particles.ds[:n], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_particle_that_crosses_changes_places_with_its_image() -> None:
    tank = NumericalTank(filled_tank(Box(LENGTH, HEIGHT), 0.7, 16))
    particles = tank._particles
    particles.x[0], particles.vx[0] = -0.001, -0.3
    particles.z[1], particles.vz[1] = HEIGHT + 0.002, 0.5
    impulse_x, impulse_z, count = exchange_with_images(particles, tank._constants)
    assert (particles.x[0], particles.vx[0]) == (0.001, 0.3)
    assert particles.z[1] == pytest.approx(HEIGHT - 0.002)
    assert particles.vz[1] == -0.5
    assert (impulse_x, impulse_z, count) == pytest.approx((0.6, -1.0, 2))
