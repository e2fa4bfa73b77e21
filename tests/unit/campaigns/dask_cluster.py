"""A Dask cluster of processes of this machine, which tests may kill and start again."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path


class DaskCluster:
    """A scheduler and one worker with two threads.

    Parameters
    ----------
    folder : Path
        Takes what they say.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.folder_log = folder, folder / "log.txt"
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._running: list[subprocess.Popen[bytes]] = []

    def start_scheduler(self) -> None:
        """Start the scheduler, and wait until it listens."""
        words = ["dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--dashboard-address", ":0"]
        self._start(words)
        self.scheduler_pid = self._running[-1].pid
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.1)
        raise TimeoutError(self.folder_log.read_text())

    def start_worker(self) -> None:
        """Start a worker with two threads."""
        # no nanny: it would start the worker again by itself
        words = ["dask_worker", self.address, "--nthreads", "2", "--no-nanny", "--dashboard-address", ":0"]
        self._start([*words, "--local-directory", str(self.folder / "scratch")])

    def _start(self, words: list[str]) -> None:
        path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
        with self.folder_log.open("ab") as log:
            command = [sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]]
            environment = {**os.environ, "PYTHONPATH": path}
            self._running.append(
                subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)
            )

    def kill(self) -> None:
        """Kill the scheduler and all workers at once."""
        for process in self._running:
            os.kill(process.pid, signal.SIGKILL)
        for process in self._running:
            process.wait()
        self._running.clear()

    def kill_worker(self) -> None:
        """Kill the worker that was started last."""
        process = self._running.pop()
        process.kill()
        process.wait()
