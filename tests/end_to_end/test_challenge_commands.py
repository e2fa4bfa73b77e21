"""A challenge as two people do it: committed to, checked, run, frozen, scored; and every way to get it wrong."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from progress_lines import without_progress

from pipelines.command_line import run
from tests.unit.sealed_trial.hand_made_challenges import TRUTHS, answering, verdict, written_challenge

pytestmark = pytest.mark.usefixtures("programs_are_forks")

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = REPOSITORY / "docs" / "challenge.md"
RIGHT = {
    "quiet": verdict("nothing_missing"),
    "cart": verdict("named", "cubic_stiffness", stiffness_n_per_m3=[2.9e5, 3.1e5]),
}


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """A folder to work in, with a challenge, and truths and key in `kept`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["sloshlab"])
    written_challenge(Path("c"))
    Path("kept").mkdir()
    Path("kept", "t.toml").write_text(TRUTHS)
    return tmp_path


def answered(folder: Path, monkeypatch, answers: dict, n_workers: int = 1) -> None:
    """Answers of a stand-in for the diagnosis, frozen; each worker is an interpreter that has to be started."""
    elsewhere = folder / "kept"
    monkeypatch.setattr("pipelines.diagnosis.challenge.DIAGNOSE", answering(elsewhere, answers))
    assert run(["trial", "run", "c", "--trust-code", "--workers", str(n_workers)]) == 0


def test_a_challenge_with_locked_truths_is_counted_by_the_rules_of_every_trial(here, monkeypatch, capsys) -> None:
    pytest.importorskip("cryptography")
    assert run(["trial", "check", "c"]) == 0
    assert "truths not committed to" in capsys.readouterr().out
    assert run(["trial", "commit", "c", "kept/t.toml", "-o", "kept/t.locked", "--key", "kept/key"]) == 0
    said = capsys.readouterr().out
    assert Path("kept/t.locked").stat().st_mode & 0o777 == 0o600
    assert b"cubic" not in Path("kept/t.locked").read_bytes() + Path("c/commitments.json").read_bytes()
    [digest] = re.findall(r"SHA-256 of it: ([0-9a-f]{64})", said)
    assert (
        digest
        == subprocess.run(
            ["sha256sum", "c/commitments.json"], capture_output=True, text=True, check=True
        ).stdout.partition(" ")[0]
    )
    assert run(["trial", "check", "c", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1]) == {
        "cases": 2,
        "defects": [],
        "own_twins": ["cart"],
    }
    answered(here, monkeypatch, RIGHT, n_workers=2)
    frozen = json.loads(Path("c/answers.json").read_text())["digest"]
    assert f"publish its digest: {frozen}" in capsys.readouterr().out
    # twins are named to the diagnosis, and only they
    assert Path("c/diagnoses/cart/called.txt").read_text() == "--twin c/cases/cart/twin.py"
    assert Path("c/diagnoses/quiet/called.txt").read_text() == ""
    assert run(["trial", "score", "c", "--truths", "kept/t.locked", "-o", "scores"]) == 1
    assert "locked truths and no key" in capsys.readouterr().err
    assert run(["trial", "score", "c", "--truths", "kept/t.locked", "--key", "kept/key", "-o", "scores"]) == 0
    scores = json.loads(Path("scores/scores.json").read_text())
    assert {mark["case"]: mark["right"] for mark in scores["marks"]} == {"cart": True, "quiet": True}
    assert scores["rates"]["clear single effects named in the right block"]["value"] == 1.0
    # 0.3 N/cm³ lies within 2.9 … 3.1 × 10⁵ N/m³
    assert scores["rates"]["intervals that hold the truth"]["value"] == 1.0
    page = Path("scores/blind_trial.md").read_text()
    assert page.startswith("# Blind trial (a challenge)")
    assert "is the one committed to before the answers were given" in page
    assert frozen in page


def test_a_changed_truth_is_said_and_not_counted(here, monkeypatch, capsys) -> None:
    assert run(["trial", "commit", "c", "kept/t.toml", "-o", "kept/t.json"]) == 0
    answered(here, monkeypatch, {**RIGHT, "cart": verdict("named", "coulomb_friction")})
    kept = json.loads(Path("kept/t.json").read_text())
    kept["cases"]["cart"]["truth"]["effects"][0]["name"] = "coulomb_friction"
    Path("kept/t.json").write_text(json.dumps(kept))
    capsys.readouterr()
    assert run(["trial", "score", "c", "--truths", "kept/t.json", "-o", "scores"]) == 3
    assert "flagged: case cart: the truth is not the one committed to; not counted\n" in capsys.readouterr().err
    scores = json.loads(Path("scores/scores.json").read_text())
    assert [mark["case"] for mark in scores["marks"]] == ["quiet"]
    assert (
        "- Not counted: `cart`, the truth is not the one committed to."
        in Path("scores/blind_trial.md").read_text()
    )
    # with no other truth there is nothing to count
    del kept["cases"]["quiet"]
    Path("kept/t.json").write_text(json.dumps(kept))
    assert run(["trial", "score", "c", "--truths", "kept/t.json", "-o", "scores"]) == 1
    assert "at least one truth that counts" in capsys.readouterr().err


def test_truths_that_nobody_committed_to_are_counted_and_flagged(here, monkeypatch, capsys) -> None:
    answered(here, monkeypatch, {**RIGHT, "cart": verdict("named", "coulomb_friction")})
    assert run(["trial", "score", "c", "--truths", "kept/t.toml", "-o", "scores"]) == 3
    assert "flagged: truths that nobody committed to" in capsys.readouterr().err
    assert "**Nobody committed to these truths**" in Path("scores/blind_trial.md").read_text()
    scores = json.loads(Path("scores/scores.json").read_text())
    assert scores["rates"]["wrong names anywhere"]["successes"] == 1


@pytest.mark.slow
def test_a_name_that_the_vocabulary_lacks_is_outside_and_said_to_be(here, monkeypatch, capsys) -> None:
    Path("kept/t.toml").write_text(TRUTHS.replace("cubic_stiffness", "gear_rattle"))
    assert run(["trial", "commit", "c", "kept/t.toml", "-o", "kept/t.json"]) == 0
    assert "cart: a name that the vocabulary lacks; the right answer is `unknown`" in capsys.readouterr().out
    answered(here, monkeypatch, {**RIGHT, "cart": verdict("unknown", "unknown")})
    assert run(["trial", "score", "c", "--truths", "kept/t.json", "-o", "scores"]) == 0
    scores = json.loads(Path("scores/scores.json").read_text())
    assert scores["rates"]["outside the vocabulary, unknown with the right block"]["value"] == 1.0


@pytest.mark.slow
def test_answers_that_were_changed_after_the_freeze_are_not_scored(here, monkeypatch, capsys) -> None:
    assert run(["trial", "commit", "c", "kept/t.toml", "-o", "kept/t.json"]) == 0
    answered(here, monkeypatch, {**RIGHT, "cart": verdict("nothing_missing")})
    Path("c/diagnoses/cart/verdict.json").write_text(json.dumps(RIGHT["cart"]))
    capsys.readouterr()
    for command in (["score", "c", "--truths", "kept/t.json", "-o", "scores"], ["run", "c", "--trust-code"]):
        assert run(["trial", *command]) == 1
        assert "case cart: got a case or an answer that was changed after the freeze" in capsys.readouterr().err
    assert not Path("scores").exists()


@pytest.mark.slow
def test_some_cases_alone_are_answered_and_nothing_is_frozen(here, monkeypatch, capsys) -> None:
    monkeypatch.setattr("pipelines.diagnosis.challenge.DIAGNOSE", answering(here / "kept", RIGHT))
    assert run(["trial", "run", "c", "--cases", "quiet"]) == 0
    assert not Path("c/answers.json").exists()
    assert not Path("c/diagnoses/cart").exists()
    capsys.readouterr()
    assert run(["trial", "score", "c", "--truths", "kept/t.toml", "-o", "scores"]) == 1
    assert "no frozen answers" in capsys.readouterr().err


@pytest.mark.parametrize("content", ["{}", "[]", "[" * 70_000, '{"case": "quiet"}'])
def test_answers_that_came_with_a_folder_are_told_and_believed_by_nobody(content, here, capsys) -> None:
    place = Path("c/diagnoses/quiet")
    place.mkdir(parents=True)
    (place / "outcome.json").write_text(content)
    assert run(["trial", "check", "c"]) == 0
    assert "1 answers are there already; remove c/diagnoses unless they are your own" in capsys.readouterr().out
    assert run(["trial", "run", "c", "--cases", "quiet"]) == 1
    error = without_progress(capsys.readouterr().err)
    assert "c/diagnoses/quiet/outcome.json: got something else" in error
    assert error.count("\n") == 1


def damaged(name: str, content: bytes) -> None:
    Path("c", "cases", name).write_bytes(content)


REFUSED = {
    "code that nobody trusts": (
        lambda: None,
        ["run", "c"],
        "got 1 twins that are Python modules, such as cart/twin.py",
    ),
    "halves": (lambda: None, ["run", "c", "--half", "odd"], "--half: got odd cases of a challenge"),
    "no such case": (lambda: None, ["run", "c", "--cases", "loud"], "--cases: got loud"),
    "truths in reach": (
        lambda: Path("t.toml").write_text(TRUTHS),
        ["run", "c", "--trust-code"],
        "got readable truths in",
    ),
    "a defect of many": (
        lambda: [damaged("quiet/a.txt", b"x"), damaged("quiet/b.txt", b"x")],
        ["run", "c"],
        "NAME.nc; 1 more; `sloshlab trial check c` lists all",
    ),
    "truths within": (
        lambda: Path("c/README.md").write_text(TRUTHS),
        ["commit", "c", "c/README.md", "-o", "kept/t.json"],
        "truths c/README.md: got a place within the challenge",
    ),
    "kept within": (
        lambda: None,
        ["commit", "c", "kept/t.toml", "-o", "c/t.json"],
        "-o c/t.json: got a place within",
    ),
    "key within": (
        lambda: None,
        ["commit", "c", "kept/t.toml", "-o", "kept/t.json", "--key", "c/key"],
        "allowed: a file outside the trial's folder",
    ),
    "kept twice": (
        lambda: Path("kept/t.json").write_text("mine"),
        ["commit", "c", "kept/t.toml", "-o", "kept/t.json"],
        "a file that is there already",
    ),
    "committed twice": (
        lambda: Path("c/commitments.json").write_text("{}"),
        ["commit", "c", "kept/t.toml", "-o", "kept/t.json"],
        "commitments c/commitments.json: got a file that is there already",
    ),
    "a truth too few": (
        lambda: Path("kept/t.toml").write_text('[quiet]\nhidden = "nothing"'),
        ["commit", "c", "kept/t.toml", "-o", "kept/t.json"],
        "case cart: got no truth",
    ),
    "a parameter of nothing": (
        lambda: Path("kept/t.toml").write_text(TRUTHS.replace("stiffness_n_per_m3", "force_n")),
        ["commit", "c", "kept/t.toml", "-o", "kept/t.json"],
        "case cart: structure.cubic_stiffness: force_n: got no parameter of this effect",
    ),
    "a tank of a twin that has none": (
        lambda: Path("kept/t.toml").write_text(TRUTHS.replace("structure", "tank").replace("cubic_s", "s")),
        ["commit", "c", "kept/t.toml", "-o", "kept/t.json"],
        "truth of cart: block: got tank; allowed: excitation, structure or sensor",
    ),
    "no truths": (lambda: None, ["score", "c", "-o", "scores"], "or no --truths"),
    "a part": (
        lambda: None,
        ["score", "c", "--truths", "kept/t.toml", "--cases", "quiet", "-o", "scores"],
        "got a challenge in parts",
    ),
    "no challenge": (lambda: None, ["check", "kept"], "challenge kept: got no folder cases"),
    "nothing": (lambda: None, ["check", "none"], "challenge none: got no such folder"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_done_is_said_in_one_line(name: str, here, capsys) -> None:
    spoil, words, said = REFUSED[name]
    spoil()
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    assert run(["trial", *words]) == 1
    captured = capsys.readouterr()
    assert said in captured.err
    assert without_progress(captured.err).count("\n") == 1
    assert captured.out == ""
    assert {path: path.read_bytes() for path in here.rglob("*") if path.is_file()} == before


def test_every_defect_has_a_line_of_its_own_and_no_code_is_run(here, capsys) -> None:
    assert run(["trial", "commit", "c", "kept/t.toml", "-o", "kept/t.json"]) == 0
    damaged("quiet/recordings/run_1.nc", Path("c/cases/quiet/recordings/run_1.nc").read_bytes()[:1500])
    damaged("quiet/rig.toml", b'[twin]\ntank_model = "frozen"\n')
    Path("truths.json").write_text('{"quiet": {"hidden": "nothing"}}')
    capsys.readouterr()
    assert run(["trial", "check", "c"]) == 1
    lines = without_progress(capsys.readouterr().err).splitlines()
    assert len(lines) == 5
    for line, said in zip(
        lines,
        (
            "readable truths in",
            "case quiet: recordings/run_1.nc: got a file that was changed",
            "case quiet: rig.toml: got a file that was changed",
            "case quiet: recording c/cases/quiet/recordings/run_1.nc: got",
            "case quiet: rig c/cases/quiet/rig.toml",
        ),
        strict=True,
    ):
        assert line.startswith("sloshlab: ")
        assert said in line


def test_a_rig_that_names_files_elsewhere_is_refused(here, capsys) -> None:
    rig = Path("c/cases/quiet/rig.toml")
    rig.write_text(rig.read_text().replace('"frozen"', '"rom"\nparameters = { rom = "../../../kept/key.nc" }'))
    assert run(["trial", "check", "c"]) == 1
    error = without_progress(capsys.readouterr().err)
    assert "got the path '../../../kept/key.nc'; allowed: files of its own case" in error
    assert error.count("\n") == 1


@pytest.mark.slow
def test_the_walk_through_of_the_page_runs_as_it_stands(tmp_path, monkeypatch) -> None:
    """Every line of it, typed in an empty folder; the truths are those that were put into the cases."""
    pytest.importorskip("cryptography")
    text = PAGE.read_text(encoding="utf-8")
    script = re.search(r"^`make_cases.py`:\n\n```py\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = re.search(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert script is not None
    assert lines is not None
    (tmp_path / "make_cases.py").write_text(script[1], encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    commands = {"python": [sys.executable], "sloshlab": [sys.executable, "-m", "pipelines.command_line"]}
    for line in lines[1].splitlines():
        program, *words = shlex.split(line, comments=True)
        done = subprocess.run(
            [*commands[program], *words], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    scores = json.loads((tmp_path / "scores" / "scores.json").read_text())
    assert {mark["case"]: (mark["kind"], mark["column"]) for mark in scores["marks"]} == {
        "hardening": ("single", "right name"),
        "quiet": ("nothing", "nothing missing"),
    }
    assert scores["rates"]["intervals that hold the truth"]["value"] == 1.0
