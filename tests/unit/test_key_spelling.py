"""Slips in the keys of a rig are named; what other programs add is kept."""

from __future__ import annotations

import pytest

from sloshlab.errors import RigError
from sloshlab.rig import Rig

TANK = "[tank]\nheight_m = 0.0272\nlength_m = 0.1172\nwidth_m = 0.0780\ndry_mass_kg = 0.61\n"
LIQUID = (
    '[liquid]\nname = "water"\ndensity_kg_per_m3 = 1000.0\nsurface_tension_n_per_m = 0.0728\n'
    "kinematic_viscosity_m2_per_s = 1.0e-6\nfill_level = 0.5\n"
)
BEAM = (
    '[structure]\nkind = "beam"\nlength_m = 0.74\nwidth_m = 0.1\nthickness_m = 0.01\n'
    "frequencies_hz = [10.87, 78.31]\ndamping_ratios = [0.0032, 0.009]\n"
    "modal_masses_kg = [0.8956, 1.0692]\ntip_mode_shape = [1.0, 1.0]\n"
)
GUIDE = (
    '[structure]\nkind = "sdof"\nmass_kg = 2.061\nstiffness_n_per_m = 3808.8\n'
    "coulomb_force_n = 0.37\ndamping_kg_per_s = 1.58\n"
)
TWIN = '[twin]\ntank_model = "viscous"\nparameters = {damping_kg_per_s = 3.4}\n'
KNOWN = [
    line.partition(" = ")[0]
    for part in (TANK, LIQUID, BEAM, GUIDE, TWIN)
    for line in part.splitlines()
    if " = " in line and not line.startswith("name")
]


def rig_of(*parts: str) -> Rig:
    return Rig.from_toml_text("".join(parts), name="here")


def slips_of(key: str) -> list[str]:
    """One letter missing, two exchanged, one doubled; a capital."""
    k = len(key) // 2
    exchanged = key[: k - 1] + key[k] + key[k - 1] + key[k + 1 :]
    slips = [key[:k] + key[k + 1 :], exchanged, key[:k] + key[k] + key[k:], key.capitalize()]
    return [slip for slip in slips if slip != key]


@pytest.mark.parametrize("key", dict.fromkeys(KNOWN))
@pytest.mark.parametrize("structure", [BEAM, GUIDE])
def test_every_slip_in_a_known_key_is_named(key: str, structure: str) -> None:
    text = TANK + LIQUID + structure + TWIN
    if f"\n{key} = " not in text:
        return
    for slip in slips_of(key):
        # a slip within the units may read as other units
        remedy = f"(did you mean '{key}'|this file takes .*: {key}$)"
        with pytest.raises(RigError, match=rf"{slip}: got an unknown key, and nothing for .*{remedy}"):
            rig_of(text.replace(f"\n{key} = ", f"\n{slip} = "))


@pytest.mark.parametrize("table", ["tank", "liquid", "structure", "twin"])
def test_slips_in_the_names_of_tables_are_named(table: str) -> None:
    text = TANK + LIQUID + BEAM + TWIN
    for slip in (table[:-1], table.capitalize(), table + "s"):
        with pytest.raises(RigError, match=f"here: {slip}: got an unknown key.*did you mean '{table}'"):
            rig_of(text.replace(f"[{table}]", f"[{slip}]"))


@pytest.mark.parametrize(
    ("known", "given", "words"),
    [
        ("height_m", "height_mm", "metres"),
        ("height_m", "height", "metres"),
        ("width_m", "width_cm", "metres"),
        ("dry_mass_kg", "dry_mass_g", "kilograms"),
        ("density_kg_per_m3", "density_g_per_cm3", "kilograms per cubic metre"),
        ("surface_tension_n_per_m", "surface_tension_mn_per_m", "newtons per metre"),
        ("kinematic_viscosity_m2_per_s", "kinematic_viscosity_cst", "square metres per second"),
        ("fill_level", "fill_level_percent", "a share of 1"),
        ("frequencies_hz", "frequencies_rad_per_s", "hertz"),
        ("thickness_m", "thickness_mm", "metres"),
    ],
)
def test_other_units_are_named(known: str, given: str, words: str) -> None:
    text = (TANK + LIQUID + BEAM).replace(f"\n{known} = ", f"\n{given} = ", 1)
    with pytest.raises(RigError, match=f"{given}: got an unknown key.*remedy: this file takes {words}: {known}"):
        rig_of(text)


@pytest.mark.parametrize(
    "kept",
    [
        (
            TANK + 'material = "acrylic"\nheight_mm = 27.2\nheight_of_roof_m = 0.03\nheights_m = [0.0]\n',
            LIQUID,
            BEAM,
        ),
        (TANK, LIQUID.replace("surface_tension_n_per_m", "dynamic_viscosity_pa_s"), BEAM),
        (TANK, LIQUID.replace('name = "water"\n', 'surface_tension = "clean"\ntemperature_c = 20.0\n'), BEAM),
        (TANK, LIQUID, GUIDE + "damping_ratio = 0.006\nlength_mm = 300\nlength_of_guide_m = 0.3\nmass_g = 2061\n"),
        (TANK, LIQUID, GUIDE.replace("damping_kg_per_s = 1.58", "damping_ratio = 0.006\nfrequency_hz = 6.5")),
        (TANK, LIQUID, BEAM, "[twin_2]\nx = 1\n[laboratory]\nname = 'A'\n[sensors.cell_1]\nheight_mm = 3\n"),
        ("title = 'rig'\nnotes = 'none'\n", TANK, LIQUID),
    ],
)
def test_what_other_programs_add_is_kept(kept: tuple[str, ...]) -> None:
    rig_of(*kept)


def test_extra_keys_come_through() -> None:
    rig = rig_of(TANK, 'material = "acrylic"\n', LIQUID, "[laboratory]\nroom = 3\n")
    assert (rig.tank.model_extra or {})["material"] == "acrylic"
    assert (rig.model_extra or {})["laboratory"] == {"room": 3}


def test_what_is_missing_and_not_misspelt_is_named_as_before() -> None:
    with pytest.raises(RigError, match=r"tank.dry_mass_kg: got nothing"):
        rig_of(TANK.replace("dry_mass_kg = 0.61\n", 'colour = "red"\n'), LIQUID)
