"""When the search goes on, and which effects are nested in others."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.model_selection import ModelSelection, _reduced
from sloshlab.diagnosis.selection.successive_halving import _best_starts
from sloshlab.identification.effort import Effort
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__


@pytest.mark.parametrize(
    ("misfits", "is_little"),
    [
        ((3000.0, 2900.0), True),  # a twentieth of the 2000 beyond the noise of 1000 coefficients
        ((3000.0, 2700.0), False),
        ((1100.0, 1050.0), False),  # half of the little that is left
        ((900.0, 899.0), False),  # noise was stated too large: nothing can be said of shares
    ],
)
def test_the_search_ends_where_the_last_effect_explains_little(
    misfits: tuple[float, float], is_little: bool
) -> None:
    fits = [SimpleNamespace(misfit=misfit) for misfit in misfits]
    search: Any = SimpleNamespace(_best_of=lambda n: fits[n], runs=SimpleNamespace(n_coefficients=1000))
    assert ModelSelection._explains_little(search, 1) is is_little


@pytest.mark.parametrize(
    ("larger", "smaller", "nested"),
    [
        ("structure.stribeck_friction", "structure.coulomb_friction", True),
        ("structure.coulomb_friction", "structure.stribeck_friction", False),
        ("structure.stribeck_friction", "tank.coulomb_friction", False),
        ("sensor.drift_of_runs", "sensor.sensor_drift", True),
    ],
)
def test_what_an_effect_reduces_to_acts_at_its_place(larger: str, smaller: str, nested: bool) -> None:
    first, second = (Candidate(effect(key), cast(Any, None)) for key in (larger, smaller))
    assert first.reduces_to(second) is nested
    assert not Candidate(effect(larger), cast(Any, None), "one").reduces_to(second)


def test_forms_and_places_of_one_effect_leave_room_for_others() -> None:
    """Six models of one name promise most; the best start of another name is begun all the same."""

    def proposal(key: str, name: str, predicted: float) -> Any:
        last = SimpleNamespace(effect=SimpleNamespace(known_as=name))
        return SimpleNamespace(candidates=(last,), keys=frozenset({key}), predicted=(predicted, 2.0 * predicted))

    forms = [
        proposal(f"form_{i}", "external_force", 0.1 + 0.01 * i + 0.001 * start)
        for i in range(6)
        for start in range(3)
    ]
    others = [proposal("friction", "coulomb_friction", 0.5), proposal("drag", "quadratic_drag", 0.6)]
    begun = _best_starts([*forms, *others], 6)
    assert [sorted(each.keys) for each in begun] == [
        ["form_0"],
        ["form_0"],
        ["form_1"],
        ["form_1"],
        ["friction"],
        ["drag"],
    ]


def test_a_simpler_form_is_fitted_from_the_numbers_of_the_wider_one(tmp_path: Path) -> None:
    """Drawn from its prior a friction rests elsewhere, and the wider form is named in its place."""
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    wider, simpler = (
        Candidate(effect(f"structure.{name}"), at) for name in ("asymmetric_friction", "coulomb_friction")
    )
    own = {"structure.asymmetric_friction.force_up_n": 5.0, "structure.asymmetric_friction.force_down_n": 6.0}
    fit = FreeRunFit((wider,), {"frequency of mode 1": 1.01, **own}, 0.0, 0.0)
    assert wider.reduces_to(simpler)
    assert _reduced(fit, wider, simpler) == {"structure.coulomb_friction.force_n": 5.5}


@pytest.mark.parametrize(("n_readings", "is_left"), [(1000, True), (10**9, False)])
def test_a_search_that_has_simulated_enough_begins_no_more_and_says_so(n_readings: int, is_left: bool) -> None:
    effort = Effort()
    effort.add(n_readings)
    search: Any = SimpleNamespace(runs=SimpleNamespace(effort=effort), failed={})
    assert ModelSelection._has_budget(search) is is_left
    assert ("search" in search.failed) is not is_left


def test_a_coarse_fit_goes_on_only_where_none_is_known_that_leaves_less(tmp_path: Path) -> None:
    """In the inflated noise in which the coarse one was fitted."""
    model = RigModel(rig(tmp_path), tmp_path, decays(duration_s=2.0))
    runs = FittedRuns(model, [observations(run, model.compared(run)) for run in model.runs], [])
    worse, better = (
        FreeRunFit((), {**model.believed, "frequency of mode 1": ratio}, 0.0, 0.0) for ratio in (1.02, 1.0)
    )
    for known, coarse, is_known in ((better, worse, True), (worse, better, False)):
        search: Any = SimpleNamespace(fits={frozenset(): known})
        assert ModelSelection._is_known(search, runs, coarse, 0.03) is is_known
    assert not ModelSelection._is_known(cast(Any, SimpleNamespace(fits={})), runs, worse, 0.03)
