"""Fits that go on from where a search has brought them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis.selection import full_fit as module
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.full_fit import compensated_fit
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate

assert effects.__all__
FREQUENCY, DRAG = "frequency of mode 1", 30.0


@pytest.mark.parametrize("retuned", [1.05, 0.997])
def test_others_begin_where_they_are_believed_too_and_the_better_fit_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, retuned: float
) -> None:
    """No slope leads from one resonance to another: every fit stays where it begins; 0.99 would be right."""
    model = RigModel(rig(tmp_path), tmp_path, decays(duration_s=1.5))
    runs = FittedRuns(
        model, [observations(run, model.compared(run), model.driving(run)) for run in model.runs], []
    )
    candidate = Candidate(effect("structure.quadratic_drag"), surroundings(model))
    release = next(name for name in model.believed if name.startswith("release"))
    released_m = 1.01 * model.believed[release]
    base = FreeRunFit((), {**model.believed, FREQUENCY: retuned, release: released_m}, 0.0, 0.0)

    def stays(problem: FreeRunProblem, start: Mapping[str, float], *others: Any) -> FreeRunFit:
        return FreeRunFit(problem.candidates, dict(start), abs(start[FREQUENCY] - 0.99), 0.0)

    monkeypatch.setattr(module, "at_its_optimum", stays)
    monkeypatch.setattr(module, "full_fit", lambda runs, coarse, *others, **more: coarse)
    found = compensated_fit(runs, base, candidate, {f"{candidate.key}.drag_n_s2_per_m2": DRAG})
    assert found.candidates == (candidate,)
    assert found.values[FREQUENCY] == min(retuned, 1.0)
    # Numbers of single runs are those of the recording, not of what is believed.
    assert found.values[release] == pytest.approx(released_m)
    assert found.values[f"{candidate.key}.drag_n_s2_per_m2"] == DRAG
