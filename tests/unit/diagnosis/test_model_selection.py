"""Which effects are nested in others, and which starts are begun."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import decays, effect, fitted_from, rig, surroundings

from sloshlab.diagnosis.selection import model_selection
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.hidden_effects import HiddenEffect
from sloshlab.diagnosis.selection.model_selection import ModelSelection
from sloshlab.diagnosis.selection.nested_models import reduced, widened
from sloshlab.diagnosis.selection.successive_halving import _best_starts
from sloshlab.identification.free_run_fit import INFLATION_STAGES
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__


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
    assert reduced(fit, wider, simpler) == {"structure.coulomb_friction.force_n": 5.5}


def test_a_wider_form_begins_at_the_numbers_of_the_simpler_one(tmp_path: Path) -> None:
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    play, by_direction = (
        Candidate(effect(f"structure.{name}"), at)
        for name in ("friction_behind_play", "friction_behind_play_by_direction")
    )
    own = {"force_n": 5.0, "play_m": 0.01, "stiffness_n_per_m": 30.0}
    fit = FreeRunFit(
        (play,), {"frequency of mode 1": 1.01} | {f"{play.key}.{n}": v for n, v in own.items()}, 0.0, 0.0
    )
    [begun] = widened(fit, play, by_direction)
    expected = {"force_up_n": 5.0, "force_down_n": 5.0, "play_m": 0.01, "stiffness_n_per_m": 30.0}
    assert begun == {f"{by_direction.key}.{name}": value for name, value in expected.items()}


def test_numbers_that_a_simpler_form_has_not_begin_at_each_of_their_starts(tmp_path: Path) -> None:
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    coulomb, stribeck = (
        Candidate(effect(f"structure.{name}"), at) for name in ("coulomb_friction", "stribeck_friction")
    )
    begun = widened(FreeRunFit((coulomb,), {f"{coulomb.key}.force_n": 5.0}, 0.0, 0.0), coulomb, stribeck)
    speeds = {start[f"{stribeck.key}.stribeck_velocity_m_per_s"] for start in stribeck.starts()}
    assert len(begun) == len(speeds) == 3
    assert {each[f"{stribeck.key}.stribeck_velocity_m_per_s"] for each in begun} == speeds
    assert all(each[f"{stribeck.key}.{size}"] == 5.0 for each in begun for size in ("coulomb_n", "static_n"))


def test_what_leaves_something_is_widened_once(tmp_path: Path) -> None:
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    play, by_direction = (
        Candidate(effect(f"structure.{name}"), at)
        for name in ("friction_behind_play", "friction_behind_play_by_direction")
    )
    own = {f"{play.key}.force_n": 5.0, f"{play.key}.play_m": 0.01, f"{play.key}.stiffness_n_per_m": 30.0}
    best = FreeRunFit((play,), {"frequency of mode 1": 1.01, **own}, 100.0, 100.0)
    runs = SimpleNamespace(model=None, tests=(), effort=None)
    selection = cast(Any, ModelSelection(cast(Any, runs), at, lambda what, done, of: None))
    selection.known.keep([best])
    selection.known.remains = lambda fit: True
    fitted: list[FreeRunFit] = []

    def fitted_to_the_end(begun: list[FreeRunFit], base: FreeRunFit) -> list[FreeRunFit]:
        fitted.extend(begun)
        return [FreeRunFit(each.candidates, each.values, 110.0, 110.0) for each in begun]

    selection.growth = SimpleNamespace(pool=[play, by_direction], fitted_to_the_end=fitted_to_the_end)
    assert selection._best_with_wider_forms(1) is best
    assert selection._best_with_wider_forms(1) is best
    [begun] = fitted
    assert begun.candidates == (by_direction,)
    assert begun.values["frequency of mode 1"] == 1.01
    assert not set(begun.values) & set(own)


def test_friction_that_falls_with_speed_is_found_from_dry_friction_that_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawn from their priors the numbers of Stribeck friction end where they are those of dry friction.

    Decays by scipy: a friction of 0.9 N at rest and 0.5 N at speed, with a Stribeck velocity of 0.3 m/s.
    """

    def less_at_speed(t: float, x: float, v: float) -> float:
        return float(0.4 * (1.0 - np.exp(-((v / 0.3) ** 2))) * np.sign(v))

    model = RigModel(rig(tmp_path), tmp_path, decays((0.01, 0.03), friction_n=(0.9, 0.9), force=less_at_speed))
    runs = FittedRuns(model, [observations(run, model.compared(run)) for run in model.runs], [])
    selection = ModelSelection(runs, surroundings(model), lambda what, done, of: None)
    friction = Candidate(effect("structure.coulomb_friction"), selection.growth.at)
    problem = runs.problem([friction])
    start = {**model.believed, "structure.coulomb_friction.force_n": 0.7}
    dry = fitted_from(problem, [{name: start[name] for name in problem.names}])
    selection.known.keep([dry])
    monkeypatch.setattr(selection.known, "remains", lambda fit: False)
    best = selection._best_with_wider_forms(1)
    assert best is not None
    [found] = best.candidates
    assert found.effect.name == "stribeck_friction"
    assert best.cost < 0.7 * dry.cost
    numbers = {name.rpartition(".")[2]: best.values[name] for name in found.names}
    assert numbers["static_n"] == pytest.approx(0.9, rel=0.1)
    assert numbers["coulomb_n"] == pytest.approx(0.5, rel=0.15)
    assert numbers["stribeck_velocity_m_per_s"] == pytest.approx(0.3, rel=0.2)


@pytest.mark.parametrize("known_cost", [None, 5e4, 110.0])
def test_a_simpler_form_begins_again_where_the_wider_one_ended(tmp_path: Path, known_cost: float | None) -> None:
    """Friction that came to rest half a cycle early fits badly; the wider form tells where to begin."""
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    wider, simpler = (
        Candidate(effect(f"structure.{name}"), at) for name in ("asymmetric_friction", "coulomb_friction")
    )
    own = {"structure.asymmetric_friction.force_up_n": 5.0, "structure.asymmetric_friction.force_down_n": 6.0}
    found = FreeRunFit((wider,), {"frequency of mode 1": 1.01, **own}, 100.0, 100.0)
    stuck = FreeRunFit((simpler,), {"structure.coulomb_friction.force_n": 9.0}, known_cost or 0.0, 0.0)
    runs = SimpleNamespace(model=None, tests=(), effort=None)
    selection = ModelSelection(cast(Any, runs), at, lambda what, done, of: None)
    selection.known.keep([found] if known_cost is None else [found, stuck])
    begun = selection._simpler_forms(found, wider)
    assert [each.values for each in begun] == [
        {"frequency of mode 1": 1.01, "structure.coulomb_friction.force_n": 5.5}
    ]


def test_a_hidden_effect_is_fitted_from_afar_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An offset stands in for a constant force: near the noise the fit stops on the way to it."""
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    force = Candidate(effect("structure.constant_force"), at)
    number = "structure.constant_force.force_n"
    hidden = HiddenEffect(force, {number: -0.2}, gain=20.0)
    monkeypatch.setattr(model_selection, "hidden_effects", lambda *arguments: [hidden])
    kept: list[FreeRunFit] = []

    def fitted_to_the_end(
        coarse: list[FreeRunFit], base: FreeRunFit, hopeless_cost: object = None, stages: tuple[float, ...] = ()
    ) -> list[FreeRunFit]:
        reached, cost = (-1.5, 10.0) if stages == INFLATION_STAGES else (-0.4, 90.0)
        return [FreeRunFit(each.candidates, {number: reached}, cost, cost) for each in coarse]

    def is_more_probable(found: list[FreeRunFit], fit: FreeRunFit) -> bool:
        return min((each.cost for each in found), default=fit.cost) < fit.cost

    selection = cast(Any, object.__new__(ModelSelection))
    selection.said = lambda what, done, of: None
    selection.growth = SimpleNamespace(
        pool=[force], pool_beside=lambda fits: [force], fitted_to_the_end=fitted_to_the_end
    )
    selection.known = SimpleNamespace(runs=None, keep=kept.extend, is_more_probable=is_more_probable)
    selection._swapped_beside = {}
    assert selection._uncovered(FreeRunFit((), {}, 50.0, 50.0))
    assert sorted(each.values[number] for each in kept) == [-1.5, -0.4]


@pytest.mark.parametrize("tolerances", [0.5, 3.9])
def test_a_number_that_retuning_has_taken_too_far_is_as_believed_beside_an_effect(
    tmp_path: Path, tolerances: float
) -> None:
    """Beside a damping that is nearly gone nothing shows that changes it; a frequency that moved little stays."""
    model = RigModel(rig(tmp_path), tmp_path, decays())
    runs = FittedRuns(model, [observations(run, model.compared(run)) for run in model.runs], [])
    selection = cast(Any, ModelSelection(runs, surroundings(model), lambda what, done, of: None))
    frequency, damping = "frequency of mode 1", "damping of mode 1"
    problem = runs.problem()
    far = problem.theta_of(model.believed)
    far[problem.names.index(damping)] -= tolerances
    far[problem.names.index(frequency)] += 0.5
    retuned = FreeRunFit((), {**model.believed, **problem.values(far)}, 50.0, 50.0)
    grown: list[FreeRunFit] = []
    selection.growth = SimpleNamespace(
        pool=selection.growth.pool, grown=lambda bases, what: grown.extend(bases) or selection.known.keep([better])
    )
    force = Candidate(effect("structure.constant_force"), surroundings(model))
    better = FreeRunFit((force,), {"structure.constant_force.force_n": 1.0}, 1.0, 1.0)
    selection.known.is_more_probable = lambda found, fit: found == [better] and fit is retuned
    assert selection._beside_belief(retuned) is (tolerances > 1.0)
    if grown:
        assert grown[0].values[damping] == model.believed[damping]
        assert grown[0].values[frequency] == retuned.values[frequency] != model.believed[frequency]


@pytest.mark.parametrize(("is_more", "left"), [(True, False), (False, True)])
def test_what_a_fit_makes_of_the_noise_of_drives_is_not_left(tmp_path: Path, is_more: bool, left: bool) -> None:
    at = surroundings(RigModel(rig(tmp_path), tmp_path, decays()))
    drag = Candidate(effect("structure.quadratic_drag"), at)
    best, renewed = (FreeRunFit((drag,), {}, cost, cost) for cost in (90.0, 60.0))
    selection = cast(Any, object.__new__(ModelSelection))
    selection._swapped_beside, selection._widened_at = {frozenset(): set()}, {}
    selection.known = SimpleNamespace(
        remains=lambda fit: fit is best,
        renew_noise_of_drive=lambda fit: is_more,
        of_model=lambda keys: renewed,
    )
    assert selection._remains(best) is left
    assert bool(selection._swapped_beside) is not is_more
