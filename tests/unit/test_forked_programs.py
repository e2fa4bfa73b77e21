"""Programs as forks of the tests end, say and obey as programs that were started anew do."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from forked_programs import ForkedProgram

from sloshlab import __version__

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="programs are forked on Linux alone")
SLOSHLAB = [sys.executable, "-m", "pipelines.command_line"]
WORKER = [sys.executable, "-m", "campaigns.worker_program"]


def is_of_the_tests(process: subprocess.Popen[Any]) -> bool:
    """A fork has the command line of what it was forked from."""
    return Path(f"/proc/{process.pid}/cmdline").read_bytes() == Path("/proc/self/cmdline").read_bytes()


def ended(words: Sequence[str], **options: Any) -> tuple[int, str, str]:
    with ForkedProgram(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options) as process:
        said, complained = process.communicate(timeout=60)
    return process.returncode, said, complained


def test_a_command_ends_and_says_as_one_that_was_started_anew() -> None:
    for words in (["--version"], ["info", "--no-such-option"]):
        started = subprocess.run([*SLOSHLAB, *words], capture_output=True, text=True, check=False)
        assert ended([*SLOSHLAB, *words]) == (started.returncode, started.stdout, started.stderr)
    assert __version__ in ended([*SLOSHLAB, "--version"])[1]


def test_the_folder_and_the_environment_are_those_that_are_given(tmp_path: Path) -> None:
    (tmp_path / "of_a_fork.py").write_text(
        "import os\ndef told(asked, share): return [os.environ['TOLD'], os.getcwd()]\n", encoding="utf-8"
    )
    mine = dict(os.environ)
    environment = {**mine, "TOLD": "this", "PYTHONPATH": str(tmp_path)}
    task = json.dumps({"function": "of_a_fork:told", "arguments": {}, "attempt": 1}) + "\n"
    streams: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with ForkedProgram(WORKER, **streams, cwd=tmp_path, env=environment) as worker:
        worker.stdin.write(task.encode())
        worker.stdin.flush()
        assert json.loads(worker.stdout.readline())["result"] == ["this", str(tmp_path)]
    assert dict(os.environ) == mine


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGTERM, 0)])
def test_a_worker_has_a_session_of_its_own_and_obeys_signals(number: signal.Signals, code: int) -> None:
    """A worker that is terminated while it waits ends as one without work."""
    options: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "start_new_session": True}
    with ForkedProgram(WORKER, **options) as worker:
        assert is_of_the_tests(worker)
        # its first answer says that it has its handlers
        worker.stdin.write(b'{"function": "os:getpid", "arguments": {}, "attempt": 1}\n')
        worker.stdin.flush()
        assert b"status" in worker.stdout.readline()
        assert os.getsid(worker.pid) == worker.pid
        assert set(os.listdir(f"/proc/{worker.pid}/fd")).isdisjoint({str(worker.stdin.fileno())})
        # one that has just answered does not listen yet
        while worker.poll() is None:
            worker.send_signal(number)
            time.sleep(0.05)
        assert worker.returncode == code


def test_other_programs_are_started() -> None:
    with ForkedProgram([sys.executable, "-c", "raise SystemExit(7)"]) as process:
        assert process.wait(60) == 7
