"""Cases of a trial as a campaign: the answers are those of the trial, its rules hold."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hand_made_trials import stand_in, truth, written_trial

from pipelines.campaign import case_tasks
from pipelines.campaign.case_tasks import answered_blindly, case_folders, diagnosis_tasks, trial_tasks
from pipelines.campaign.kinds import planned
from pipelines.campaign.plan import DiagnosePart, TrialPart
from sealed_trial.running import DIAGNOSES, OUTCOME, read_outcome
from sealed_trial.sealing.key import made_or_read_key
from sloshlab.errors import InputError

TWO = [truth(f"case_00{k}", "nothing", accepted=[[]]) for k in (1, 2)]


@pytest.fixture
def trial(tmp_path) -> Path:
    written_trial(tmp_path / "trials" / "trial", TWO, None)
    return tmp_path / "trials" / "trial"


def test_a_trial_is_known_as_one_and_its_answers_lie_in_it(trial, tmp_path, monkeypatch) -> None:
    plan = planned(trial, tmp_path / "store")
    assert [part.kind for part in plan.parts] == ["trial"]
    monkeypatch.setattr(case_tasks, "DIAGNOSE", stand_in(tmp_path))
    tasks = trial_tasks(TrialPart(kind="trial", folder=trial), tmp_path / "store")
    assert [task.name for task in tasks] == ["case_001", "case_002"]
    told = []
    for task in tasks:
        (tmp_path / task.name).mkdir()
        told.append(answered_blindly(tmp_path / task.name, task.files, task.arguments, print))
    assert [summary["numbers"]["answer"] for summary in told] == ["done", "crashed"]
    assert told[1]["flags"] == ["case_002 crashed: no way through"]
    assert (tmp_path / "case_001" / "verdict.json").is_file()
    outcome = read_outcome(trial / DIAGNOSES / "case_002" / OUTCOME)
    assert (outcome.status, outcome.exit_code) == ("crashed", 1)
    # what `trial run` has answered is not asked again
    calls = (trial / DIAGNOSES / "case_001" / "calls.txt").read_text()
    (tmp_path / "again").mkdir()
    answered_blindly(tmp_path / "again", tasks[0].files, tasks[0].arguments, print)
    assert (trial / DIAGNOSES / "case_001" / "calls.txt").read_text() == calls


def test_a_key_in_reach_or_other_data_are_refused(trial, tmp_path, monkeypatch) -> None:
    part = TrialPart(kind="trial", folder=trial)
    [task, _] = trial_tasks(part, tmp_path / "store")
    made_or_read_key(tmp_path / "safe" / "key", trial)
    monkeypatch.setenv("KEY_OF_IT", str(tmp_path / "safe" / "key"))
    with pytest.raises(InputError, match="no key in reach"):
        trial_tasks(part, tmp_path / "store")
    with pytest.raises(InputError, match="no key in reach"):
        answered_blindly(tmp_path, task.files, task.arguments, print)
    monkeypatch.delenv("KEY_OF_IT")
    (trial / "cases" / "case_002" / "rig.toml").write_text("[tank]\nhint = 1\n")
    with pytest.raises(InputError, match=r"case_002: rig\.toml"):
        trial_tasks(part, tmp_path / "store")


def test_cases_are_found_at_any_depth_and_results_are_none(tmp_path) -> None:
    for name in ("a/case", "b", "store/results/x"):
        (tmp_path / name / "recordings").mkdir(parents=True)
        (tmp_path / name / "rig.toml").touch()
        (tmp_path / name / "recordings" / "run.nc").touch()
    (tmp_path / "b" / "truth.locked").touch()
    cases = case_folders(tmp_path, tmp_path / "store")
    assert cases == [tmp_path / "a/case", tmp_path / "b"]
    tasks = diagnosis_tasks(DiagnosePart(kind="diagnose", folder=tmp_path, name="c"), tmp_path / "store")
    assert [task.name for task in tasks] == ["c__a__case", "c__b"]
    assert json.dumps(tasks[0].arguments) == '{"report": false}'
    [alone] = diagnosis_tasks(DiagnosePart(kind="diagnose", folder=tmp_path / "b"), tmp_path / "store")
    assert alone.name == "b"
