"""A public servo axis (EMPS): dry friction with an offset, which a refit without friction hides in the damping.

Published by its authors: M 95.11 kg, F_v 203.5 N s/m, F_c 20.39 N, offset 3.16 N; refits of others spread by 2, 6,
6 and 4 %. The diagnosis is told none of it.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from sloshlab.diagnosis.user_twin import load_extended

pytestmark = [pytest.mark.external, pytest.mark.slow]

MASS_KG, VISCOUS_N_S_PER_M, FRICTION_N, OFFSET_N = 95.11, 203.5, 20.39, 3.16
SPREAD = 0.06


@pytest.fixture(scope="module")
def example(repository: Path) -> ModuleType:
    specification = importlib.util.spec_from_file_location(
        "servo_axis", repository / "docs/examples/servo_axis.py"
    )
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def case(external_data: Path, example: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not (external_data / "emps" / "DATA_EMPS.mat").is_file():
        pytest.skip("no DATA_EMPS.mat among the recordings of other laboratories")
    return example.write_case(external_data, tmp_path_factory.mktemp("servo") / "case")


@pytest.fixture(scope="module")
def found(case: Path, example: ModuleType) -> dict[str, Any]:
    return example.diagnosed(case, report=False)


def test_dry_friction_with_an_offset_is_found_and_its_equal_named(found: dict[str, Any]) -> None:
    assert found["verdict"] == "indistinguishable"
    alternatives = [sorted(names) for names in found["alternatives"]]
    assert ["asymmetric_friction"] in alternatives
    assert ["constant_force", "coulomb_friction"] in alternatives


def test_mass_friction_and_offset_are_the_published_ones(case: Path, found: dict[str, Any]) -> None:
    values, extension = load_extended(case / "diagnosis" / "extended_twin.toml")
    assert values["mass"] == pytest.approx(MASS_KG, rel=SPREAD)
    assert values["viscous friction"] == pytest.approx(VISCOUS_N_S_PER_M, rel=SPREAD)
    [friction, offset] = friction_and_offset(found)
    assert friction == pytest.approx(FRICTION_N, rel=SPREAD)
    assert offset == pytest.approx(OFFSET_N, rel=0.15)
    assert extension.terms


def test_retuned_without_friction_the_damping_takes_its_place(case: Path, found: dict[str, Any]) -> None:
    values, _ = load_extended(case / "diagnosis" / "retuned_twin.toml")
    assert values["viscous friction"] > 1.8 * VISCOUS_N_S_PER_M
    fit = found["fit"]
    assert fit["heldout_after"] < 0.75 * fit["heldout_retuned"] < fit["heldout_before"]


def friction_and_offset(found: dict[str, Any]) -> tuple[float, float]:
    """Of either form of the same force."""
    numbers = {one["name"]: {k: v["estimate"] for k, v in one["parameters"].items()} for one in found["effects"]}
    if "asymmetric_friction" in numbers:
        up, down = (numbers["asymmetric_friction"][name] for name in ("force_up_n", "force_down_n"))
        return (up + down) / 2, (down - up) / 2
    return numbers["coulomb_friction"]["force_n"], numbers["constant_force"]["force_n"]
