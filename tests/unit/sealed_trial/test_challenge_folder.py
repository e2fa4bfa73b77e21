"""The folder of a challenge: what belongs to it, and one line for everything that does not."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hand_made_challenges import RIG, TRUTHS, written_challenge
from hand_made_trials import truth, written_trial

from sealed_trial.challenge.challenge_folder import (
    LARGEST_CASE_BYTES,
    MOST_FILES,
    found_cases,
    is_challenge,
    require_cases,
    truths_in_reach,
)
from sealed_trial.sealing.locked_truths import MAGIC
from sloshlab.errors import InputError


def sparse(path: Path, n_bytes: int) -> None:
    """A file of which hardly anything is on the disk."""
    path.touch()
    os.truncate(path, n_bytes)


def test_cases_are_found_in_order_with_their_files_and_twins(tmp_path) -> None:
    cases = require_cases(written_challenge(tmp_path / "c"))
    assert [case.name for case in cases] == ["cart", "quiet"]
    assert cases[1].files == ("recordings/run_1.nc", "rig.toml")
    assert cases[0].twin == tmp_path / "c" / "cases" / "cart" / "twin.py"
    assert cases[1].twin is None
    assert cases[1].hashes()["rig.toml"] == hashlib.sha256(RIG.encode()).hexdigest()


def test_what_may_lie_in_a_challenge_is_no_defect(tmp_path) -> None:
    folder = written_challenge(tmp_path / "c")
    (folder / "README.md").write_text("two cases")
    (folder / "commitments.json").write_text("{}")
    (folder / "answers.json").write_text("{}")
    (folder / "diagnoses_perturbed_1").mkdir()
    (folder / "truths.locked").write_bytes(MAGIC + bytes(40))
    (folder / "cases" / "quiet" / "model.nc").write_bytes(b"model")
    assert len(require_cases(folder)) == 2


DEFECTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "truths within": (
        lambda c: (c / "truths.toml").write_text(TRUTHS),
        "'truths.toml': got no part of a challenge",
    ),
    "truths that are not locked": (
        lambda c: (c / "truths.locked").write_text("{}"),
        "'truths.locked': got no part",
    ),
    "a link beside": (lambda c: (c / "README.md").symlink_to("/etc/passwd"), "'README.md': got no part"),
    "answers through a link": (
        lambda c: [(c / "diagnoses").mkdir(), (c / "diagnoses" / "quiet").symlink_to(c.parent)],
        "'diagnoses/quiet': got a link",
    ),
    "words through a link": (
        lambda c: [
            (c / "diagnoses" / "quiet").mkdir(parents=True),
            (c / "diagnoses" / "quiet" / "stderr.txt").symlink_to(c.parent / "mine"),
        ],
        "'diagnoses/quiet/stderr.txt': got a link",
    ),
    "a name that leads out": (lambda c: (c / "cases" / "..quiet").mkdir(), "case '..quiet': got this name"),
    "a name with a line": (lambda c: (c / "cases" / "a\nb").mkdir(), r"case 'a\nb': got this name"),
    "a name that a terminal obeys": (lambda c: (c / "cases" / "a\x1b[2J").mkdir(), r"case 'a\x1b[2J'"),
    "a name too long": (lambda c: (c / "cases" / ("a" * 65)).mkdir(), "at most 63"),
    "a name of markdown": (lambda c: (c / "cases" / "a|b").mkdir(), "case 'a|b'"),
    "a file": (lambda c: (c / "cases" / "a").write_text(""), "case a: got a file"),
    "a case that is a link": (
        lambda c: (c / "cases" / "a").symlink_to(c / "cases" / "quiet"),
        "case a: got a link",
    ),
    "a recording that is a link": (
        lambda c: (c / "cases" / "quiet" / "recordings" / "x.nc").symlink_to("/etc/passwd"),
        "case quiet: 'recordings/x.nc': got a link",
    ),
    "a pipe": (lambda c: os.mkfifo(c / "cases" / "quiet" / "x.nc"), "case quiet: 'x.nc': got no regular file"),
    "a hint": (
        lambda c: (c / "cases" / "quiet" / "notes.txt").write_text("friction"),
        "case quiet: 'notes.txt': got no file of a case; allowed: rig.toml, model.toml or twin.py, recordings/",
    ),
    "a folder deeper": (
        lambda c: (c / "cases" / "quiet" / "recordings" / "old").mkdir(),
        "case quiet: 'recordings/old': got a folder",
    ),
    "no description": (
        lambda c: (c / "cases" / "quiet" / "rig.toml").unlink(),
        "case quiet: got neither rig.toml nor twin.py",
    ),
    "two descriptions": (
        lambda c: (c / "cases" / "cart" / "rig.toml").write_text(RIG),
        "case cart: got rig.toml and twin.py",
    ),
    "no recordings": (
        lambda c: (c / "cases" / "quiet" / "recordings" / "run_1.nc").unlink(),
        "case quiet: got no recordings/*.nc",
    ),
    "an empty recording": (
        lambda c: (c / "cases" / "quiet" / "recordings" / "run_1.nc").write_bytes(b""),
        "case quiet: recordings/run_1.nc: got 0 bytes",
    ),
    "a huge recording": (
        lambda c: sparse(c / "cases" / "quiet" / "recordings" / "run_2.nc", LARGEST_CASE_BYTES + 1),
        f"got {LARGEST_CASE_BYTES + 1} bytes; allowed: 1 … {LARGEST_CASE_BYTES}",
    ),
    "huge together": (
        lambda c: [sparse(c / "cases" / "quiet" / "recordings" / f"x{k}.nc", 2**30) for k in (1, 2)],
        "bytes together",
    ),
    "a huge rig": (
        lambda c: sparse(c / "cases" / "quiet" / "rig.toml", 1_000_001),
        "case quiet: rig.toml: got 1000001 bytes; allowed: 1 … 1000000",
    ),
    "too many files": (
        lambda c: [sparse(c / "cases" / "quiet" / "recordings" / f"x{k}.nc", 1) for k in range(MOST_FILES + 1)],
        "case quiet: got too many files",
    ),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_every_defect_is_one_line_and_the_only_one(name: str, tmp_path) -> None:
    spoil, said = DEFECTS[name]
    folder = written_challenge(tmp_path / "c")
    spoil(folder)
    _, defects = found_cases(folder)
    assert len(defects) == 1, [str(defect) for defect in defects]
    assert said in str(defects[0])
    assert str(defects[0]).isprintable()
    with pytest.raises(InputError):
        require_cases(folder)


def test_recordings_that_are_a_link_are_not_followed(tmp_path) -> None:
    folder = written_challenge(tmp_path / "c")
    recordings = folder / "cases" / "quiet" / "recordings"
    recordings.rename(tmp_path / "away")
    recordings.symlink_to(tmp_path / "away")
    cases, defects = found_cases(folder)
    assert [str(defect).partition(";")[0] for defect in defects] == [
        "case quiet: 'recordings': got a link",
        "case quiet: got no recordings/*.nc",
    ]
    assert cases[1].files == ("rig.toml",)


def test_several_defects_are_all_told(tmp_path) -> None:
    folder = written_challenge(tmp_path / "c")
    for name in ("a hint", "truths within", "two descriptions", "a name with a line"):
        DEFECTS[name][0](folder)
    assert len(found_cases(folder)[1]) == 4


def test_a_folder_that_is_no_challenge_is_said_to_be_none(tmp_path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        found_cases(tmp_path / "none")
    with pytest.raises(InputError, match="no folder cases"):
        found_cases(tmp_path)
    (tmp_path / "cases").mkdir()
    with pytest.raises(InputError, match="got 0 cases"):
        found_cases(tmp_path)


def test_trials_of_our_own_are_no_challenges(tmp_path) -> None:
    written_trial(tmp_path / "ours", [truth("case_001", "nothing", accepted=[[]])], None)
    assert not is_challenge(tmp_path / "ours")
    assert not is_challenge(tmp_path)
    folder = written_challenge(tmp_path / "c")
    assert is_challenge(folder)
    (folder / "commitments.json").write_text(json.dumps({"purpose": "challenge"}))
    assert is_challenge(folder)
    (folder / "commitments.json").write_text("[" * 100_000)
    assert not is_challenge(folder)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("t.toml", TRUTHS),
        ("t.json", '{"quiet": {"hidden": "nothing"}}'),
        ("t.json", '{"sloshlab_truths": 1, "cases": {}}'),
        ("t.csv", "case,hidden,block\nquiet,nothing,\n"),
    ],
)
def test_readable_truths_beside_a_challenge_are_found_and_other_files_are_not(tmp_path, name, content) -> None:
    folder = written_challenge(tmp_path / "here" / "c")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (folder.parent / "pyproject.toml").write_text('name = "the hidden laboratory"\n')
    assert truths_in_reach(folder, [elsewhere]) == ()
    for place in (folder.parent, elsewhere):
        (place / name).write_text(content)
        [defect] = truths_in_reach(folder, [elsewhere])
        assert f"readable truths in {place / name}" in str(defect)
        (place / name).unlink()
