"""The interval of a spring that quiet recordings tell better than a simulation is exact."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import decays, effect, fitted_from, rig, surroundings

from sloshlab.diagnosis import interval as interval_module
from sloshlab.diagnosis.interval import intervals_of
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__
CUBIC_N_PER_M3 = 2e6


@pytest.fixture(name="cubic")
def _cubic(tmp_path: Path) -> tuple[SimpleNamespace, FreeRunProblem, FreeRunFit, str]:
    """A case of decays with a spring that stiffens, its problem, its fit and the name of its number."""
    runs = decays(force=lambda t, x, v: -CUBIC_N_PER_M3 * x**3)
    model = RigModel(rig(tmp_path), tmp_path, runs)
    observed = [observations(run, model.compared(run), model.driving(run)) for run in runs]
    candidate = Candidate(effect("structure.cubic_stiffness"), surroundings(model))
    problem = FreeRunProblem(model, observed, (candidate,))
    name = f"{candidate.key}.{candidate.effect.parameters[0].name}"
    fit = fitted_from(problem, [{**model.believed, name: 1.5e6}], n_iterations=12)
    found = SimpleNamespace(model=model, fitting=observed, case=SimpleNamespace(names_by_test=lambda: []))
    return found, problem, fit, name


def test_its_ends_are_where_the_profile_has_risen(cubic: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The number grows with 1/gain² of a displacement: forward differences had a fifth of this interval."""
    found, problem, fit, name = cubic
    monkeypatch.setattr(interval_module, "EXACT", 0.0)
    [interval] = intervals_of(cast(Any, found), cast(Any, SimpleNamespace(fit=fit, fitted_rms=1.0))).values()
    assert interval.low < CUBIC_N_PER_M3 < interval.high
    for end in (interval.low, interval.high):
        held = FreeRunProblem(problem.model, problem.runs, problem.candidates, {name: end})
        rise = fitted_from(held, [fit.values], n_iterations=12).cost - fit.cost
        assert rise == pytest.approx(1.645**2, rel=0.15)


def test_a_force_is_known_no_better_than_a_simulation_is_exact(
    cubic: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, _, fit, _ = cubic
    best = cast(Any, SimpleNamespace(fit=fit, fitted_rms=1.0))
    halves = []
    for exact in (0.0, 0.01):
        monkeypatch.setattr(interval_module, "EXACT", exact)
        [interval] = intervals_of(cast(Any, found), best).values()
        halves.append(0.5 * (interval.high - interval.low) / interval.estimate)
    assert halves[1] == pytest.approx(np.hypot(halves[0], 1.645 * 0.01), rel=0.05)
