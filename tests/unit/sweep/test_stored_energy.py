"""Stored work of a mass on a spring, Re F/ü = m − k/Ω²."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.sweep.stored_energy import Changes, stored_work

MASS, SPRING = 0.7, 900.0


def changes_of(elastic, kinetic=0.0, chirp=0.0):
    return Changes(
        *(np.broadcast_to(np.asarray(energy, float), np.shape(elastic)) for energy in (elastic, kinetic, chirp))
    )


@pytest.mark.parametrize("direction", [1, -1])
def test_change_of_elastic_energy(direction):
    omega = 2 * np.pi * np.geomspace(5, 20, 101)[::direction]
    change = np.gradient((15.0 / omega**2) ** 2)
    stored = stored_work(omega, MASS - SPRING / omega**2, changes_of(change))
    np.testing.assert_allclose(stored.in_loop, 0.5 * SPRING * change, rtol=1e-9)
    np.testing.assert_allclose(stored.in_phasors, stored.in_loop, rtol=1e-12)


def test_chirp_counts_in_the_phasors_only():
    omega = np.linspace(30.0, 120.0, 40)
    stored = stored_work(omega, np.full(40, MASS), changes_of(np.zeros(40), chirp=0.02))
    np.testing.assert_allclose(stored.in_loop, 0.0, atol=1e-12)
    np.testing.assert_allclose(stored.in_phasors, -0.25 * MASS * 0.02, rtol=1e-9)


@pytest.mark.parametrize("omega", [np.full(20, 50.0), np.r_[50.0:60.0, 60.0:50.0:-1], np.array([50.0])])
def test_where_the_frequency_stands_or_turns_no_spring_is_claimed(omega):
    stored = stored_work(omega, MASS - SPRING / omega**2, changes_of(np.full(omega.size, -1e-6)))
    at = [0] if omega.size == 1 else list(range(20)) if np.ptp(omega) == 0 else [9, 10]
    np.testing.assert_array_equal(stored.in_loop[at], 0.0)
