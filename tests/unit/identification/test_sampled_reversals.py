"""Samples beside reversals of dry friction, by the closed form of a decay with friction alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sloshlab.identification.sampled_reversals import averaged_where_friction_turns
from sloshlab.twin.excitation import Excitation, free, harmonic
from sloshlab.twin.simulated_channels import rows_of
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.structure_forces import COULOMB_FRICTION, VISCOUS_DAMPING
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
MASS_KG, OMEGA = 2.0, 2 * np.pi * 5.0
START_M, HELD_M = 0.02, 0.0018
"""Deflection at the release, and that which friction can hold."""
JUMP_M_PER_S2 = 2 * OMEGA**2 * HELD_M
RATE_HZ = 797.0
N_HALF_CYCLES = 6
"""Until |START − 2 n HELD| < HELD."""
FRICTION = COULOMB_FRICTION(force_n=MASS_KG * OMEGA**2 * HELD_M)


def decay() -> Simulation:
    twin = Twin(single_degree_of_freedom(MASS_KG, MASS_KG * OMEGA**2), (FRICTION,))
    return twin.simulate(free(1.0, RATE_HZ), initial_displacement_m=START_M, n_substeps=8)


def velocity(time_s: FloatArray) -> FloatArray:
    """x = ±HELD + (START − (2 n + 1) HELD) cos ωt in half cycle n; at rest in the end."""
    n = np.floor(OMEGA * time_s / np.pi)
    moving = -OMEGA * (START_M - (2 * n + 1) * HELD_M) * np.sin(OMEGA * time_s)
    return np.where(n < N_HALF_CYCLES, moving, 0.0)


def acceleration_row(motion: Simulation) -> FloatArray:
    n_modes = motion.modes.shape[2]
    return averaged_where_friction_turns(rows_of(motion), motion)[2 * n_modes]


def test_the_closed_form_is_that_of_the_twin() -> None:
    motion = decay()
    np.testing.assert_allclose(motion.velocity_m_per_s, velocity(motion.time_s), atol=1e-5)
    assert motion.velocity_m_per_s[-1] == pytest.approx(0.0, abs=1e-12)


def test_samples_beside_reversals_and_the_stop_are_means_of_their_intervals() -> None:
    motion, h = decay(), 1 / RATE_HZ
    reversals = np.arange(1, N_HALF_CYCLES + 1) * np.pi / OMEGA
    near = np.array([np.argmin(np.abs(motion.time_s - t)) for t in reversals])
    middle = motion.time_s[near]
    mean = (velocity(middle + h / 2) - velocity(middle - h / 2)) / h
    read, at_instants = acceleration_row(motion), motion.acceleration_m_per_s2
    # an interval bends by (ωh)²/24 of the acceleration
    np.testing.assert_allclose(read[near], mean, atol=0.01 * JUMP_M_PER_S2)
    assert np.abs(at_instants[near] - mean).max() > 0.2 * JUMP_M_PER_S2
    others = np.setdiff1d(np.arange(motion.time_s.size), near)
    np.testing.assert_array_equal(read[others], at_instants[others])


@pytest.mark.parametrize(
    ("base", "share", "n_left"),
    [(free(1.0, RATE_HZ), 0.05, 0), (harmonic(8e-4, 31.0, 1.0, RATE_HZ), 0.2, 2)],
    ids=["free", "shaken"],
)
def test_readings_follow_parameters_without_jumps(base: Excitation, share: float, n_left: int) -> None:
    """Reversals move past samples as the stiffness changes; a base makes the force steep where they are.

    A place that turns back within a sample jumps on both sides of it.
    """

    def motion(stiffness: float) -> Simulation:
        twin = Twin(single_degree_of_freedom(MASS_KG, stiffness), (FRICTION,))
        return twin.simulate(base, initial_displacement_m=START_M, n_substeps=8)

    motions = [motion(MASS_KG * OMEGA**2 * ratio) for ratio in np.linspace(1.0, 1.02, 400)]
    moved = np.abs(np.diff([acceleration_row(motion) for motion in motions], axis=0))
    at_instants = np.abs(np.diff([motion.modes[:, 2, 0] for motion in motions], axis=0))
    assert np.count_nonzero(at_instants > share * JUMP_M_PER_S2) >= 10
    assert np.count_nonzero(moved > share * JUMP_M_PER_S2) <= n_left


def test_a_force_on_the_tank_jumps_in_its_own_row() -> None:
    """On a shaker the friction of a tank turns with the prescribed velocity."""
    twin = Twin(None, (COULOMB_FRICTION(place="tank", force_n=3.0),), carried_mass_kg=1.0)
    motion = twin.simulate(harmonic(0.01, 5.0, 1.0, 200.0))
    averaged = averaged_where_friction_turns(rows_of(motion), motion)[3]
    turning = np.flatnonzero(averaged != motion.tank_force_n)
    assert turning.size > 0
    assert np.abs(averaged[turning]).max() < 3.0
    np.testing.assert_array_equal(averaged_where_friction_turns(rows_of(motion), motion)[2], rows_of(motion)[2])


def test_rows_of_a_motion_without_dry_friction_are_its_own() -> None:
    twin = Twin(single_degree_of_freedom(MASS_KG, 2e3), (VISCOUS_DAMPING(damping_n_s_per_m=3.0),))
    motion = twin.simulate(free(0.2, RATE_HZ), initial_displacement_m=START_M)
    for averaged, row in zip(averaged_where_friction_turns(rows_of(motion), motion), rows_of(motion), strict=True):
        assert averaged.tobytes() == row.tobytes()
