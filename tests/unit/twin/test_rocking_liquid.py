"""Sideways sloshing in a tank that a beam's tip rocks, against the coupled linear system solved exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from sloshlab.errors import RigError
from sloshlab.lateral_sloshing.coupling import coupled_system, frozen_mass_matrix, sloshing_liquid
from sloshlab.rig import Rig
from sloshlab.twin.excitation import free
from sloshlab.twin.rocking_liquid import (
    box_of,
    equivalent_lateral_mass_kg,
    rocking_liquid,
    rotation_at_tip_rad_per_m,
)
from sloshlab.twin.tank_models import tank_terms
from sloshlab.twin.twin import Twin

RIG = """
[tank]
height_m = 0.06
length_m = 0.30
width_m = 0.078
dry_mass_kg = 0.3
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.1
thickness_m = 0.01
frequencies_hz = [2.0]
damping_ratios = [0.002]
modal_masses_kg = [1.6]
tip_mode_shape = [1.0]
[twin]
tank_model = "lateral"
[twin.parameters]
{parameters}
"""


def rig_of(parameters: str) -> Rig:
    return Rig.from_toml_text(RIG.format(parameters=parameters))


def exact_decay(rig: Rig, axis: int, ratio: float, arm: float, times: np.ndarray, start: float) -> np.ndarray:
    """Deflection after a release at rest, of the beam with the sloshing liquid in place of the frozen one."""
    # up by u, about the axis across the beam by c u, and sideways by the arm of the rotation
    motion = np.zeros((6, 1))
    motion[2, 0] = 1.0
    motion[3 + (1 - axis), 0] = ratio if axis == 0 else -ratio
    motion[axis, 0] = arm * ratio
    box = box_of(rig)
    frozen = (motion.T @ frozen_mass_matrix(box) @ motion)[0, 0]
    liquid = sloshing_liquid(box, n_modes=3, damping_ratio=0.01).transferred(motion)
    mass, omega = 1.6, 2 * np.pi * 2.0
    system = coupled_system([[mass - frozen]], [[2 * 0.002 * mass * omega]], [[mass * omega**2]], (liquid,))
    n = system.mass.shape[0]
    lower = -np.linalg.solve(system.mass, np.hstack([system.stiffness, system.damping]))
    matrix = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower])
    state = np.zeros(2 * n)
    state[0] = start
    # the surface is level at the start: waves at rest under the tilt
    state[1:n] = (liquid.gravitational.T @ [start]) / liquid.stiffness_per_s2
    step = expm(matrix * (times[1] - times[0]))
    found = np.empty(times.size)
    for k in range(times.size):
        found[k] = state[0]
        state = step @ state
    return found


@pytest.mark.parametrize(("along", "axis"), [("length", 0), ("width", 1)])
@pytest.mark.parametrize("arm", [0.0, 0.05])
def test_a_release_is_that_of_the_coupled_system(along: str, axis: int, arm: float) -> None:
    rig = rig_of(f'along = "{along}"\ncentre_above_beam_m = {arm}\ndamping_ratio = 0.01\nrotation_rad_per_m = 4.0')
    terms = tank_terms(rig)
    result = Twin.from_rig(rig).simulate(free(4.0, 2000.0), initial_displacement_m=0.01).require_done()
    expected = exact_decay(rig, axis, 4.0, arm, result.time_s, 0.01)
    without = Twin.from_rig(rig_of("n_modes = 1\nrotation_rad_per_m = 0.0"))
    plain = without.simulate(free(4.0, 2000.0), initial_displacement_m=0.01).require_done()
    assert len(terms) == 3
    assert np.abs(result.displacement_m - expected).max() < 1e-7
    # the liquid matters by far more than that
    assert np.abs(plain.displacement_m - expected).max() > 1e-4


def test_rotation_of_the_tip_is_that_of_a_light_beam_with_a_heavy_tip() -> None:
    """3/(2l) where the tip's mass is all, within the beam's share."""
    ratio = rotation_at_tip_rad_per_m(rig_of(""))
    assert ratio == pytest.approx(3 / (2 * 0.74), rel=0.02)


def test_near_its_frequency_it_is_a_lateral_mode_of_the_equivalent_mass() -> None:
    """Residue of the pole of the force per displacement: −m ω³/2 j for both."""
    [term] = rocking_liquid(rig_of(""), n_modes=1, rotation_rad_per_m=4.0)
    values = term.values
    omega, h, m = 2 * np.pi * values["frequency_hz"], values["height_m"], values["mass_kg"]
    near = omega * (1 + 1e-6)
    # from the model's B and C: c² m (s²(−h) + g)²/(s² + ω²)
    rocking = 16.0 * m * (near**2 * h + 9.81) ** 2 / (omega**2 - near**2)
    lateral = equivalent_lateral_mass_kg(term) * omega**4 / (omega**2 - near**2)
    assert lateral == pytest.approx(rocking, rel=1e-5)


def test_a_tank_in_a_guide_does_not_rock() -> None:
    guide = RIG.split("[structure]")[0] + '[structure]\nkind = "sdof"\nmass_kg = 1.0\nstiffness_n_per_m = 100.0\n'
    with pytest.raises(RigError, match="rig: structure: got no beam"):
        tank_terms(Rig.from_toml_text(guide + '[twin]\ntank_model = "lateral"\n'))
    with pytest.raises(RigError, match="lateral: along: got 'height'"):
        tank_terms(rig_of('along = "height"'))
    with pytest.raises(RigError, match="unexpected keyword"):
        tank_terms(rig_of("depth_m = 1.0"))
