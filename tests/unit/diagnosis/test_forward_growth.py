"""What a search adds next, by where something is missing and by what it may still spend."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from recorded_oscillators import decays, rig, surroundings

from sloshlab.diagnosis.selection import forward_growth
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.forward_growth import ForwardGrowth
from sloshlab.diagnosis.selection.known_fits import KnownFits
from sloshlab.diagnosis.selection.matched_forces import MatchedForces
from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects

assert effects.__all__  # importing the vocabulary makes it known

HARDENING, SPRING = "structure.cubic_stiffness", 2e5


def growth_of(folder: Path, recorded: Sequence[CaseRun]) -> tuple[ForwardGrowth, FreeRunFit]:
    model = RigModel(rig(folder), folder, recorded)
    runs = FittedRuns(model, [observations(run, model.compared(run)) for run in model.runs], [])
    growth = ForwardGrowth(KnownFits(runs), surroundings(model), lambda *_: None)
    growth.pool = [candidate for candidate in growth.pool if candidate.key == HARDENING]
    problem = runs.problem()
    believed = problem.theta_of(model.believed)
    misfit = problem.misfit(problem.residual(believed))
    return growth, FreeRunFit((), problem.values(believed), misfit, misfit)


def hardening() -> list[CaseRun]:
    return decays((0.006, 0.018), 3.0, force=lambda t, x, v: -SPRING * x**3)


def one_sensor_high() -> list[CaseRun]:
    return decays((0.006, 0.018), 3.0, lambda read: {**read, "displacement_tank": 1.1 * read["displacement_tank"]})


@pytest.mark.parametrize(("recorded", "is_force"), [(hardening, True), (one_sensor_high, False)])
def test_forces_come_first_where_one_is_likelier_than_an_error_of_a_sensor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recorded: object, is_force: bool
) -> None:
    growth, nothing = growth_of(tmp_path, recorded())
    growth.known.keep([nothing])
    assert growth.known.lacks_a_force(nothing) is is_force
    tried: list[str] = []
    monkeypatch.setattr(growth, "_leaving_nothing", lambda best, matched: tried.append("forces"))
    monkeypatch.setattr(growth, "grown", lambda *_, **__: tried.append("all"))
    leading = MatchedForces(leading=[(growth.pool[0], growth.pool[0].starts()[0])])
    monkeypatch.setattr(growth, "matched_beside", lambda best, what: leading)
    monkeypatch.setattr(MatchedForces, "evolved", lambda self: self)
    growth.added([nothing], "one effect", nothing)
    assert tried == (["forces", "forces", "all"] if is_force else ["all"])


def test_the_best_of_what_was_begun_is_fitted_though_nothing_is_left_to_spend(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    growth, nothing = growth_of(tmp_path, hardening())
    growth.known.keep([nothing])
    halved = forward_growth.halved

    def spending(*arguments: object) -> list[FreeRunFit]:
        found = halved(*arguments)  # type: ignore[arg-type]
        growth.known.runs.effort.add(10**9)
        return found

    monkeypatch.setattr(forward_growth, "halved", spending)
    growth.grown([nothing], "one effect")
    [found] = growth.known.of_length(1)
    assert found.cost < 0.1 * nothing.cost
    assert found.values[f"{HARDENING}.stiffness_n_per_m3"] == pytest.approx(SPRING, rel=0.05)
    assert "search" not in growth.known.failed
