"""The interval of a spring that quiet recordings tell better than a simulation is exact."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from recorded_oscillators import decays, effect, fitted_from, rig, surroundings

from sloshlab.diagnosis.interval import intervals_of
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__
CUBIC_N_PER_M3 = 2e6


def test_a_force_is_known_no_better_than_a_simulation_is_exact(tmp_path: Path) -> None:
    runs = decays(force=lambda t, x, v: -CUBIC_N_PER_M3 * x**3)
    model = RigModel(rig(tmp_path), tmp_path, runs)
    observed = [observations(run, model.compared(run), model.driving(run)) for run in runs]
    candidate = Candidate(effect("structure.cubic_stiffness"), surroundings(model))
    problem = FreeRunProblem(model, observed, (candidate,))
    name = f"{candidate.key}.{candidate.effect.parameters[0].name}"
    fit = fitted_from(problem, [{**model.believed, name: 1.5e6}], n_iterations=12)
    found = SimpleNamespace(model=model, fitting=observed, case=SimpleNamespace(names_by_test=lambda: []))
    [interval] = intervals_of(cast(Any, found), cast(Any, SimpleNamespace(fit=fit, fitted_rms=1.0))).values()
    assert interval.low < CUBIC_N_PER_M3 < interval.high
    half = 0.5 * (interval.high - interval.low) / interval.estimate
    of_noise, of_belief = (error / interval.estimate for error in fit.standard_errors(name))
    # One per cent of a simulation beside what noise and the priors of gains leave open.
    assert of_noise < 0.004
    least = 1.645 * (0.01**2 + of_belief**2) ** 0.5
    assert least == pytest.approx(half, rel=0.1)
