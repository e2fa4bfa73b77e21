"""`sloshlab demo`: concealed, found and shown, as a newcomer types it; and what it refuses."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from short_runs import refusal

from pipelines.command_line import run
from sealed_trial.demonstrations import DEMONSTRATIONS


@pytest.mark.slow
def test_nothing_is_hidden_and_nothing_is_claimed(tmp_path: Path, capfd: Any) -> None:
    out = tmp_path / "out"
    code = run(["demo", "nothing-hidden", "--no-open", "--json", "-o", str(out)])
    captured = capfd.readouterr()
    assert code == 0, captured.err
    lines = captured.out.splitlines()
    places = [
        next(k for k, line in enumerate(lines) if begins in line) for begins in ("1. CON", "2. FIND", "3. SHOW")
    ]
    assert places == sorted(places)
    # the fingerprint is on the terminal before the search, and nothing of the truth
    fingerprint = json.loads((out / "commitment.json").read_text())["commitment"]
    assert fingerprint[:16] in "\n".join(lines[: places[1]])
    assert any("RIGHT: nothing was hidden" in line for line in lines[places[2] :])
    assert str(out / "diagnosis" / "report.html") in captured.out
    told = json.loads(lines[-1])
    assert (told["right"], told["truth"], told["answered"]) == (True, "none", "none")
    verdict = json.loads((out / "diagnosis" / "verdict.json").read_text())
    assert told["heldout_after"] == verdict["fit"]["heldout_after"]
    assert "<h2" in (out / "diagnosis" / "report.html").read_text()
    assert json.loads((out / "truth.json").read_text())["effects"] == []


def test_all_demonstrations_are_listed(capsys: Any) -> None:
    assert run(["demo", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(DEMONSTRATIONS)


def test_what_cannot_be_shown_is_refused_in_one_line(tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "out"
    refusal(capsys, ["demo", "magic", "-o", str(out)], out, "got magic", "allowed: friction", "remedy: ")
    refusal(capsys, ["demo", "friction", "--seed", "-1", "-o", str(out)], out, "--seed: got -1")
    own = tmp_path / "own"
    own.mkdir()
    (own / "thesis.txt").write_text("mine")
    refusal(capsys, ["demo", "friction", "-o", str(own)], own, "somebody's own")


def test_the_ready_made_cases_have_the_hashes_of_their_manifest(repository: Path) -> None:
    folder = repository / "raw_data" / "cases"
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    del files["manifest.json"]
    assert manifest["seeds"] == {name: known.seed for name, known in DEMONSTRATIONS.items()}
    assert manifest["files"] == {
        name: {"bytes": path.stat().st_size, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for name, path in files.items()
    }
    assert {name.partition("/")[0] for name in files} == set(DEMONSTRATIONS)
