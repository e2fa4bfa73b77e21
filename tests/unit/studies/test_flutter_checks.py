"""Published and exact numbers of aeroelasticity are reached, each as `make flutter-checks` prints it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.util import find_spec

import pytest
from slow_cases import slow_but

from studies.flutter_checks import (
    Check,
    all_checks,
    flying_wing,
    functions,
    goland,
    lattice,
    liquids,
    steps,
    typical_section,
)

WITHOUT_LATTICE = (functions, typical_section, goland, steps, liquids)
OF_LATTICE = (lattice, flying_wing)


def missed(checks: Iterator[Check]) -> list[str]:
    return [f"{check.what}: {check.reached:.6g}" for check in checks if not check.is_met]


@pytest.mark.parametrize("part", WITHOUT_LATTICE)
def test_numbers_are_reached(part: Callable[[], Iterator[Check]]) -> None:
    assert missed(part()) == []


@pytest.mark.skipif(find_spec("panelaero") is None, reason="PanelAero is not installed: extra aircraft")
@pytest.mark.parametrize("part", slow_but([lattice], OF_LATTICE))
def test_numbers_of_the_lattice_are_reached(part: Callable[[], Iterator[Check]]) -> None:
    assert missed(part()) == []


def test_a_number_that_is_off_is_missed() -> None:
    assert not Check("x", 2.0, 2.03, 0.01, "").is_met
    assert Check("x", 0.0, -0.009, 0.01, "").is_met
    assert not Check("x", 0.0, float("nan"), 0.01, "").is_met


def test_every_part_is_in_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    one = Check("one", 1.0, 1.0, 0.1, "")
    for part in (*WITHOUT_LATTICE, *OF_LATTICE):
        monkeypatch.setattr(f"studies.flutter_checks.{part.__name__}", lambda: iter([one]))
    n = len(WITHOUT_LATTICE) + (len(OF_LATTICE) if find_spec("panelaero") else 0)
    assert len(all_checks()) == n
