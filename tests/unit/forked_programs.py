"""Programs of the project as forks of the tests, where `make test` wants a quick answer.

A new interpreter spends two to four seconds of computing to import what the tests have imported already. A fork of
them has it: still a process of its own, with its signals, exit code, session, environment, folder and streams.
`make test-all` starts every program anew, and so do tests of how programs start and end.
"""

from __future__ import annotations

import atexit
import contextlib
import faulthandler
import gc
import inspect
import io
import os
import runpy
import signal
import subprocess
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import pytest

from sloshlab.netcdf_lock import NETCDF_LOCK

_MODULES = ("campaigns.worker_program", "pipelines.command_line")
_LAST_STANDARD_STREAM = 2
_FLUSHING_FAILED = 120
"""Exit code of an interpreter that cannot write what it still holds at its end."""
_USUAL: type[subprocess.Popen[Any]] = subprocess.Popen
_SIGNATURE = inspect.signature(getattr(subprocess.Popen, "_execute_child"))  # noqa: B009 - private, typed by nobody


@contextlib.contextmanager
def programs_as_forks() -> Iterator[None]:
    """Within the block programs of the project are forks, in `make test` on Linux."""
    with pytest.MonkeyPatch.context() as patches:
        if os.environ.get("SLOSHLAB_FEWER_EXAMPLES") and sys.platform == "linux":
            patches.setattr(subprocess, "Popen", ForkedProgram)
        yield


class ForkedProgram(_USUAL):  # type: ignore[misc, valid-type]
    """`subprocess.Popen` that forks where it would start a program of the project, and starts every other."""

    def _execute_child(self, *arguments: Any) -> None:
        asked = _SIGNATURE.bind(self, *arguments).arguments
        program = _program(asked)
        if program is None:
            super()._execute_child(*arguments)
            return
        # no other thread is within the netCDF library at this moment: in the fork it would stay there
        with NETCDF_LOCK, warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of forks of a process with threads
            child = os.fork()
            if child == 0:
                _become(program, asked)
        self.pid = child
        self._child_created = True
        self._close_pipe_fds(
            *(asked[name] for name in ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite"))
        )


def _program(asked: Mapping[str, Any]) -> Callable[[], object] | None:
    """What a command runs in this interpreter, if it is a program of the project."""
    words = asked["args"]
    if isinstance(words, str | bytes) or asked["shell"] or asked["executable"] or asked["preexec_fn"]:
        return None
    words = [str(word) for word in words]
    if words[:2] == [sys.executable, "-m"] and words[2] in _MODULES:
        return lambda: runpy.run_module(words[2], run_name="__main__", alter_sys=True)
    if words[0] == str(Path(sys.executable).with_name("sloshlab")):
        from pipelines.command_line import main

        return main
    return None


def _become(program: Callable[[], object], asked: Mapping[str, Any]) -> NoReturn:
    """Leave behind what is of the tests, run the program, and end."""
    code = 1
    try:
        _leave_the_tests(asked)
        code = _exit_code(program)
        # what an interpreter does at its end
        getattr(threading, "_shutdown")()  # noqa: B009
        getattr(atexit, "_run_exitfuncs")()  # noqa: B009
        code = _flushed(code)
    finally:
        os._exit(code)


def _leave_the_tests(asked: Mapping[str, Any]) -> None:
    # files of the tests are no garbage here: collected, they would close those that the program opens
    gc.freeze()
    getattr(atexit, "_clear")()  # noqa: B009
    faulthandler.disable()
    warnings.resetwarnings()
    for unusual in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", unusual)
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)) and number not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
    if asked["start_new_session"]:
        os.setsid()
    if asked.get("process_group", -1) >= 0:
        os.setpgid(0, asked["process_group"])
    _take_streams([asked[name] for name in ("p2cread", "c2pwrite", "errwrite")], asked["pass_fds"])
    if asked["cwd"] is not None:
        os.chdir(asked["cwd"])
    if asked["env"] is not None:
        os.environ.clear()
        os.environ.update({os.fsdecode(name): os.fsdecode(value) for name, value in asked["env"].items()})
    words = [str(word) for word in asked["args"]]
    sys.orig_argv = words
    sys.argv = words[2:] if words[1:2] == ["-m"] else words
    sys.path[:0] = [os.getcwd(), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]


def _take_streams(given: Sequence[int], kept: Sequence[int]) -> None:
    """Standard streams as given, and no other file of the tests but those that are kept."""
    for number, descriptor in enumerate(given):
        if descriptor >= 0:
            os.dup2(descriptor, number, inheritable=True)
    for descriptor in map(int, os.listdir("/proc/self/fd")):
        if descriptor > _LAST_STANDARD_STREAM and descriptor not in kept:
            with contextlib.suppress(OSError):  # that of the listing itself
                os.close(descriptor)
    sys.stdin = sys.__stdin__ = io.TextIOWrapper(io.BufferedReader(io.FileIO(0, "rb", closefd=False)))
    for name, number, errors in (("stdout", 1, "strict"), ("stderr", 2, "backslashreplace")):
        buffer = io.BufferedWriter(io.FileIO(number, "wb", closefd=False))
        stream = io.TextIOWrapper(buffer, errors=errors, line_buffering=number == 2 or os.isatty(number))
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


def _exit_code(program: Callable[[], object]) -> int:
    try:
        program()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return int(end.code or 0) & 0xFF
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:  # noqa: BLE001 - told as an interpreter tells it
        traceback.print_exc()
        return 1
    return 0


def _flushed(code: int) -> int:
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            return _FLUSHING_FAILED
    return code
