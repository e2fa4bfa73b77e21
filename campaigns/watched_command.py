"""A command in a process group of its own: ended when its time is over, processor and memory measured."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_MEMORY_EVERY_S: Final = 0.3
"""What the system keeps as the peak of a process, ru_maxrss, begins with that of the process which started it."""
_GROUP: Final = 2
"""Field of `/proc/PID/stat` after the name of the process (proc(5))."""
_LAST_BYTES: Final = 2000
_LAST_CHARACTERS: Final = 500


@dataclass(frozen=True)
class CommandEnding:
    """How a command ended.

    Attributes
    ----------
    is_timed_out : bool
        Whether its time was over.
    exit_code : int
        Negative: the signal that ended it.
    wall_s, processor_s, memory_mib : float
        Of the process and its children; what they share of their memory counts once.
    last_words : str
        End of its stderr.
    """

    is_timed_out: bool
    exit_code: int
    wall_s: float
    processor_s: float
    memory_mib: float
    last_words: str


def run_watched(words: Sequence[str], errors: Path, time_limit_s: float) -> CommandEnding:
    """Run a command, its stderr into a file; whatever ends this function ends the command and its children.

    Parameters
    ----------
    words : sequence of str
    errors : Path
    time_limit_s : float
        By the clock.
    """
    with errors.open("w+b") as stderr:
        started = time.monotonic()
        process = subprocess.Popen(
            list(words),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            # not a session: what ends all processes of this one's session must end them, too
            process_group=0,
        )
        try:
            is_timed_out, code, processor_s, memory_mib = _waited(process.pid, started + time_limit_s)
        except BaseException:
            _kill_group(process.pid)
            process.wait()
            raise
        wall_s = time.monotonic() - started
        process.returncode = code  # was waited for by its number, for its use of processor and memory
        stderr.seek(0, os.SEEK_END)
        stderr.seek(max(0, stderr.tell() - _LAST_BYTES))
        last = (stderr.read().decode(errors="replace").strip().splitlines() or [""])[-1][-_LAST_CHARACTERS:]
    return CommandEnding(is_timed_out, code, wall_s, processor_s, memory_mib, last)


def _waited(pid: int, until: float) -> tuple[bool, int, float, float]:
    """Whether its time was over, exit code, processor seconds and peak memory [MiB] of a child."""
    is_timed_out, largest_mib, looked_at = False, 0.0, 0.0
    while True:
        found, wait_status, usage = os.wait4(pid, os.WNOHANG)
        if found:
            peak_mib = largest_mib or usage.ru_maxrss / 1024
            return is_timed_out, os.waitstatus_to_exitcode(wait_status), usage.ru_utime + usage.ru_stime, peak_mib
        if time.monotonic() > until:
            is_timed_out = True
            _kill_group(pid)
        if time.monotonic() - looked_at > _MEMORY_EVERY_S:
            largest_mib, looked_at = max(largest_mib, _memory_mib(pid)), time.monotonic()
        time.sleep(0.05)


def _kill_group(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def _memory_mib(group: int) -> float:
    """Memory of all processes of a group, what they share counted once; zero where the system does not tell."""
    total_kib = 0
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):  # it has ended meanwhile, or is not ours
            after_name = (process / "stat").read_text().rpartition(")")[2].split()
            if int(after_name[_GROUP]) == group:
                lines = (process / "smaps_rollup").read_text().splitlines()
                total_kib += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return total_kib / 1024
