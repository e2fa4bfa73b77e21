"""A number that retuning took to its bound is told, with what was believed of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from pipelines.diagnosis.results import Diagnosis
from pipelines.diagnosis.tolerance_bounds import at_their_bounds
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.user_twin import MechanicalTwin, Parameter, UserTwinModel
from tests.unit.user_twin.test_user_twin import cart, pushed_run

SHOWN = "displacement_cart"
STIFFNESS = BaselineParameter("stiffness", 300.0, 1.0, "N m-1")
GAIN = BaselineParameter("gain of force_motor", 1.0, 0.01)


@pytest.mark.parametrize(("value", "is_told"), [(296.0, True), (296.0000001, True), (296.1, False), (304.0, True)])
def test_a_bound_is_four_tolerances_away(value: float, is_told: bool) -> None:
    assert bool(at_their_bounds([STIFFNESS, GAIN], {"stiffness": value})) == is_told


def test_one_line_names_them_with_units_and_beliefs() -> None:
    [line] = at_their_bounds([STIFFNESS, GAIN], {"stiffness": 296.0, "gain of force_motor": 0.96})
    assert line == (
        "retuned as far as it may: stiffness to 296 N m-1, believed 300 ± 1; "
        "gain of force_motor to 0.96, believed 1 ± 0.01; widen a tolerance that is too small"
    )


def test_many_are_counted() -> None:
    many = [BaselineParameter(f"p{k}", 0.0, 1.0) for k in range(5)]
    [line] = at_their_bounds(many, {f"p{k}": 4.0 for k in range(5)})
    assert "p2 to 4, believed 0 ± 1 and 2 more;" in line


@pytest.mark.parametrize("named", [False, True])
def test_a_diagnosis_flags_what_the_model_that_it_shows_ended_at(named: bool) -> None:
    """Where an effect explains what retuning could not, its model is shown, and the baseline's end is none."""
    twin = MechanicalTwin((Parameter("stiffness", 3000.0, 1.0, "N m-1"),), ("force_push",), {SHOWN: "m"}, cart)
    model = UserTwinModel(twin, [pushed_run()])
    retuned, after = (SimpleNamespace(values={"stiffness": value}) for value in (2996.0, 2999.0))
    findings: Any = SimpleNamespace(split=SimpleNamespace(limits=("one run",)), model=model, retuned=retuned)
    verdict: Any = SimpleNamespace(model=after if named else None)
    told = (
        "retuned as far as it may: stiffness to 2996 N m-1, believed 3000 ± 1; widen a tolerance that is too small"
    )
    expected = ("one run",) if named else ("one run", told)
    assert Diagnosis(findings, verdict, cast(Any, None)).flags == expected
