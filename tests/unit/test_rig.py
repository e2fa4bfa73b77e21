"""The rig: its scales in closed form, and what is impossible."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from sloshlab.errors import RigError
from sloshlab.rig import Rig

TANK = "[tank]\nheight_m = 0.0272\nlength_m = 0.1172\nwidth_m = 0.0780\ndry_mass_kg = 0.61\n"
LIQUID = "[liquid]\ndensity_kg_per_m3 = 1000.0\nfill_level = 0.5\n"
BEAM = (
    '[structure]\nkind = "beam"\nlength_m = 0.74\n'
    "frequencies_hz = [10.87, 78.31]\ndamping_ratios = [0.0032, 0.009]\n"
    "modal_masses_kg = [0.8956, 1.0692]\ntip_mode_shape = [1.0, 1.0]\n"
)


def test_scales_of_the_source():
    """√(g/h) = 18.991 rad/s, √(gh) = 0.5166 m/s, m_l = 0.12433 kg (ch. 1)."""
    rig = Rig.from_toml_text(TANK + LIQUID)
    assert rig.frequency_scale_rad_per_s == pytest.approx(18.991, abs=5e-4)
    assert rig.velocity_scale_m_per_s == pytest.approx(0.5166, abs=5e-5)
    assert rig.liquid_mass_kg == pytest.approx(0.12433, rel=1e-4)
    assert rig.structure is None


def test_what_other_programs_add_is_kept_and_a_rig_cannot_be_changed():
    rig = Rig.from_toml_text(TANK + 'material = "acrylic"\n' + LIQUID + "[novel]\nx = 1\n" + BEAM)
    assert (rig.tank.model_extra or {})["material"] == "acrylic"
    assert (rig.model_extra or {})["novel"] == {"x": 1}
    assert rig.structure is not None
    assert rig.structure.frequencies_hz == (10.87, 78.31)
    with pytest.raises(ValidationError):
        rig.tank.height_m = 1.0


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (TANK, "liquid"),
        (LIQUID, "tank"),
        (TANK.replace("0.0272", "-0.0272") + LIQUID, "tank.height_m"),
        (TANK.replace("0.0272", "0.0") + LIQUID, "tank.height_m"),
        (TANK.replace("0.0272", "'0.0272'") + LIQUID, "tank.height_m"),
        (TANK + LIQUID.replace("1000.0", "inf"), "liquid.density_kg_per_m3"),
        (TANK + LIQUID + "surface_tension_n_per_m = -0.07\n", "liquid.surface_tension_n_per_m"),
        (TANK + LIQUID + BEAM.replace("[0.0032, 0.009]", "[0.0032]"), "structure"),
        (TANK + LIQUID + BEAM.replace('"beam"', '"sdof"'), "structure"),
        (TANK + LIQUID + BEAM.replace('"beam"', '"plate"'), "structure.kind"),
        (TANK + LIQUID + '[twin]\ntank_model = "magic"\n', "twin.tank_model"),
    ],
)
def test_impossible_rigs_name_the_place(text, place):
    with pytest.raises(RigError, match=f"rig here: {place}"):
        Rig.from_toml_text(text, name="here")
