"""Modes and sensors of a rig: what is stated, what is taken where nothing is, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.virtual_laboratory.cantilever import fitted_to
from sloshlab.errors import AnalysisError, RigError
from sloshlab.modal.rig_modes import rig_modal_filter, sensor_places_m, stated_modes, uniform_beam
from sloshlab.rig import Rig

TANK = "tank = {height_m = 0.0272, length_m = 0.1172, width_m = 0.0780, dry_mass_kg = 0.314}\n"
LIQUID = "liquid = {density_kg_per_m3 = 1000.0, fill_level = 0.5}\n"
BEAM = """
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.10
thickness_m = 0.01
frequencies_hz = [10.87, 78.31, 226.5]
damping_ratios = [0.0032, 0.0090, 0.0176]
modal_masses_kg = [0.8956, 1.0692, 0.9655]
tip_mode_shape = [1.0, -0.5, 2.0]
"""
GUIDE = """
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
"""
PLACES_M = {"acceleration_beam_1": 0.185, "acceleration_beam_2": 0.37, "acceleration_tip": 0.74}


def rig(structure: str) -> Rig:
    return Rig.from_toml_text(TANK + LIQUID + structure)


def test_shapes_are_scaled_to_the_tip_values_and_are_those_of_an_independent_beam() -> None:
    found = rig_modal_filter(rig(BEAM), PLACES_M)
    beam = fitted_to(10.87, 0.74, 0.10, 0.01)
    expected = np.stack([beam.shape(n + 1, list(PLACES_M.values())) for n in range(3)], axis=1) * [1.0, -0.5, 2.0]
    # both take the tip mass from the first frequency; the other beam rounds its modulus
    assert found.mode_shapes == pytest.approx(expected, rel=0.02, abs=0.005)
    assert found.mode_shapes[-1] == pytest.approx([1.0, -0.5, 2.0])


def test_the_scale_of_the_tip_values_does_not_change_what_the_sensors_see() -> None:
    plain = rig_modal_filter(rig(BEAM.replace("[1.0, -0.5, 2.0]", "[1.0, 1.0, 1.0]")), PLACES_M)
    scaled = rig_modal_filter(rig(BEAM), PLACES_M)
    assert scaled.visibility == pytest.approx(plain.visibility)
    assert scaled.condition_number == pytest.approx(plain.condition_number)
    # the first mode is largest at its tip
    assert rig_modal_filter(rig(BEAM), {"acceleration_tip": 0.74}, n_modes=1).visibility == pytest.approx(1.0)


def test_modes_kept_are_the_first() -> None:
    assert stated_modes(rig(BEAM), 2).names == ("mode 1", "mode 2")
    assert rig_modal_filter(rig(BEAM), {"acceleration_tip": 0.74}, n_modes=1).weights == pytest.approx(1.0)
    with pytest.raises(AnalysisError, match="1 … 3"):
        stated_modes(rig(BEAM), 4)


def test_a_guide_has_one_mode_with_the_liquid_frozen() -> None:
    """√(K/(m_s + m_l)): m_l = 1000 · ½ · 0.0272 · 0.1172 · 0.078 = 0.12433 kg."""
    modes = stated_modes(rig(GUIDE))
    assert modes.names == ("guide",)
    assert modes.frequency_hz[0] == pytest.approx(np.sqrt(3808.8 / (2.061 + 0.124326)) / (2 * np.pi), rel=1e-5)
    damped = stated_modes(rig(GUIDE + "damping_kg_per_s = 1.58\n"))
    # b₁/(2 √(K m)) = 1.58/(2 · 91.23 kg/s)
    assert damped.damping_ratio[0] == pytest.approx(0.00866, rel=1e-3)


def test_a_guide_has_no_second_mode() -> None:
    assert stated_modes(rig(GUIDE), 1).names == ("guide",)
    with pytest.raises(AnalysisError, match="number of modes: got 2; allowed: 1 on a guide"):
        stated_modes(rig(GUIDE), 2)


def test_places_not_stated_are_tip_and_root() -> None:
    stated = {
        "acceleration_tip": None,
        "acceleration_roof_1": None,
        "acceleration_root": None,
        "acceleration_x": 0.2,
    }
    assert list(sensor_places_m(stated, 0.74).values()) == [0.74, 0.74, 0.0, 0.2]


@pytest.mark.parametrize(
    ("stated", "match"),
    [({"acceleration_beam_1": None}, "acceleration_beam_1: got no attribute x_m"), ({"a": 0.8}, "x_m = 0.8")],
)
def test_places_that_are_not_on_the_beam_are_refused(stated: dict[str, float | None], match: str) -> None:
    with pytest.raises(AnalysisError, match=match):
        sensor_places_m(stated, 0.74)


def test_a_sensor_at_every_node_of_a_mode_is_refused_with_its_name() -> None:
    """Mode 2 of this beam has its node where its shape changes sign, about 0.9 of the length."""
    x = np.linspace(0.5, 0.74, 2001)
    shape = fitted_to(10.87, 0.74, 0.10, 0.01).shape(2, x)
    node = float(x[np.flatnonzero(np.diff(np.sign(shape)))[0]])
    with pytest.raises(AnalysisError, match="cannot see mode 1 and mode 2"):
        rig_modal_filter(rig(BEAM), {"acceleration_a": node, "acceleration_b": node}, n_modes=2)


@pytest.mark.parametrize(
    ("structure", "match"),
    [
        ("", r"rig: structure: got nothing"),
        (GUIDE, "a beam with its dimensions"),
        (BEAM.replace("width_m = 0.10\n", ""), "no length_m, width_m or thickness_m"),
    ],
)
def test_rigs_without_a_complete_beam_are_refused(structure: str, match: str) -> None:
    with pytest.raises(RigError, match=match):
        uniform_beam(rig(structure))
