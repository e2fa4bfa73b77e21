"""A beam wing against closed forms of uniform beams."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from small_wings import small_wing

from sloshlab.aircraft.beam_wing import damping_ratios, wing_matrices, wing_model, wing_structure
from sloshlab.aircraft.wing_file import load_wing
from sloshlab.errors import InputError

SINGLE_AISLE = Path(__file__).resolve().parents[3] / "raw_data" / "aircraft" / "single_aisle" / "wing.toml"
UNIFORM = {"stiffness_power": 0.0, "n_elements": 30, "n_modes": 8, "pitch_radius_of_gyration": 0.05}


def omega(structure: object) -> np.ndarray:
    return np.asarray(2 * np.pi * structure.frequencies_hz)  # type: ignore[attr-defined]


def test_a_uniform_wing_has_the_modes_of_a_cantilever() -> None:
    structure = wing_structure(small_wing(wing=UNIFORM))
    bending = 1.8751040687**2 * np.sqrt(2e6 / (40.0 * 10.0**4))
    # a section 0.1 m in radius of gyration twists as a bar with GJ over m r²
    torsion = np.pi / 2 * np.sqrt(0.7 * 2e6 / (40.0 * (0.05 * 2.0) ** 2)) / 10.0
    found = omega(structure)
    assert found[0] == pytest.approx(bending, rel=1e-4)
    # yaw of the sections lowers the mode in the plane by (r/L)² or so
    assert np.abs(found / (np.sqrt(6) * bending) - 1).min() < 1e-3
    second = 4.6940911330**2 / 1.8751040687**2 * bending
    assert np.abs(found / second - 1).min() < 1e-4
    everything = omega(wing_structure(small_wing(wing={**UNIFORM, "n_modes": 20})))
    assert np.abs(everything / torsion - 1).min() < 5e-4


def test_a_swept_wing_is_a_longer_beam() -> None:
    sweep = 35.0
    swept = wing_structure(
        small_wing(wing={**UNIFORM, "leading_edge_sweep_deg": sweep, "torsion_over_bending": 1e3})
    )
    cosine = np.cos(np.radians(sweep))
    # the same mass on a length L/cos Λ
    expected = 1.8751040687**2 * np.sqrt(2e6 / (40.0 * cosine)) * cosine**2 / 10.0**2
    assert omega(swept)[0] == pytest.approx(expected, rel=2e-3)


def test_mass_and_centre_are_those_of_the_sections_and_the_engine() -> None:
    described = small_wing(
        wing={"tip_mass_kg_per_m": 10.0, "leading_edge_sweep_deg": 20.0, "mass_centre_behind_axis": 0.1},
        engine={"y_m": 3.3, "ahead_m": 0.5, "mass_kg": 100.0, "pitch_inertia_kg_m2": 20.0},
    )
    structure = wing_structure(described)
    y = np.linspace(0.0, 10.0, 20001)
    mass, x = 40.0 - 3.0 * y, y * np.tan(np.radians(20.0)) + (0.4 + 0.1) * 2.0
    total = np.trapezoid(mass, y) + 100.0
    engine_x = 3.3 * np.tan(np.radians(20.0)) + 0.8 - 0.5
    assert structure.rigid_mass[0, 0] == pytest.approx(total)
    assert structure.mass_centre_m[0] == pytest.approx(
        (np.trapezoid(mass * x, y) + 100 * engine_x) / total, rel=1e-6
    )
    assert structure.mass_centre_m[1] == pytest.approx((np.trapezoid(mass * y, y) + 330.0) / total, rel=1e-6)


def test_rigid_motion_costs_no_strain() -> None:
    described = small_wing(wing={"leading_edge_sweep_deg": 25.0})
    _, stiffness = wing_matrices(described.wing)
    from sloshlab.aircraft.beam_wing import axis_places_m, span_nodes_m
    from sloshlab.lateral_sloshing.coupling import rigid_motion

    places = axis_places_m(described.wing, span_nodes_m(described.wing))
    rigid = np.vstack([rigid_motion(place) for place in places])
    assert np.abs(stiffness @ rigid).max() < 1e-8 * np.abs(stiffness).max()


def test_a_tank_moves_as_the_nodes_beside_it() -> None:
    model = wing_model(small_wing())
    y = model.structure.places_m[:, 1]
    for tank in model.tanks:
        expected = [np.interp(tank.place_m[1], y, model.structure.shapes[mode, :, 2]) for mode in range(4)]
        assert tank.motion[2] == pytest.approx(np.array(expected))


def test_only_modes_above_the_identification_are_damped() -> None:
    described = small_wing(wing={"extra_damping_ratio": 0.05, "extra_damping_above": 6.72})
    # h₁ = 0.3 m: 6.72 √(g/h₁) = 38.4 rad/s = 6.12 Hz
    assert damping_ratios(described, np.array([6.1, 6.13])).tolist() == [0.0, 0.05]


def test_the_wing_of_the_project_weighs_what_its_file_says() -> None:
    described = load_wing(SINGLE_AISLE)
    model = wing_model(described)
    assert model.structure.rigid_mass[0, 0] == pytest.approx(16.5 * (330 + 60) / 2 + 2400)
    assert model.liquid_mass_kg == pytest.approx(4647, abs=1)
    assert model.structure.n_modes == 12


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tanks": [{"name": "a", "y_m": 4.0, "length_m": 4, "width_m": 4, "height_m": 1.0}]}, "liquid of tank a"),
        ({"tanks": [{"name": "a", "y_m": 11.0, "length_m": 1, "width_m": 1, "height_m": 0.1}]}, None),
        ({"wing": {"n_modes": 40, "n_elements": 4}}, "n_modes"),
    ],
)
def test_impossible_wings_are_refused(changes: dict[str, object], message: str | None) -> None:
    if message is None:
        with pytest.raises(ValueError, match="beyond the tip"):
            small_wing(**changes)
        return
    with pytest.raises(InputError, match=message):
        wing_model(small_wing(**changes))


def test_a_file_with_an_unknown_key_is_refused_by_its_place(tmp_path: Path) -> None:
    text = SINGLE_AISLE.read_text().replace("elastic_axis = 0.40", "elastic_axes = 0.40")
    (tmp_path / "wing.toml").write_text(text)
    with pytest.raises(InputError, match=r"wing\.elastic_ax"):
        load_wing(tmp_path / "wing.toml")


def test_the_file_of_the_project_is_the_one_of_its_manifest() -> None:
    manifest = json.loads((SINGLE_AISLE.parent / "manifest.json").read_text())
    for name, told in manifest["files"].items():
        content = (SINGLE_AISLE.parent / name).read_bytes()
        assert len(content) == told["bytes"]
        assert hashlib.sha256(content).hexdigest() == told["sha256"]
