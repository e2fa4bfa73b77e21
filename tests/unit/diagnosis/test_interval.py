"""The interval of a spring that quiet recordings tell better than a simulation is exact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import decays, effect, fitted_from, rig, surroundings

from sloshlab.diagnosis import interval as interval_module
from sloshlab.diagnosis.interval import intervals_of
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.profile_likelihood import profiled_distance
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


def risen(problem: FreeRunProblem, fit: FreeRunFit, name: str, value: float) -> float:
    """By how much a fit is worse with one number held at a value."""
    held = FreeRunProblem(problem.model, problem.runs, problem.candidates, {name: value})
    return fitted_from(held, [fit.values], n_iterations=12).cost - fit.cost


@pytest.mark.parametrize("is_profiled", [True, False])
def test_its_ends_are_where_the_profile_has_risen(
    cubic: Any, is_profiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The number grows with 1/gain² of a displacement: forward differences had a fifth of this interval.

    The profile would mend a covariance that is wrong: the covariance is seen without it, too.
    """
    found, problem, fit, name = cubic
    monkeypatch.setattr(interval_module, "EXACT", 0.0)
    if not is_profiled:
        monkeypatch.setattr(
            interval_module, "profiled_distance", lambda problem, fit, name, distance, jacobian: distance
        )
    [interval] = intervals_of(cast(Any, found), cast(Any, SimpleNamespace(fit=fit, fitted_rms=1.0))).values()
    assert interval.low < CUBIC_N_PER_M3 < interval.high
    # The gain is what is not known of it, and its prior counts as often as likelihoods are tempered.
    for end in (interval.low, interval.high):
        assert risen(problem, fit, name, end) == pytest.approx(TEMPERING * 1.645**2, rel=0.15)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_profile_goes_on_where_a_covariance_is_too_small_and_nowhere_where_it_is_not(
    cubic: Any, sign: float
) -> None:
    _, problem, fit, name = cubic
    theta = problem.theta_of(fit.values)
    jacobian = problem.central_jacobian(theta)
    covariance = np.linalg.pinv(jacobian.normal() + np.diag(problem.prior_weights(theta)))
    for share in (0.25, 4.0):
        other = replace(fit, covariance=share * covariance)
        i = fit.names.index(name)
        given = sign * 1.645 * np.sqrt(share * covariance[i, i]) * fit.scales[i]
        reached = profiled_distance(problem, other, name, given, jacobian)
        if share > 1:
            assert reached == given
        else:
            assert abs(reached) > 1.5 * abs(given)
            assert risen(problem, fit, name, fit.values[name] + reached) == pytest.approx(1.645**2, rel=0.15)


def test_a_force_is_known_no_better_than_a_simulation_is_exact(
    cubic: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, _, fit, _ = cubic
    best = cast(Any, SimpleNamespace(fit=fit, fitted_rms=1.0))
    monkeypatch.setattr(
        interval_module, "profiled_distance", lambda problem, fit, name, distance, jacobian: distance
    )
    halves = []
    for exact in (0.0, 0.01):
        monkeypatch.setattr(interval_module, "EXACT", exact)
        [interval] = intervals_of(cast(Any, found), best).values()
        halves.append(0.5 * (interval.high - interval.low) / interval.estimate)
    assert halves[1] == pytest.approx(np.hypot(halves[0], 1.645 * 0.01), rel=0.05)
