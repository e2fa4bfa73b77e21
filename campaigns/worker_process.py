"""A process that works at one task after another, and is ended with all that it has started."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Final

from campaigns.task import Ending, Task
from campaigns.worker_program import PATIENCE_S

_LOOK_UP_S: Final = 0.2
_SESSION: Final = 3
"""Field of `/proc/PID/stat` after the name of the process (proc(5))."""
_READ_AT_ONCE_BYTES: Final = 1 << 16
_LARGEST_ANSWER_BYTES: Final = 64 << 20
_THREADS_OF_LIBRARIES: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class WorkerProcess:
    """A process of its own for tasks, one at a time.

    Parameters
    ----------
    one_core : bool
        Whether libraries compute on one core; results then have the same bytes on every machine of a kind.
    """

    def __init__(self, *, one_core: bool = True) -> None:
        self._one_core = one_core
        self._process: subprocess.Popen[bytes] | None = None
        self._unread = b""

    def carried_out(
        self,
        task: Task,
        *,
        attempt: int = 1,
        progressed: Callable[[float], None] = lambda share: None,
        stopping: threading.Event | None = None,
    ) -> Ending:
        """Let the process work at a task; return how it ended.

        Parameters
        ----------
        task : Task
        attempt : int
            How often it has been begun, this time included.
        progressed : callable
            Called with the share that is done.
        stopping : threading.Event, optional
            Once it is set the task is asked to stop and save.
        """
        began = time.monotonic()
        asked = {"function": task.function, "arguments": dict(task.arguments), "attempt": attempt}
        process = self._started()
        with contextlib.suppress(BrokenPipeError):  # it has died since: the end of its answers tells so
            _pipe(process.stdin).write(json.dumps(asked).encode() + b"\n")
            _pipe(process.stdin).flush()
        ending = self._ended(process, task, began, progressed, stopping or threading.Event())
        if ending.status in ("died", "timed_out", "stopped"):
            self.close()
        return Ending(ending.status, ending.result, ending.line, time.monotonic() - began, attempt)

    def _ended(
        self,
        process: subprocess.Popen[bytes],
        task: Task,
        began: float,
        progressed: Callable[[float], None],
        stopping: threading.Event,
    ) -> Ending:
        until = None if task.time_limit_s is None else began + task.time_limit_s
        patient_until: float | None = None
        while True:
            line = self._line(process)
            if line is not None:
                if not line:
                    return self._death(process, patient_until is not None)
                answer = json.loads(line)
                if "share" not in answer:
                    return Ending(answer["status"], answer.get("result"), answer.get("line", ""))
                progressed(answer["share"])
            now = time.monotonic()
            if patient_until is None and stopping.is_set():
                process.terminate()
                patient_until = now + PATIENCE_S
            if until is not None and now > until:
                return Ending("timed_out", line=f"took longer than {task.time_limit_s:g} s")
            if patient_until is not None and now > patient_until:
                return Ending("stopped")

    def _line(self, process: subprocess.Popen[bytes]) -> bytes | None:
        """The next answer; empty at the end of the pipe, None if there is none yet."""
        while b"\n" not in self._unread:
            if len(self._unread) > _LARGEST_ANSWER_BYTES:
                return b""
            answers = _pipe(process.stdout)
            with selectors.DefaultSelector() as selector:
                selector.register(answers, selectors.EVENT_READ)
                if not selector.select(_LOOK_UP_S):
                    return None
            more = os.read(answers.fileno(), _READ_AT_ONCE_BYTES)
            if not more:
                return b""
            self._unread += more
        line, _, self._unread = self._unread.partition(b"\n")
        return line

    def _death(self, process: subprocess.Popen[bytes], was_stopped: bool) -> Ending:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_LOOK_UP_S)
        kill_session(process.pid)
        code = process.wait()
        if was_stopped:
            return Ending("stopped")
        if code < 0:
            return Ending("died", line=f"its process was ended by {signal.Signals(-code).name}")
        return Ending("died", line=f"its process ended with code {code}")

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is None:
            return self._process
        self.close()
        environment = dict(os.environ)
        # modules are found where this program finds them
        environment["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(path or os.getcwd() for path in sys.path))
        if self._one_core:
            environment |= dict.fromkeys(_THREADS_OF_LIBRARIES, "1")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "campaigns.worker_program"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # bars and remarks of hundreds of analyses at once tell nobody anything
            stderr=subprocess.DEVNULL,
            env=environment,
            # a terminal sends Ctrl-C to all processes of its session at once
            start_new_session=True,
        )
        return self._process

    def close(self) -> None:
        """End the process and all that it has started; the next task starts another."""
        process, self._process, self._unread = self._process, None, b""
        if process is None:
            return
        kill_session(process.pid)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                _pipe(pipe).close()


def _pipe(pipe: IO[Any] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


def kill_session(session: int) -> None:
    """Kill every process of a session; where the system does not tell them, its first group.

    Parameters
    ----------
    session : int
        Number of the process that began it.
    """
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(session, signal.SIGKILL)
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):  # it has ended meanwhile, or is not ours
            after_name = (process / "stat").read_text().rpartition(")")[2].split()
            if int(after_name[_SESSION]) == session and after_name[0] != "Z":
                os.kill(int(process.name), signal.SIGKILL)
