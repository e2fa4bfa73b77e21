"""The recorder's side of the live page: a copy of everything goes to another process, and nothing waits for it."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from acquisition.recorder.journal_format import described_source
from acquisition.recorder.status import Event, RecorderStatus
from acquisition.samples.delivery import Block, Delivery
from acquisition.sources.interface import SourceInfo
from pipelines.live_page.access import LOOPBACK, is_loopback
from pipelines.live_page.page_messages import described_status
from pipelines.live_page.pipe_frames import joined, packed_blocks, packed_message
from pipelines.live_page.side_buffer import SideBuffer
from sloshlab.errors import InputError, MissingExtraError

_INTERVAL_S: Final = 0.05
_START_TIMEOUT_S: Final = 60.0
_END_TIMEOUT_S: Final = 5.0
_MOST_WAITING: Final = 256


@dataclass(frozen=True)
class PageSettings:
    """Where the page is served, and what it tells of the run beside its samples.

    Attributes
    ----------
    host : str
        Address to listen on.
    port : int
        0 is any free port.
    folder : Path
        Whose free space is shown.
    rig : Path
        Description of the rig, for the work of the liquid.
    """

    folder: Path
    rig: Path
    host: str = LOOPBACK[0]
    port: int = 0


class LivePage:
    """A page in the browser while a recording runs: an observer and a listener of the recorder.

    Use it as a context manager around the recording; the page is there from its begin on.

    Parameters
    ----------
    settings : PageSettings
    tell : callable
        Takes one line for a person, and whether it is a warning.

    Raises
    ------
    InputError
        On entering, if the address cannot be listened on.
    MissingExtraError
        If the packages that serve it are not installed.
    """

    def __init__(self, settings: PageSettings, tell: Callable[[str, bool], None]) -> None:
        self._settings, self._tell = settings, tell
        self._buffer = SideBuffer()
        self._messages: deque[bytes] = deque(maxlen=_MOST_WAITING)
        self._status: RecorderStatus | None = None
        self._mark: Callable[[str], None] | None = None
        self._is_ending = False
        self._is_gone = False
        self.url = ""

    def __enter__(self) -> Self:
        _require_packages()
        self._process = _started(self._settings)
        try:
            self.url = self._announced()
        except BaseException:
            self._process.kill()
            self._let_go()
            raise
        self._feeder = threading.Thread(target=self._feed, name="live page", daemon=True)
        self._hearer = threading.Thread(target=self._hear, name="marks of the live page", daemon=True)
        self._feeder.start()
        self._hearer.start()
        if not is_loopback(self._settings.host):
            self._tell(
                f"page exposed on {self._settings.host}, for more than this computer; "
                "whoever has its address sees every sample and may set marks",
                True,
            )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.finished({"lines": [], "flags": [" ".join(str(error).split()) or type(error).__name__]})
        self._is_ending = True
        self._feeder.join(_END_TIMEOUT_S)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_TIMEOUT_S)
        # nothing happens to one that has ended; both threads end with it
        self._process.kill()
        self._feeder.join()
        self._hearer.join()
        self._let_go()

    def begins(
        self, infos: Sequence[SourceInfo], metadata: Mapping[str, Any], mark: Callable[[str], None]
    ) -> None:
        """Describe the sources to the page."""
        self._mark = mark
        content = {
            "sources": [described_source(info) for info in infos],
            "attributes": dict(metadata.get("attributes", {})),
            "folder": str(self._settings.folder),
            "rig": str(self._settings.rig),
        }
        self._messages.append(packed_message("begin", content))

    def delivered(self, source: int, deliveries: Sequence[Delivery]) -> None:
        """Keep a copy for the page, if there is room."""
        if not self._is_gone:
            self._buffer.put(source, deliveries)

    def event(self, event: Event) -> None:
        """Tell the page what happened."""
        content = {
            "message": event.message, "is_failure": event.is_failure, "source": event.source,
            "is_mark": event.mark_ns is not None, "host_monotonic_ns": event.mark_ns or time.monotonic_ns(),
        }  # fmt: skip
        self._messages.append(packed_message("event", content))

    def status(self, status: RecorderStatus) -> None:
        """Show the state; one that was not sent yet is forgotten."""
        self._status = status

    def finished(self, summary: Mapping[str, Any]) -> None:
        """Show how the recording went."""
        content = {key: [str(line) for line in summary.get(key, ())] for key in ("lines", "flags")}
        self._messages.append(packed_message("finished", content))

    def _let_go(self) -> None:
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            # what could not be written any more is tried once more by closing
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()

    def _announced(self) -> str:
        """URL of the page, as soon as its process listens."""
        assert self._process.stdout is not None
        watchdog = threading.Timer(_START_TIMEOUT_S, self._process.kill)
        watchdog.start()
        line = self._process.stdout.readline()
        watchdog.cancel()
        said = json.loads(line) if line else {"refused": "no answer of its process"}
        if "ready" in said:
            return str(said["ready"])
        host, port = self._settings.host, self._settings.port
        raise InputError(
            f"--page on {host}:{port}",
            got=said["refused"],
            allowed="an address of this computer and a free port",
            remedy="another --page-port, or none for any that is free",
        )

    def _feed(self) -> None:
        """Send what waits, until the end; this thread may wait for the page as long as it likes."""
        assert self._process.stdin is not None
        try:
            while True:
                is_last = self._is_ending
                for frame in self._frames():
                    self._process.stdin.write(frame)
                self._process.stdin.flush()
                if is_last:
                    break
                time.sleep(_INTERVAL_S)
            self._process.stdin.close()
        # its process has ended
        except OSError:
            self._gone()

    def _frames(self) -> list[bytes]:
        # what describes the sources goes before their samples, and what tells the end behind them
        frames = [self._messages.popleft() for _ in range(len(self._messages))]
        finished = [frames.pop()] if frames and b'"about": "finished"' in frames[-1] else []
        blocks = [(source, one) for source, one in self._buffer.take() if isinstance(one, Block)]
        # before anything is described, nothing can be shown
        if self._mark is not None:
            frames += [packed_blocks(source, own) for source, own in joined(blocks)]
        status, self._status = self._status, None
        if status is not None:
            frames.append(packed_message("status", described_status(status, self._buffer.n_skipped)))
        return frames + finished

    def _hear(self) -> None:
        """Pass marks on that browsers set."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            said = json.loads(line)
            if self._mark is not None and isinstance(said.get("mark"), str):
                self._mark(said["mark"])
        self._gone()

    def _gone(self) -> None:
        if not self._is_ending and not self._is_gone:
            self._is_gone = True
            self._tell("live page: its process has ended; the recording goes on", True)


def _started(settings: PageSettings) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "pipelines.live_page.page_process", settings.host, str(settings.port)]
    return subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        # Ctrl-C is for the recorder, which ends the page when all is written
        start_new_session=True,
    )


def _require_packages() -> None:
    for package in ("starlette", "uvicorn", "websockets"):
        try:
            __import__(package)
        except ImportError as error:
            raise MissingExtraError(package, extra="live", purpose="the live page") from error
