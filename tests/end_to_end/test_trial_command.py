"""`sloshlab trial` as a user types it: sealed, run out of time, scored; and what it refuses."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from progress_lines import without_progress

from pipelines.command_line import run
from sealed_trial.running import Outcome
from sealed_trial.sealing.key import PREFIX
from tests.unit.hand_made_trials import KEY, truth, written_trial


@pytest.mark.slow
def test_a_trial_is_sealed_run_and_scored_and_remembers_what_it_did(tmp_path, capsys, monkeypatch) -> None:
    pytest.importorskip("cryptography")
    trial, key, scores = tmp_path / "trial", tmp_path / "kept" / "key", tmp_path / "scores"
    monkeypatch.setattr("sys.argv", ["sloshlab"])
    assert run(["trial", "seal", "-o", str(trial), "--seed", "3", "--cases", "6", "--key", str(key)]) == 0
    assert sorted(path.name for path in trial.iterdir()) == ["cases", "commitments.json", "truths.locked"]
    for case in (trial / "cases").iterdir():
        assert sorted(path.name for path in case.iterdir()) == ["recordings", "rig.toml"]
        assert sum(path.stat().st_size for path in case.rglob("*")) < 5e6
    published = json.loads((trial / "commitments.json").read_text())
    assert published["purpose"] == "sealed"
    assert not [path for path in trial.rglob("*") if path.is_file() and PREFIX.encode() in path.read_bytes()]
    # nobody diagnoses in a tenth of a second: everything is wrong, and said to be so
    assert run(["trial", "run", str(trial), "--time-limit", "0.1"]) == 3
    assert "6 of 6 cases crashed or ran out of time" in capsys.readouterr().err
    assert run(["trial", "score", str(trial), "-o", str(scores)]) == 1
    assert "--key FILE" in capsys.readouterr().err
    assert run(["trial", "score", str(trial), "--key", str(key), "-o", str(scores)]) == 0
    page = (scores / "blind_trial.md").read_text()
    assert "| no answer | 6 of 6 | 100 % |" in page
    assert page.count("timed out") == 6
    assert json.loads((scores / "scores.json").read_text())["rates"]["no answer"]["value"] == 1.0
    assert {path.name for path in (scores / "figures").iterdir()} >= {"classes.png", "names.png", "detection.png"}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["seal", "-o", "T"], "--key: got nothing"),
        (["seal", "-o", "T", "--development", "--key", "k"], "a key for a development trial"),
        (["seal", "-o", "T", "--key", "T/k"], "outside the trial"),
        (["seal", "-o", "T", "--development", "--cases", "3"], "--cases: got 3"),
        (["run", "T"], "trial T: got no such folder"),
        (["run", "T", "--workers", "0"], "--workers: got 0"),
        (["run", "T", "--time-limit", "0"], "--time-limit: got 0"),
        (["run", "T", "--half", "left"], "--half: got left; allowed: odd or even"),
        (["run", "T", "--cases", ","], "--cases: got nothing"),
        (["run", "T", "--diagnoses", "../T"], "--diagnoses: got ../T"),
        (["score", "T", "-o", "S"], "trial T: got no such folder"),
        (["score", "T", "T", "-o", "S"], "TRIAL: got two folders of one name"),
        (["compare", "A"], "trial compare: got 1 folders; allowed: pairs"),
        (["compare", "A", "B"], "A and B: got no case in both"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(tmp_path, monkeypatch, capsys, options, said) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["sloshlab"])
    assert run(["trial", *options]) == 1
    error = without_progress(capsys.readouterr().err)
    assert said in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def answered(trial: Path, diagnoses: str, answers: dict[str, dict]) -> None:
    """Verdicts in the place of a diagnosis."""
    for case, verdict in answers.items():
        place = trial / diagnoses / case
        place.mkdir(parents=True)
        (place / "verdict.json").write_text(json.dumps(verdict))
        outcome = Outcome(case, "done", 0, 10.0, 9.0, 300.0, "")
        (place / "outcome.json").write_text(json.dumps(asdict(outcome)))


def test_halves_of_several_trials_are_scored_and_looks_at_the_judging_one_noted(
    tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["sloshlab"])
    nothing = {"verdict": "nothing_missing", "effects": [], "probabilities": {"none": 0.9, "unknown": 0.1}}
    alarm = {"verdict": "unknown", "effects": [], "probabilities": {"none": 0.3, "unknown": 0.7}}
    for name in ("t1", "t2"):
        written_trial(Path(name), [truth(f"case_00{k}", "nothing", accepted=[[]]) for k in (1, 2, 3, 4)], None)
        answered(Path(name), "diagnoses", {"case_001": nothing, "case_002": alarm, "case_003": nothing})
        answered(Path(name), "diagnoses_again", {"case_001": nothing, "case_002": nothing})
    assert run(["trial", "score", "t1", "t2", "--half", "odd", "-o", "odd"]) == 0
    scores = json.loads(Path("odd", "scores.json").read_text())
    assert [mark["case"] for mark in scores["marks"]] == [f"t{k}/case_00{n}" for k in (1, 2) for n in (1, 3)]
    # always 0.9, always right
    assert scores["calibrations"]["answer given"]["error"] == pytest.approx(0.1)
    assert not Path("looks.csv").exists()
    assert run(["trial", "score", "t1", "t2", "--half", "even", "-o", "even"]) == 1
    assert "case_004: got not diagnosed" in capsys.readouterr().err
    assert not Path("looks.csv").exists()
    assert run(["trial", "score", "t1", "t2", "--cases", "1,2", "-o", "both"]) == 0
    header, look = Path("looks.csv").read_text().splitlines()
    assert header.startswith("date_utc,revision,trials,diagnoses,half,cases,false alarms")
    assert ",t1 t2,diagnoses,both,4,0.5 of 4," in look
    page = Path("both", "blind_trial.md").read_text()
    assert "| false alarms where nothing is missing | 4 | ≤ 2 % | 50 % | no | 15 % … 85 % | not met |" in page
    capsys.readouterr()
    assert (
        run(["trial", "compare", *(f"t{k}/{name}" for k in (1, 2) for name in ("diagnoses", "diagnoses_again"))])
        == 0
    )
    said = capsys.readouterr().out
    assert "same verdict: 2 of 4 (50.0%" in said
    assert "t2/diagnoses/case_002: unknown – nothing_missing" in said


def test_a_part_of_a_sealed_trial_is_not_scored(tmp_path, monkeypatch, capsys) -> None:
    pytest.importorskip("cryptography")
    monkeypatch.chdir(tmp_path)
    written_trial(Path("t"), [truth("case_001", "nothing", accepted=[[]])], KEY)
    assert run(["trial", "score", "t", "--half", "odd", "-o", "odd"]) == 1
    assert "got the sealed trial t; allowed: development trials" in capsys.readouterr().err


def test_without_a_step_it_is_a_usage_error(capsys) -> None:
    assert run(["trial", "weigh"]) == 2
