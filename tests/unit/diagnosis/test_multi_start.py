"""Throws along ridges, on decays under dry friction that scipy made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from decays_under_friction import ASYMMETRIC, COULOMB, Decays

from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, fitted
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, huber_cost
from sloshlab.diagnosis.search import multi_start


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Decays:
    return Decays(tmp_path_factory.mktemp("friction"))


def test_an_effect_of_several_numbers_is_refined_along_a_ridge(
    case: Decays, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit that stays where it begins: restarts find a better place, and the move is repeated."""
    begun: list[dict[str, float]] = []

    def stays(problem: FreeRunProblem, start: Mapping[str, float], **more: Any) -> Any:
        if more["stages"][-1] == INFLATION_STAGES[-1]:
            begun.append(dict(start))
        cost = huber_cost(problem.residual(problem.theta_of(start)))
        return FreeRunFit(problem.candidates, dict(start), cost, cost), None

    wide = case.fit(ASYMMETRIC)
    names = [f"{ASYMMETRIC}.force_{side}_n" for side in ("up", "down")]
    off = {**wide.fit.values, **{name: 0.3 * wide.fit.values[name] for name in names}}
    problem = case.fits.problem_of(wide.fit)
    at_off = huber_cost(problem.residual(problem.theta_of(off)))
    monkeypatch.setattr(multi_start, "fitted", stays)
    start = replace(wide, fit=replace(wide.fit, values=off, cost=at_off))
    [found] = multi_start.multi_start_refined(case.fits, [start])
    assert found.fit.cost < 0.5 * at_off
    first, second = begun[:2]
    assert second == {name: pytest.approx(2 * value - off[name]) for name, value in first.items()}


def test_a_restart_far_behind_is_given_up_half_way(case: Decays, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the cost of the half, and neither where it is near nor for a multimodal effect."""
    wide = case.fit(ASYMMETRIC)
    stages: list[float] = []

    def watched(problem: FreeRunProblem, start: Mapping[str, float], **more: Any) -> Any:
        stages.extend(more["stages"])
        return fitted(problem, start, **more)

    problem = case.fits.problem_of(wide.fit)
    monkeypatch.setattr(multi_start, "fitted", watched)
    near = multi_start._fitted_from_restart(problem, wide.fit.values, wide.fit)
    assert not near.trouble
    assert near.cost == pytest.approx(wide.fit.cost, rel=0.01)
    assert tuple(stages) == INFLATION_STAGES[1:]
    stages.clear()
    monkeypatch.setattr(multi_start, "inflated_cost", lambda problem, fit, share: 1.0 if fit is wide.fit else 1.11)
    assert multi_start._fitted_from_restart(problem, wide.fit.values, wide.fit).trouble
    assert tuple(stages) == INFLATION_STAGES[1:3]


def test_restarts_go_on_from_other_releases(case: Decays, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each run's own release is the best of its run alone, where no restart of the effect leads on."""
    wide = case.fit(ASYMMETRIC)
    releases = [name for name in wide.fit.values if name.startswith("release")]
    assert len(releases) == 2
    off = {**wide.fit.values, **{name: 1.03 * wide.fit.values[name] for name in releases}}
    problem = case.fits.problem_of(wide.fit)
    at_off = huber_cost(problem.residual(problem.theta_of(off)))

    def stays(problem: FreeRunProblem, start: Mapping[str, float], **more: Any) -> Any:
        cost = huber_cost(problem.residual(problem.theta_of(start)))
        return FreeRunFit(problem.candidates, dict(start), cost, cost), None

    monkeypatch.setattr(multi_start, "fitted", stays)
    monkeypatch.setattr(multi_start, "best_start", lambda problem, starts, share: off)
    start = replace(wide, fit=replace(wide.fit, values=off, cost=at_off))
    [found] = multi_start.multi_start_refined(case.fits, [start])
    assert found.fit.cost < 0.5 * at_off
    for name in releases:
        assert found.fit.values[name] == pytest.approx(wide.fit.values[name], rel=0.004)
    assert multi_start.multi_start_refined(case.fits, [found]) == []


def test_of_two_effects_the_multimodal_one_is_perturbed(case: Decays, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"{ASYMMETRIC}.force_{side}_n" for side in ("up", "down")]
    pair = case.fit(COULOMB, ASYMMETRIC, n_iterations=1)
    pair = replace(pair, fit=replace(pair.fit, values={**pair.fit.values, **dict.fromkeys(names, 0.1)}))
    assert multi_start.multi_start_refined(case.fits, [pair]) == []
    sudden = replace(case.pool[ASYMMETRIC].effect, sought_at=lambda at: [{}])
    candidates = (pair.fit.candidates[0], replace(pair.fit.candidates[1], effect=sudden))
    assert [candidate.is_multimodal for candidate in candidates] == [False, True]
    perturbed: list[dict[str, float]] = []

    def looked_at(problem: FreeRunProblem, starts: Any, share: float) -> Any:
        perturbed.extend(starts)
        return starts[0]

    def in_vain(problem: FreeRunProblem, start: Mapping[str, float], **more: Any) -> Any:
        return FreeRunFit(problem.candidates, dict(start), np.inf, np.inf), None

    monkeypatch.setattr(multi_start, "fitted", in_vain)
    monkeypatch.setattr(multi_start, "best_start", looked_at)
    known = replace(pair, fit=replace(pair.fit, candidates=candidates))
    assert multi_start.multi_start_refined(case.fits, [known]) == []
    assert len(perturbed) == 4 * 48
    changed = {name for place in perturbed for name, value in place.items() if value != pair.fit.values[name]}
    assert changed == set(names)


def test_an_effect_of_one_number_is_not_restarted(case: Decays) -> None:
    assert multi_start.multi_start_refined(case.fits, [case.fit(COULOMB)]) == []
