"""What a device understands of what its hosts say, and how frames look to them.

A host may send anything. What is not understood is answered as real devices answer, or passed over;
nothing of it is kept longer than a line.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

from acquisition.wire.serial_frames import CommandFrame, CommandKind, parse

LONGEST_LINE = 4096


@dataclass
class Host:
    """Where the conversation with one host stands.

    Attributes
    ----------
    listens : bool
        Wants frames.
    has_started, has_stopped : bool
        Has asked the device to begin, to end.
    refused : bool
        Talks in a way that ends the connection.
    listens_from_s : float
        On the monotonic clock; before, nothing is sent, so that a host can finish what it is at.
    unread : bytes
        Beginning of a line or frame.
    """

    listens: bool = False
    has_started: bool = False
    has_stopped: bool = False
    refused: bool = False
    listens_from_s: float = 0.0
    unread: bytes = field(default=b"")


class Conversation(ABC):
    """The language of a device; the state of each host is its `Host`."""

    def greeting(self) -> bytes:
        """What a host is sent first."""
        return b""

    @abstractmethod
    def answer(self, host: Host, data: bytes) -> bytes:
        """Understand what a host says, note it in `host`, and answer."""


class SerialConversation(Conversation):
    """The serial protocol: START, STOP, SEND_CALIBRATION.

    Parameters
    ----------
    describe : callable
        Gives the calibration frame as it is now.
    """

    def __init__(self, describe: Callable[[], bytes]) -> None:
        self._describe = describe

    def answer(self, host: Host, data: bytes) -> bytes:
        """Obey the commands in `data`; everything else is passed over."""
        parsed = parse(host.unread + data)
        host.unread = parsed.rest
        commands = [frame.kind for frame in parsed.frames if isinstance(frame, CommandFrame)]
        for command in commands:
            if command == CommandKind.START:
                host.has_started, host.has_stopped = True, False
            elif command == CommandKind.STOP:
                host.has_stopped = True
        if {CommandKind.START, CommandKind.SEND_CALIBRATION} & set(commands):
            host.listens = True
        return self._describe() if CommandKind.SEND_CALIBRATION in commands else b""
