"""The Silverbox diagnosed: a hardening spring with a small quadratic part; free runs on data that chose nothing.

Published errors of free runs: linear 6.96 mV on the multisine and 14.4 mV on the arrow; polynomial NARX 0.64 and
2.25 mV.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sloshlab.user_twin import load_extended

pytestmark = [pytest.mark.external, pytest.mark.slow]


@pytest.fixture(scope="module")
def example(load_example: Callable[[str], ModuleType]) -> ModuleType:
    return load_example("silverbox_diagnosis")


@pytest.fixture(scope="module")
def folder(external_data: Path) -> Path:
    if not (external_data / "silverbox" / "SNLS80mV.mat").is_file():
        pytest.skip("no SNLS80mV.mat among the recordings of other laboratories")
    return external_data


@pytest.fixture(scope="module")
def case(folder: Path, example: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The case, written while the test data are not there: what follows cannot have seen them."""
    everything = example.signals

    def without_test_data(where: Path) -> tuple[NDArray[np.float64], ...]:
        signals = everything(where)
        for signal in signals:
            for part in example.TEST.values():
                signal[part] = np.nan
        return signals

    patch = pytest.MonkeyPatch()
    patch.setattr(example, "signals", without_test_data)
    try:
        return example.write_case(folder, tmp_path_factory.mktemp("silverbox") / "case")
    finally:
        patch.undo()


@pytest.fixture(scope="module")
def found(case: Path, example: ModuleType) -> dict[str, Any]:
    return example.diagnosed(case, report=False)


def test_a_hardening_spring_is_found(found: dict[str, Any]) -> None:
    assert found["verdict"] in ("named", "indistinguishable")
    effects = {effect["name"]: effect["parameters"] for effect in found["effects"]}
    assert effects["cubic_stiffness"]["stiffness_n_per_m3"]["low"] > 0


def test_a_small_quadratic_part_is_among_the_equals(found: dict[str, Any]) -> None:
    """A cubic spring about an offset, which a constant force makes, is a cubic and a quadratic one."""
    assert ["cubic_stiffness", "quadratic_stiffness"] in [sorted(names) for names in found["alternatives"]]


@pytest.mark.xfail(reason="the best of the equals is the constant force, whose numbers alone are stated")
def test_the_quadratic_part_is_small(found: dict[str, Any]) -> None:
    effects = {effect["name"]: effect["parameters"] for effect in found["effects"]}
    assert "quadratic_stiffness" in effects
    largest_v = 0.3
    cubic = effects["cubic_stiffness"]["stiffness_n_per_m3"]["estimate"] * largest_v**3
    assert abs(effects["quadratic_stiffness"]["stiffness_n_per_m2"]["estimate"]) * largest_v**2 < 0.3 * cubic


def test_free_runs_on_the_test_data(folder: Path, case: Path, example: ModuleType, found: dict[str, Any]) -> None:
    retuned, extended = (
        example.free_run_errors_mv(folder, *load_extended(case / "diagnosis" / f"{name}_twin.toml"))
        for name in ("retuned", "extended")
    )
    assert 5.0 < retuned["multisine"] < 9.0
    assert retuned["arrow"] > 10.0
    assert extended["multisine"] <= 0.7
    assert extended["arrow"] <= 2.5


@pytest.mark.xfail(reason="0.27: the bound is from before noise floors knew the noise of what drives", strict=True)
def test_the_weighted_error_falls_to_a_fifth_on_the_run_that_chose_nothing(found: dict[str, Any]) -> None:
    assert found["fit"]["heldout_after"] < 0.2 * found["fit"]["heldout_retuned"]
