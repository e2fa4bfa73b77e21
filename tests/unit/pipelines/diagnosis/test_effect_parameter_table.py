"""Rows of the numbers of effects, those of single runs among them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from pipelines.diagnosis.tables import effect_parameter_table
from sloshlab.diagnosis.interval import Interval
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, known_effects

assert effects.__all__


def test_numbers_of_runs_that_were_not_fitted_have_no_row() -> None:
    [drift] = [each for each in known_effects() if each.name == "drift_of_runs"]
    candidate = Candidate(drift.of_runs(("first", "held out")), cast(Any, None), "acceleration_tip")
    intervals = {(candidate.key, "rate in first"): Interval(0.2, 0.1, 0.3)}
    best = SimpleNamespace(fit=SimpleNamespace(candidates=(candidate,)))
    verdict = SimpleNamespace(best=best, kind="named", intervals=intervals, has_law=False)
    diagnosis: Any = SimpleNamespace(verdict=verdict)
    table = effect_parameter_table(diagnosis)
    assert table is not None
    assert [row[1:] for row in table.rows] == [("rate in first", "0.2000", "0.1000 … 0.3000", "1")]
