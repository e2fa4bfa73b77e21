"""A device on a bus of python-can: ``virtual``, ``udp_multicast``, or hardware."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from acquisition.devices.can_conversation import note_command
from acquisition.devices.conversation import Host
from acquisition.devices.endpoint import Endpoint
from acquisition.devices.frames import FrameArray, FrameKind
from sloshlab.errors import SourceError

# a bus where others talk without end must not keep the device from its own frames
_UNREAD_AT_ONCE: Final = 100
_BURST_FRAMES = 64
_LONGEST_STALL_S = 10.0


class BusEndpoint(Endpoint):
    """A node of a bus; ``host_command`` starts and stops it.

    Parameters
    ----------
    open_bus : callable
        Opens the bus.
    url : str
        For the host.
    fd : bool
        Whether long frames are of CAN FD.
    runs_freely : bool
    frames_per_s : float or None
        Not more than so many, where the bus itself would lose what comes faster.
    sleep, now_s : callable
    """

    def __init__(
        self,
        open_bus: Callable[[], Any],
        url: str,
        *,
        fd: bool = False,
        runs_freely: bool = False,
        frames_per_s: float | None = None,
        sleep: Callable[[float], None] = time.sleep,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._open_bus, self._url, self._fd = open_bus, url, fd
        self._runs_freely, self._frames_per_s = runs_freely, frames_per_s
        self._sleep, self._now_s = sleep, now_s
        self._bus: Any = None
        self._host = Host()
        self._next_s = 0.0

    def open(self) -> str:
        """Join the bus."""
        self._bus = self._called(self._open_bus)
        return self._url

    @property
    def is_started(self) -> bool:
        """Once a host has said so."""
        return self._runs_freely or self._host.has_started

    @property
    def is_stopped(self) -> bool:
        """Once a host has said so."""
        return self.is_started and self._host.has_stopped

    @property
    def is_heard(self) -> bool:
        """A bus does not know; yes while it is there."""
        return self._bus is not None

    @property
    def has_hosts(self) -> bool:
        """A bus does not know."""
        return False

    def serve(self, timeout_s: float) -> None:
        """Listen for the host's command."""
        if self._bus is None:
            self._sleep(timeout_s)
            return
        for _ in range(_UNREAD_AT_ONCE):
            message = self._called(self._bus.recv, max(timeout_s, 0.0))
            timeout_s = 0.0
            if message is None:
                return
            if not message.is_error_frame:
                note_command(self._host, message.arbitration_id, bytes(message.data))

    def send(self, frames: FrameArray, *, is_given_up: Callable[[], bool]) -> bool:
        """Send one message after the other."""
        if self._bus is None:
            return False
        messages = self._messages(frames)
        for start in range(0, len(messages), _BURST_FRAMES):
            burst = messages[start : start + _BURST_FRAMES]
            self._pace(len(burst))
            for message in burst:
                if not self._sent(message, is_given_up):
                    return False
            self.serve(0.0)
            if is_given_up():
                return False
        return True

    def _sent(self, message: Any, is_given_up: Callable[[], bool]) -> bool:
        """Send one message; while the queue of a listener is full, wait for a while."""
        import can

        try:
            # python-can's virtual bus waits here while the queue of a listener is full
            self._bus.send(message, timeout=_LONGEST_STALL_S)
        except can.CanError as error:
            if is_given_up():
                return False
            raise SourceError(self._url, got=str(error)) from error
        return True

    def _pace(self, n_frames: int) -> None:
        if self._frames_per_s is None:
            return
        now_s = self._now_s()
        if self._next_s > now_s:
            self._sleep(self._next_s - now_s)
        # never from the past: after a pause frames must not come in a burst that the bus would lose
        self._next_s = max(self._next_s, now_s) + n_frames / self._frames_per_s

    def _messages(self, frames: FrameArray) -> list[Any]:
        import can

        columns = (frames["kind"].tolist(), frames["id"].tolist(), frames["length"].tolist(), frames["data"])
        return [
            can.Message(
                arbitration_id=arbitration_id,
                is_extended_id=False,
                is_error_frame=kind == FrameKind.ERROR,
                is_fd=self._fd and length > 8,
                data=data[:length].tobytes(),
            )
            for kind, arbitration_id, length, data in zip(*columns, strict=True)
        ]

    def _called(self, function: Callable[..., Any], *arguments: Any) -> Any:
        import can

        try:
            return function(*arguments)
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
            raise SourceError(self._url, got=str(error)[:200] or type(error).__name__) from error

    def is_read(self) -> bool:
        """A bus does not know."""
        return True

    def unplug(self) -> None:
        """Leave the bus."""
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def plug_in(self) -> None:
        """Join it again."""
        self._bus = self._called(self._open_bus)

    def close(self) -> None:
        """Leave the bus."""
        self.unplug()
