"""A serial line that plays a script on a clock of its own, so that no test waits."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.sources.driver_counters import Counts
from acquisition.sources.serial_line import LineLostError
from sloshlab.errors import SourceError

Piece = bytes | Exception


class Script:
    """What happens when: bytes arrive, lines break, ports are missing.

    Parameters
    ----------
    events : list of (float, bytes or Exception)
        In order of time [s]: bytes that arrive, or the error that `read` raises.
    answers : callable, optional
        ``answers(request) -> bytes`` that arrive at once.
    missing_until_s : list of float, optional
        One for each connection: until when connecting fails.
    """

    def __init__(
        self,
        events: list[tuple[float, Piece]],
        answers: Callable[[bytes], bytes] | None = None,
        missing_until_s: list[float] | None = None,
    ) -> None:
        self.now_s = 100.0
        self.events = [(100.0 + at_s, piece) for at_s, piece in events]
        self.answers = answers or (lambda request: b"")
        self.missing_until_s = [100.0 + each for each in missing_until_s or []]
        self.sent: list[tuple[float, bytes]] = []
        self.slept_s: list[float] = []
        self.n_reads = self.n_connections = self.n_attempts = self.n_closed = 0
        self.arrived: list[bytes] = []
        self.unwritable = False
        self.counts: Counts = {}

    def monotonic_ns(self) -> int:
        return round(self.now_s * 1e9)

    def utc_ns(self) -> int:
        return 10**18 + self.monotonic_ns()

    def sleep(self, duration_s: float) -> None:
        assert duration_s >= 0
        self.slept_s.append(duration_s)
        self.now_s += duration_s

    def connect(self, target: str, baudrate: int) -> ScriptedLine:
        self.n_attempts += 1
        self.target, self.baudrate = target, baudrate
        if self.missing_until_s and self.now_s < self.missing_until_s[0]:
            raise SourceError(f"serial:{target}", got="no such port")
        self.missing_until_s = self.missing_until_s[1:]
        self.n_connections += 1
        return ScriptedLine(self)


class ScriptedLine:
    """One connection."""

    def __init__(self, script: Script) -> None:
        self._script, self.closed = script, False

    def read(self, timeout_s: float) -> bytes:
        assert not self.closed
        assert timeout_s >= 0
        script = self._script
        script.n_reads += 1
        if script.arrived:
            data, script.arrived = b"".join(script.arrived), []
            return data
        if not script.events or script.events[0][0] > script.now_s + timeout_s:
            script.now_s += timeout_s
            return b""
        at_s, piece = script.events.pop(0)
        script.now_s = max(script.now_s, at_s)
        if isinstance(piece, Exception):
            raise piece
        return piece

    def write(self, data: bytes) -> None:
        assert not self.closed
        if self._script.unwritable:
            raise LineLostError("serial:x", got="the connection was lost (write)")
        self._script.sent.append((round(self._script.now_s - 100.0, 6), data))
        answer = self._script.answers(data)
        if answer:
            self._script.arrived.append(answer)

    def driver_counts(self) -> Counts:
        return {} if self.closed else self._script.counts

    def close(self) -> None:
        self._script.n_closed += not self.closed
        self.closed = True
