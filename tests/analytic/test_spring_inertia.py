"""Force at the still end of a heavy spring: a chain of elements, and the closed form of an elastic rod."""

import numpy as np
import pytest
import xarray as xr

from sloshlab.conditioning.spring_inertia import at_the_tank
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

SPRING_KG, STIFFNESS = 0.84, 3808.8
RIG = """
[tank]
height_m = 0.06
length_m = 0.10
width_m = 0.06
dry_mass_kg = 2.061
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
"""


def recording(force, acceleration, **more):
    channels = {
        "force_interface": (force, "N", "force"),
        "acceleration_tip": (acceleration, "m s-2", "acceleration"),
    }
    channels |= {name: (values, "N", "force") for name, values in more.items()}
    variables = {
        name: ("time", values, {"units": units, "quantity": quantity})
        for name, (values, units, quantity) in channels.items()
    }
    return xr.Dataset(variables, coords={"time": np.arange(force.size) / 800.0})


def rig(spring_mass_kg=SPRING_KG):
    return Rig.from_toml_text(RIG + (f"spring_mass_kg = {spring_mass_kg}\n" if spring_mass_kg else ""))


def chain_forces(omega, n=400):
    """Forces of a chain of lumped masses and springs on its wall and on its moving end, for u = 1 there."""
    k, m = n * STIFFNESS, SPRING_KG / n
    # (−m ω² + 2k) x_i − k x_{i−1} − k x_{i+1} = 0, x_0 = 0, x_n = 1
    matrix = np.diag(np.full(n - 1, 2 * k - m * omega**2)) - k * (np.eye(n - 1, k=1) + np.eye(n - 1, k=-1))
    right = np.zeros(n - 1)
    right[-1] = k
    x = np.linalg.solve(matrix, right)
    # half of a lump at either end
    return k * x[0], k * (1 - x[-1]) - m / 2 * omega**2


def test_correction_is_that_of_a_chain_of_masses_and_springs():
    """At the frequency of the guided tank what the correction leaves is the next term of the series."""
    omega = 2 * np.pi * 6.56
    at_wall, at_end = chain_forces(omega)
    # the rod: K θ/sin θ and K θ/tan θ with θ = ω √(m/K)
    theta = omega * np.sqrt(SPRING_KG / STIFFNESS)
    assert at_wall == pytest.approx(STIFFNESS * theta / np.sin(theta), rel=1e-4)
    assert at_end == pytest.approx(STIFFNESS * theta / np.tan(theta), rel=1e-4)
    time = np.arange(1600) / 800.0
    displacement = 1e-3 * np.cos(omega * time)
    cells = recording(-at_wall * displacement, -(omega**2) * displacement)
    corrected = at_the_tank(cells, rig())["force_interface"].values
    truth = -at_end * displacement
    before, after = (np.abs(values - truth).max() for values in (cells["force_interface"].values, corrected))
    assert before == pytest.approx(SPRING_KG / 2 * omega**2 * 1e-3, rel=0.1)
    # next term of the series of θ (1/sin θ − 1/tan θ) = θ²/2 + θ⁴/24 + …
    assert after == pytest.approx(STIFFNESS * theta**4 / 24 * 1e-3, rel=0.1)
    assert after < 0.04 * before


def test_two_cells_share_the_correction_and_the_rest_stays():
    time = np.arange(100) / 800.0
    acceleration = np.sin(9 * time)
    cells = recording(np.zeros(100), acceleration, force_other=np.ones(100))
    corrected = at_the_tank(cells, rig())
    total = corrected["force_interface"].values + corrected["force_other"].values
    assert total == pytest.approx(1 - 0.42 * acceleration)
    assert (corrected["acceleration_tip"].values == acceleration).all()
    assert (cells["force_interface"].values == 0).all()


def test_without_springs_or_forces_nothing_changes():
    cells = recording(np.zeros(10), np.ones(10))
    assert at_the_tank(cells, rig(None)) is cells
    no_force = cells.drop_vars("force_interface")
    assert at_the_tank(no_force, rig()) is no_force
    with pytest.raises(AnalysisError, match="acceleration of the tank"):
        at_the_tank(cells.drop_vars("acceleration_tip"), rig())
