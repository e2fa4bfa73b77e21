"""Two thousand damaged files for each reader, and all that was found so far; `make fuzz` goes on from there."""

from __future__ import annotations

import ctypes
import dataclasses
from pathlib import Path

import pytest

from sloshlab.errors import RigError
from tests.fuzz import campaign
from tests.fuzz.campaign import Findings, content_of, fuzzed, outcome_of
from tests.fuzz.corpus import FOUND
from tests.fuzz.targets import TARGETS

N_FILES = 2000


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_damaged_files_end_in_one_line(name: str) -> None:
    findings = Findings()
    fuzzed(name, 0, N_FILES, findings)
    assert findings.wrong == []
    assert findings.n_inputs == N_FILES


@pytest.mark.parametrize("found", FOUND)
def test_what_was_found_is_one_line(found: str, tmp_path: Path) -> None:
    name, content = FOUND[found]
    TARGETS[name].prepare(tmp_path)
    path = tmp_path / TARGETS[name].file_name
    path.write_bytes(content)
    outcome = outcome_of(name, path)
    assert not outcome.startswith("!"), outcome


def test_a_number_is_always_the_same_file_and_another_one_another() -> None:
    contents = [content_of("csv", number) for number in (1, 2, 1)]
    assert contents[0] == contents[2]
    assert contents[0] != contents[1]


@pytest.mark.parametrize(
    ("reader", "said"),
    [
        (lambda path: 1 / 0, "! ZeroDivisionError"),
        (lambda path: ctypes.string_at(0), "! exit -11"),
        (lambda path: bytearray(1 << 40), "! no memory left"),
    ],
)
def test_the_campaign_finds_what_is_wrong(reader, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that fails at one of three files is found at that file alone."""

    def read(path: Path) -> None:
        if path.read_bytes() == content_of("rig", 1):
            reader(path)
        raise RigError("rig")

    monkeypatch.setitem(TARGETS, "rig", dataclasses.replace(TARGETS["rig"], read=read))
    # in a fork instead of in a new program, which would not know the reader of this test
    monkeypatch.setattr(campaign.subprocess, "run", _in_fork)
    findings = Findings()
    fuzzed("rig", 0, 3, findings)
    assert [line[: len(f"rig 1: {said}")] for line in findings.wrong] == [f"rig 1: {said}"]


def _in_fork(command: list[str], **options: object) -> object:
    """Like `subprocess.run` of ``python -m tests.fuzz --one``, by a fork of this process."""
    import os
    import subprocess
    import tempfile

    name, number = command[-2:]
    with tempfile.NamedTemporaryFile() as said:
        child = os.fork()
        if child == 0:
            import faulthandler

            faulthandler.disable()
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, TARGETS[name].file_name)
                path.write_bytes(content_of(name, int(number)))
                Path(said.name).write_text(outcome_of(name, path))
            os._exit(0)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return subprocess.CompletedProcess(command, code, Path(said.name).read_text(), "")
