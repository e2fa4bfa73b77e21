"""Runs whose driving channels begin late or end early."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_user_twin import TIME, N, case_run, push

from sloshlab.errors import InputError
from sloshlab.identification.case import Case, CaseRun
from sloshlab.user_twin import with_known_drive


def run(name: str, lost_before: int = 0, lost_after: int = 0, repeat: int = 0) -> CaseRun:
    force = np.array([push(t) for t in TIME])
    force[:lost_before] = np.nan
    force[N - lost_after :] = np.nan
    return case_run(
        name, repeat=repeat, force_push=(force, "force"), displacement_cart=(np.zeros(N), "displacement")
    )


def case(*runs: CaseRun) -> Case:
    return Case("case", Path(), None, runs)


def test_a_run_begins_where_its_drive_is_known() -> None:
    found, said = with_known_drive(case(run("one", 20, 30)), ["force_push"])
    [cut] = found.runs
    assert cut.recording.sizes["time"] == N - 50
    assert np.isfinite(cut.recording["force_push"].values).all()
    assert said == ("one is cut to 0.08 … 1.88 s, where what drives is known",)


def test_repeats_are_cut_alike() -> None:
    found, said = with_known_drive(case(run("one", 20), run("two", 0, 30, repeat=1)), ["force_push"])
    times = [cut.recording["time"].values for cut in found.runs]
    np.testing.assert_array_equal(times[0], times[1])
    assert len(said) == 2


def test_what_is_known_throughout_stays_as_it_is() -> None:
    whole = case(run("one"), run("two", repeat=1))
    found, said = with_known_drive(whole, ["force_push", "force_of_none"])
    assert found.runs == whole.runs
    assert said == ()


def test_a_drive_that_is_nowhere_known_is_refused() -> None:
    with pytest.raises(InputError, match="run one: got 0 samples in which force_push"):
        with_known_drive(case(run("one", N)), ["force_push"])
