"""When a search goes on, by what it has fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis.selection import full_fit as full_fit_module
from sloshlab.diagnosis.selection import known_fits
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.full_fit import full_fit
from sloshlab.diagnosis.selection.known_fits import KnownFits
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__


def runs_of(folder: Path) -> FittedRuns:
    model = RigModel(rig(folder), folder, decays(duration_s=2.0))
    return FittedRuns(model, [observations(run, model.compared(run)) for run in model.runs], [])


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
    known: Any = SimpleNamespace(best_of=lambda n: fits[n], runs=SimpleNamespace(n_coefficients=1000))
    assert KnownFits.explains_little(known, 1) is is_little


@pytest.mark.parametrize(("n_readings", "is_left"), [(1000, True), (10**9, False)])
def test_a_search_that_has_simulated_enough_begins_no_more_and_says_so(
    tmp_path: Path, n_readings: int, is_left: bool
) -> None:
    runs = runs_of(tmp_path)
    runs.effort.add(n_readings)
    known = KnownFits(runs)
    assert known.has_budget() is is_left
    assert ("search" in known.failed) is not is_left


def test_a_coarse_fit_goes_on_only_where_none_is_known_that_leaves_less(tmp_path: Path) -> None:
    """In the inflated noise in which the coarse one was fitted."""
    runs = runs_of(tmp_path)
    worse, better = (
        FreeRunFit((), {**runs.model.believed, "frequency of mode 1": ratio}, 0.0, 0.0) for ratio in (1.02, 1.0)
    )
    for fit, coarse, leaves_less in ((better, worse, True), (worse, better, False)):
        known = KnownFits(runs)
        assert not known.leaves_less(runs, coarse, 0.03)
        known.keep([fit])
        assert known.leaves_less(runs, coarse, 0.03) is leaves_less


def test_of_every_model_the_fit_of_the_lowest_cost_is_kept(tmp_path: Path) -> None:
    known = KnownFits(runs_of(tmp_path))
    costs = (3.0, 1.0, 2.0)
    known.keep([FreeRunFit((), {}, cost, cost) for cost in costs])
    known.keep([FreeRunFit((), {}, 0.5, 0.5, trouble="does not run")])
    assert known.best.cost == 1.0
    assert known.of_length(0) == known.in_order() == [known.best]
    assert known.best_of(1) is None
    assert known.failed == {"": "does not run"}


def test_runs_are_sought_anew_only_beside_what_explains_a_tenth_of_the_best(tmp_path: Path) -> None:
    candidate = Candidate(effect("structure.cubic_stiffness"), surroundings(runs_of(tmp_path).model))
    known, nothing = KnownFits(runs_of(tmp_path)), FreeRunFit((), {}, 1000.0, 1000.0)
    assert known.most_cost_beside(nothing) == np.inf
    known.keep([nothing])
    # An effect may explain nothing until its runs are sought anew, as long as none is known that does.
    assert known.most_cost_beside(nothing) == np.inf
    known.keep([FreeRunFit((candidate,), {}, 100.0, 100.0)])
    assert known.most_cost_beside(nothing) == pytest.approx(910.0)
    assert known.most_cost_beside(known.best) == np.inf


@pytest.mark.parametrize(("most_cost", "is_sought"), [(np.inf, True), (0.0, False)])
def test_a_fit_that_explains_too_little_keeps_the_numbers_of_its_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most_cost: float, is_sought: bool
) -> None:
    sought: list[FreeRunFit] = []

    def values_of_runs(model: RigModel, runs: Any, fit: FreeRunFit, effort: Any) -> dict[str, float]:
        sought.append(fit)
        return dict(fit.values)

    monkeypatch.setattr(full_fit_module, "values_of_runs", values_of_runs)
    monkeypatch.setattr(FreeRunProblem, "is_down_to_noise", lambda self, fit: False)
    runs = runs_of(tmp_path)
    begun = FreeRunFit((), dict(runs.model.believed), 0.0, 0.0)
    full_fit(runs, begun, begun, most_cost=most_cost)
    assert bool(sought) is is_sought


def test_the_leading_fits_are_at_their_optima_in_the_noise_that_is_known_by_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was fitted in less noise stops where that ended it: recordings and twin agree at a ratio of one."""
    known = KnownFits(runs_of(tmp_path))
    off = FreeRunFit((), {**known.runs.model.believed, "frequency of mode 1": 1.004}, 1e9, 1e9)
    known.keep([off])
    known.renew_sampling()
    assert known.best.values == off.values
    noisier = [[replace(each, variance=4.0 * each.variance) for each in run] for run in known.runs.runs]
    monkeypatch.setattr(known_fits, "with_sampled_jumps", lambda *arguments: noisier)
    known.renew_sampling()
    assert known.best.values["frequency of mode 1"] == pytest.approx(1.0, abs=2e-4)
    problem = known.runs.problem_of(known.best)
    residual = problem.residual(problem.theta_of(known.best.values))
    assert known.best.misfit == pytest.approx(problem.misfit(residual), rel=1e-9)


def test_the_noise_of_a_drive_is_renewed_once_beside_a_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = runs_of(tmp_path)
    asked: list[FreeRunFit] = []

    def renew_drive(before: FreeRunFit, fit: FreeRunFit) -> bool:
        assert before is nothing
        asked.append(fit)
        return True

    scatter: Any = SimpleNamespace(renew_drive=renew_drive, fitting=[["other noise"]])
    known = KnownFits(runs, scatter)
    renewed: list[Any] = []
    monkeypatch.setattr(known, "renew_sampling", lambda: renewed.append(known._quiet.runs))
    drag = Candidate(effect("structure.quadratic_drag"), surroundings(runs.model))
    nothing, best = FreeRunFit((), {}, 100.0, 100.0), FreeRunFit((drag,), {}, 10.0, 10.0)
    known.keep([nothing, best])
    assert known.renew_noise_of_drive(best)
    assert renewed == [[["other noise"]]]
    assert not known.renew_noise_of_drive(best)
    assert asked == [best]
