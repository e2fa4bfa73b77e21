"""Progress in a pipe: lines while a step takes long, none after its end."""

from __future__ import annotations

import threading
import time

import pytest
from progress_lines import without_progress

from pipelines.report import progress as module
from pipelines.report.progress import amounts


@pytest.fixture(autouse=True)
def _often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_LINE_EVERY_S", 0.05)


def test_a_long_step_is_no_silence(capsys: pytest.CaptureFixture[str]) -> None:
    """One report at its beginning, then nothing for many times the interval."""
    with amounts("searching") as advance:
        advance(1, 4, "the first step")
        time.sleep(0.6)
    said = capsys.readouterr().err
    lines = said.splitlines()
    assert len(lines) >= 3
    assert all("so far: the first step, 25 %" in line for line in lines[:-1])
    assert lines[-1].endswith("done")
    # what is no progress is left, its neighbours with the same words, too
    others = ("flagged: a sweep, 40 s long, is done\n", "sloshlab: got nothing so far\n")
    assert without_progress(said.join(others)) == "".join(others)


@pytest.mark.parametrize("fails", [False, True])
def test_nothing_is_said_after_the_end(fails: bool, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ZeroDivisionError) if fails else amounts("nothing"), amounts("searching") as advance:
        advance(1, 4, "the first step")
        if fails:
            raise ZeroDivisionError
    assert "progress in lines" not in [thread.name for thread in threading.enumerate()]
    capsys.readouterr()
    time.sleep(0.3)
    assert "searching" not in capsys.readouterr().err
