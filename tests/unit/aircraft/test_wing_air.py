"""Air on the nodes of a wing, carried to its modes; and calibration by similarity."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from small_wings import small_wing

from sloshlab.aeroelastic.beam_spline import mirrored_beam_motion
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces, generalised_forces
from sloshlab.aeroelastic.root_locus import first_flutter
from sloshlab.aircraft.beam_wing import wing_boxes, wing_model
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.wing_air import air_on_modes, air_on_nodes
from sloshlab.aircraft.wing_calibration import calibrated, wing_state
from sloshlab.aircraft.wing_file import CalibrationTargets

pytestmark = pytest.mark.skipif(find_spec("panelaero") is None, reason="needs PanelAero")
AROUND_M_PER_S = 70.0
DESCRIBED = small_wing(
    # damping in all modes, or the one in the plane, which no air damps, would flutter first
    wing={
        "leading_edge_sweep_deg": 15.0,
        "mass_centre_behind_axis": 0.12,
        "torsion_over_bending": 0.3,
        "n_modes": 5,
        "extra_damping_ratio": 0.01,
        "extra_damping_above": 0.0,
    },
)


@pytest.fixture(scope="module")
def nodes() -> GeneralisedForces:
    return air_on_nodes(DESCRIBED, 0.3)[0]


def test_air_of_modes_is_that_of_their_motion(nodes: GeneralisedForces) -> None:
    structure = wing_model(DESCRIBED).structure
    air = air_on_modes(nodes, structure, DESCRIBED.aerodynamics)
    boxes = wing_boxes(DESCRIBED)
    motion = mirrored_beam_motion(boxes, structure.places_m, structure.shapes.transpose(1, 2, 0))
    direct = generalised_forces(boxes, motion, nodes.reduced_frequency, semi_chord_m=1.0, mach=0.3)
    size = np.abs(direct.motion).max()
    np.testing.assert_allclose(air.table.motion, direct.motion, atol=1e-9 * size)
    np.testing.assert_allclose(air.table.gust, direct.gust, atol=1e-9 * np.abs(direct.gust).max())
    np.testing.assert_allclose(air.table.travelling_gust, direct.travelling_gust, atol=1e-9 * size)


def test_flutter_by_eigenvalues_is_that_of_the_branches(nodes: GeneralisedForces) -> None:
    state = wing_state(DESCRIBED, nodes, AROUND_M_PER_S)
    assert state.flutter is not None
    system = flight_system(state.model, state.air.motion, "frozen", density_kg_per_m3=1.0)
    speeds = np.linspace(10.0, 105.0, 42)
    found = first_flutter(system.matrix_at, speeds)
    first = state.earlier or state.flutter
    assert found is not None
    assert found.speed_m_per_s == pytest.approx(first.speed_m_per_s, abs=2e-3)
    assert found.frequency_rad_per_s == pytest.approx(first.frequency_rad_per_s, rel=1e-4)
    assert first_flutter(system.matrix_at, np.array([10.0, 0.9 * found.speed_m_per_s])) is None
    assert first_flutter(system.matrix_at, np.array([1.01, 1.1]) * found.speed_m_per_s) is None


def test_speed_goes_with_the_root_of_the_stiffness(nodes: GeneralisedForces) -> None:
    states = []
    for factor in (1.0, 1.21):
        wing = DESCRIBED.wing.model_copy(update={"root_bending_stiffness_n_m2": factor * 2e6})
        states.append(wing_state(DESCRIBED.model_copy(update={"wing": wing}), nodes, AROUND_M_PER_S))
    first, second = (state.flutter for state in states)
    assert first is not None
    assert second is not None
    assert second.speed_m_per_s == pytest.approx(1.1 * first.speed_m_per_s, rel=1e-5)
    assert states[1].frequency_ratio == pytest.approx(states[0].frequency_ratio, rel=1e-5)


def test_calibration_meets_targets_that_another_wing_has(nodes: GeneralisedForces) -> None:
    wanted = wing_state(DESCRIBED, nodes, AROUND_M_PER_S)
    assert wanted.flutter is not None
    targets = CalibrationTargets(
        flutter_speed_m_per_s=wanted.flutter.speed_m_per_s, frequency_ratio=wanted.frequency_ratio
    )
    wing = DESCRIBED.wing.model_copy(update={"root_bending_stiffness_n_m2": 1.3e6, "torsion_over_bending": 0.4})
    found = calibrated(DESCRIBED.model_copy(update={"wing": wing}), nodes, targets)
    assert found.misses(targets) == []
    assert found.described.wing.root_bending_stiffness_n_m2 == pytest.approx(2e6, rel=0.02)
    assert found.described.wing.torsion_over_bending == pytest.approx(0.3, rel=0.02)
    far = CalibrationTargets(flutter_speed_m_per_s=wanted.flutter.speed_m_per_s + 1, frequency_ratio=9.0)
    assert len(wanted.misses(far)) == 2
