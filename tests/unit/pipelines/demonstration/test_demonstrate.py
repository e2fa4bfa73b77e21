"""A demonstration's folder, its page, and what it refuses."""

from __future__ import annotations

import shutil
import sys
import webbrowser
from pathlib import Path

import pytest

from pipelines.demonstration import demonstrate as demonstrating
from pipelines.demonstration.demonstrate import demonstrate, list_lines, open_page
from pipelines.demonstration.sealed_cases import READY_MADE, TRUTH, conceal
from sealed_trial.demonstrations import DEMONSTRATIONS
from sealed_trial.sealing.sealed_case import CASE, COMMITMENT, LOCKED, read_published
from sloshlab.errors import AnalysisError, InputError


def files_of(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_the_list_has_every_name_once() -> None:
    assert [line.split()[0] for line in list_lines()] == list(DEMONSTRATIONS)


def test_a_drawn_case_is_concealed_with_its_truth_locked(tmp_path: Path) -> None:
    published, seed = conceal("nothing-hidden", 3, tmp_path / "out")
    assert seed == 3
    assert files_of(tmp_path / "out") == {f"{CASE}/{name}" for name in published.files} | {COMMITMENT, LOCKED}


def test_the_ready_made_case_is_copied_and_a_changed_one_refused(tmp_path: Path) -> None:
    published, seed = conceal("nothing-hidden", None, tmp_path / "out")
    assert seed == DEMONSTRATIONS["nothing-hidden"].seed
    assert read_published(READY_MADE / "nothing-hidden") == published == read_published(tmp_path / "out")
    changed = tmp_path / "ready"
    shutil.copytree(READY_MADE / "nothing-hidden", changed / "nothing-hidden")
    (changed / "nothing-hidden" / CASE / "rig.toml").write_text("[tank]\n")
    with pytest.raises(InputError, match="not what was published"):
        conceal("nothing-hidden", None, tmp_path / "other", changed)
    assert not (tmp_path / "other").exists()


def test_without_ready_made_cases_the_same_case_is_drawn(tmp_path: Path) -> None:
    drawn, _ = conceal("nothing-hidden", None, tmp_path / "drawn", tmp_path / "nothing here")
    assert (tmp_path / "drawn" / CASE / "rig.toml").read_bytes() == (
        READY_MADE / "nothing-hidden" / CASE / "rig.toml"
    ).read_bytes()
    assert drawn.files.keys() == read_published(READY_MADE / "nothing-hidden").files.keys()


def test_an_earlier_demonstration_is_taken_away_and_files_of_ones_own_are_not(tmp_path: Path) -> None:
    out = tmp_path / "out"
    conceal("nothing-hidden", 3, out)
    (out / TRUTH).write_text("{}")
    (out / CASE / "notes.txt").write_text("mine")
    conceal("nothing-hidden", 4, out)
    assert (out / CASE / "notes.txt").read_text() == "mine"
    assert not (out / TRUTH).exists()
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="files of somebody's own"):
        conceal("nothing-hidden", 3, tmp_path / "own")
    assert files_of(tmp_path / "own") == {"thesis.txt"}


def test_a_commitment_cannot_name_files_outside_the_case(tmp_path: Path) -> None:
    out = tmp_path / "out"
    conceal("nothing-hidden", 3, out)
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    text = (out / COMMITMENT).read_text().replace('"rig.toml"', '"../../mine.txt"')
    (out / COMMITMENT).write_text(text)
    conceal("nothing-hidden", 4, out)
    assert mine.read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "seed", "match"), [("magic", None, "allowed: friction"), ("friction", -1, "≥ 0")]
)
def test_a_name_and_a_seed_that_there_are_not_are_refused(
    name: str, seed: int | None, match: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=match):
        demonstrate(name, tmp_path / "out", print, seed=seed)
    assert not (tmp_path / "out").exists()


def test_a_diagnosis_that_ends_without_an_answer_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demonstrating, "DIAGNOSE", (sys.executable, "-c", "raise SystemExit(1)"))
    said: list[str] = []
    with pytest.raises(AnalysisError, match="exit code 1"):
        demonstrate("nothing-hidden", tmp_path / "out", said.append, opens_page=False)
    assert not (tmp_path / "out" / TRUTH).exists()


def test_the_diagnosing_process_is_given_the_case_and_neither_key_nor_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = tmp_path / "seen.txt"
    spy = (
        "import os, sys; from pathlib import Path; "
        f"Path({str(seen)!r}).write_text(repr((sys.argv, dict(os.environ)))); raise SystemExit(1)"
    )
    monkeypatch.setattr(demonstrating, "DIAGNOSE", (sys.executable, "-c", spy))
    with pytest.raises(AnalysisError):
        demonstrate("nothing-hidden", tmp_path / "out", lambda line: None, seed=987654)
    given = seen.read_text()
    assert str(tmp_path / "out" / CASE) in given
    assert "987654" not in given
    # beside the case: only what is locked
    assert files_of(tmp_path / "out") - {f"{CASE}/{name}" for name in read_published(tmp_path / "out").files} == {
        COMMITMENT,
        LOCKED,
    }


def test_no_page_is_opened_without_a_display(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "get", lambda: opened.append("asked"))
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not open_page(tmp_path / "report.html")
    assert opened == []


@pytest.mark.parametrize(
    ("browser", "is_opened"),
    [(webbrowser.GenericBrowser("lynx"), False), (webbrowser.BackgroundBrowser("firefox"), True)],
)
def test_a_browser_in_the_terminal_is_no_place_for_a_page(
    browser: webbrowser.BaseBrowser, is_opened: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "get", lambda: browser)
    monkeypatch.setattr(type(browser), "open", lambda self, url, *more: True)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert open_page(tmp_path / "report.html") == is_opened
