"""Virtual flights are made, diagnosed and answered for by the commands that a person types."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, assert_one_line

from pipelines.command_line import run

MODEL = str(Path(__file__).parents[2] / "docs/examples/flight_wing.toml")


def flown(folder: Path, hide: str = "", seed: int = 5) -> Path:
    assert (
        run(["virtual", "flight", "--model", MODEL, "--hide", hide, "--seed", str(seed), "-o", str(folder)]) == 0
    )
    return folder


def verdict_of(case: Path) -> dict[str, Any]:
    # flagged: the runs that chose nothing are repeats of fitted ones
    assert run(["diagnose", str(case), "--no-report"]) == DONE_BUT_FLAGGED
    found: dict[str, Any] = json.loads((case / "diagnosis/verdict.json").read_text())
    return found


def test_a_flight_that_hides_nothing(tmp_path: Path) -> None:
    found = verdict_of(flown(tmp_path / "flight"))
    assert found["verdict"] == "nothing_missing"
    assert found["fit"]["heldout_runs"]


@pytest.mark.slow
def test_lift_that_the_twin_has_not_is_found(tmp_path: Path) -> None:
    found = verdict_of(flown(tmp_path / "flight", "lift_gain=0.2"))
    [effect] = found["effects"]
    assert (effect["name"], effect["block"]) == ("lift_gain", "aerodynamics")
    ratio = effect["parameters"]["ratio"]
    # the laboratory's own code says 0.2; its modes and strips are others
    assert ratio["estimate"] == pytest.approx(0.2, abs=0.005)
    blocks = {each["block"]: each["share"]["estimate"] for each in found["interface_cut"]["blocks"]}
    assert blocks["aerodynamics"] > blocks["tank"] - 0.05


def test_a_challenge_of_flights(tmp_path: Path, capsys: Any) -> None:
    challenge, truths = tmp_path / "challenge", tmp_path / "kept" / "truths.json"
    truths.parent.mkdir()
    arguments = ["virtual", "flight", "--model", MODEL, "--cases", "2", "--seed", "1", "--truths", str(truths)]
    assert run([*arguments, "-o", str(challenge)]) == 0
    assert sorted(path.name for path in (challenge / "cases").iterdir()) == ["case_001", "case_002"]
    assert not list(challenge.rglob("truths*"))
    assert run(["trial", "commit", str(challenge), str(truths), "-o", str(tmp_path / "kept/locked.json")]) == 0
    assert run(["trial", "check", str(challenge)]) == 0
    capsys.readouterr()


def test_bad_input(tmp_path: Path, capsys: Any) -> None:
    base = ["virtual", "flight", "-o", str(tmp_path / "flight")]
    for more, said in (
        ([], "--model"),
        (["--model", str(tmp_path / "absent.toml")], "absent.toml"),
        (["--model", MODEL, "--hide", "lift=0.2"], "lift_gain"),
        (["--model", MODEL, "--hide", "tank_9.fill_level=0.2"], "tank_9"),
        (["--model", MODEL, "--hide", "lift_gain=much"], "no number"),
        (["--model", MODEL, "--cases", "3"], "--truths"),
        (["--model", MODEL, "--cases", "3", "--truths", str(tmp_path / "flight/t.json")], "outside"),
    ):
        assert run([*base, *more]) == INPUT_IS_BAD
        assert_one_line(capsys.readouterr().err, said)
    assert not (tmp_path / "flight").exists()
