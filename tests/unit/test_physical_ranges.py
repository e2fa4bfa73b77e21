"""Every number of a rig has a range that says where it comes from, and nothing in it ends in a traceback."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import BaseModel

from sloshlab.errors import RigError
from sloshlab.rig import Liquid, Rig, Structure, Tank

BEAM: dict[str, dict[str, Any]] = {
    "tank": {
        "height_m": 0.0272,
        "length_m": 0.1172,
        "width_m": 0.078,
        "dry_mass_kg": 0.61,
        "cell_frequency_hz": 400.0,
        "cell_damping_ratio": 0.02,
    },
    "liquid": {
        "density_kg_per_m3": 1000.0,
        "surface_tension_n_per_m": 0.0728,
        "kinematic_viscosity_m2_per_s": 1e-6,
        "fill_level": 0.5,
    },
    "structure": {
        "kind": '"beam"',
        "length_m": 0.74,
        "width_m": 0.1,
        "thickness_m": 0.01,
        "frequencies_hz": [10.87, 78.31],
        "damping_ratios": [0.0032, 0.009],
        "modal_masses_kg": [0.8956, 1.0692],
        "tip_mode_shape": [1.0, -1.0],
    },
}
GUIDE: dict[str, dict[str, Any]] = {
    **BEAM,
    "structure": {
        "kind": '"sdof"',
        "mass_kg": 2.061,
        "stiffness_n_per_m": 3808.8,
        "coulomb_force_n": 0.37,
        "damping_kg_per_s": 1.58,
        "spring_mass_kg": 0.84,
    },
}
FIELDS = [
    (rig, table, key)
    for rig in (BEAM, GUIDE)
    for table, entries in rig.items()
    for key, value in entries.items()
    if not isinstance(value, str) and (rig is BEAM or table == "structure")
]
# published: hydrogen and mercury in kg/m³, ethanol and mercury in N/m, mercury and glycerol in m²/s; the tank of a
# gas carrier; the slowest mode of the longest bridge; the load of the largest shaking table
USUAL_EXTREMES = {
    "density_kg_per_m3": (70.8, 13_534.0),
    "surface_tension_n_per_m": (0.0, 0.022, 0.485),
    "kinematic_viscosity_m2_per_s": (0.0, 1.1e-7, 1.2e-3),
    "height_m": (0.001, 30.0),
    "frequencies_hz": (0.04, 20_000.0),
    "dry_mass_kg": (0.01, 1.2e6),
    "damping_ratios": (0.0, 1e-6, 0.5),
    "fill_level": (0.01, 0.99),
    "coulomb_force_n": (0.0, 1e4),
    "stiffness_n_per_m": (0.1, 1e9),
}  # fmt: skip


def text_of(rig: dict[str, dict[str, Any]], table: str = "", key: str = "", value: Any = None) -> str:
    changed = {name: dict(entries) for name, entries in rig.items()}
    if table:
        old = changed[table][key]
        changed[table][key] = [old[0], value] if isinstance(old, list) else value
    return "\n".join(
        f"[{name}]\n" + "".join(f"{k} = {v}\n" for k, v in entries.items()) for name, entries in changed.items()
    )


def test_every_number_of_a_rig_is_tried_here() -> None:
    numbers = {
        (table, name)
        for table, model in (("tank", Tank), ("liquid", Liquid), ("structure", Structure))
        for name, field in model.model_fields.items()
        if "float" in str(field.annotation)
    }
    assert numbers == {(table, key) for _, table, key in FIELDS}
    assert {name for name, field in Rig.model_fields.items() if not _is_a_table(field.annotation)} == set()


def _is_a_table(annotation: Any) -> bool:
    kinds = getattr(annotation, "__args__", (annotation,))
    return all(kind is type(None) or issubclass(kind, BaseModel) for kind in kinds)


@pytest.mark.parametrize(("rig", "table", "key"), FIELDS)
@pytest.mark.parametrize("value", [1e308, 5e-324, -1e308, math.inf, math.nan])
def test_what_nothing_can_have_is_refused_with_the_range_and_its_origin(
    value: float, rig: dict[str, dict[str, Any]], table: str, key: str
) -> None:
    with pytest.raises(RigError) as refused:
        Rig.from_toml_text(text_of(rig, table, key, value), name="here")
    assert refused.value.what.startswith(f"rig here: {table}.{key}")
    if math.isfinite(value) and not (key == "fill_level" and value != 5e-324):
        assert " … " in refused.value.allowed
        assert len(refused.value.allowed.split(", ", 1)[1]) > 10


def test_a_fill_level_that_is_nothing_is_refused() -> None:
    with pytest.raises(RigError, match=r"liquid.fill_level: got 1e-300; allowed: 0.0001 … 0.9999, from a film"):
        Rig.from_toml_text(text_of(BEAM, "liquid", "fill_level", 1e-300))


@pytest.mark.parametrize(("rig", "table", "key"), [field for field in FIELDS if field[2] in USUAL_EXTREMES])
def test_what_some_rig_or_liquid_has_is_accepted(rig: dict[str, dict[str, Any]], table: str, key: str) -> None:
    for value in USUAL_EXTREMES[key]:
        Rig.from_toml_text(text_of(rig, table, key, value))


def test_grams_per_cubic_centimetre_are_found() -> None:
    with pytest.raises(RigError, match=r"density_kg_per_m3: got 1\.0; allowed: 30 … 25000 kg/m³"):
        Rig.from_toml_text(text_of(BEAM, "liquid", "density_kg_per_m3", 1.0))


def test_the_tip_moves_in_the_first_mode() -> None:
    text = text_of(BEAM).replace("[1.0, -1.0]", "[0.0, 1.0]")
    with pytest.raises(RigError, match="tip_mode_shape: in its first mode the tip of a beam moves"):
        Rig.from_toml_text(text)
