"""`sloshlab trial` as a user types it: sealed, run out of time, scored; and what it refuses."""

from __future__ import annotations

import json

import pytest

from pipelines.command_line import run
from sealed_trial.sealing.key import PREFIX


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
        (["score", "T", "-o", "S"], "trial T: got no such folder"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(tmp_path, monkeypatch, capsys, options, said) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["sloshlab"])
    assert run(["trial", *options]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_without_a_step_it_is_a_usage_error(capsys) -> None:
    assert run(["trial", "weigh"]) == 2
