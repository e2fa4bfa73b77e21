"""What hosts say to a CAN adapter: the socketcand protocol and the Lawicel (slcan) commands."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Final

from acquisition.devices.conversation import LONGEST_LINE, Conversation, Host
from acquisition.wire.can_frames import START, STOP, read_control_frame
from acquisition.wire.can_layout import COMMAND, COMMAND_ID

GRACE_S: Final = 0.3
"""Between the last word of the opening handshake and the first frame.

Clients take the answer to ``rawmode`` as one piece: a frame that came with it would break their handshake.
"""

_SEND: Final = re.compile(rb"send ([0-9A-Fa-f]{1,8}) ([0-8])((?: [0-9A-Fa-f]{1,2}){0,8})")
_SLCAN_FRAME: Final = re.compile(rb"(?:t([0-9A-Fa-f]{3})|T([0-9A-Fa-f]{8}))([0-8])((?:[0-9A-Fa-f]{2}){0,8})")
_SLCAN_OTHER_FRAME: Final = re.compile(rb"[rRdDbB][0-9A-Fa-f]{4,140}")


def note_command(host: Host, arbitration_id: int, data: bytes) -> None:
    """Obey a frame from the host if it is the host's command."""
    said = read_control_frame(COMMAND, data) if arbitration_id == COMMAND_ID else None
    if said is not None and said["command"] == START:
        host.has_started, host.has_stopped = True, False
    elif said is not None and said["command"] == STOP:
        host.has_stopped = True


class SocketcandConversation(Conversation):
    """A socketcand server with one bus: ``open``, ``rawmode``, ``send``, ``echo``.

    Parameters
    ----------
    bus : str
        Name of the bus.
    now_s : callable
        Monotonic clock [s].
    """

    def __init__(self, bus: str, *, now_s: Callable[[], float] = time.monotonic) -> None:
        self._bus, self._now_s = bus.encode(), now_s

    def greeting(self) -> bytes:
        """``< hi >``."""
        return b"< hi >"

    def answer(self, host: Host, data: bytes) -> bytes:
        """Answer every ``< … >`` in `data`."""
        *messages, rest = (host.unread + data).split(b">")
        # nothing of what a host sends is kept longer than a line
        host.refused = len(rest) > LONGEST_LINE
        host.unread = rest[:LONGEST_LINE]
        return b"".join(self._answer_to(host, message.strip().removeprefix(b"<").strip()) for message in messages)

    def _answer_to(self, host: Host, message: bytes) -> bytes:
        if message == b"open " + self._bus:
            return b"< ok >"
        if message.startswith(b"open "):
            # let go only after the answer has been sent: a client that asked for another bus is to learn why
            host.refused = True
            return b"< error could not open bus >"
        if message == b"rawmode":
            host.listens = host.has_started = True
            # the device starts at once; only its frames wait
            host.listens_from_s = self._now_s() + GRACE_S
            return b"< ok >"
        if message == b"echo":
            return b"< echo >"
        sent = _SEND.fullmatch(message)
        if sent:
            note_command(host, int(sent[1], 16), bytes(int(byte, 16) for byte in sent[3].split()))
            return b""
        return b"< error unknown command >"


class SlcanConversation(Conversation):
    """An adapter that speaks Lawicel's ASCII commands; ``O`` opens the bus, ``C`` closes it."""

    def answer(self, host: Host, data: bytes) -> bytes:
        """Answer every line in `data`."""
        *lines, rest = (host.unread + data).split(b"\r")
        if len(rest) > LONGEST_LINE:
            rest = b""
        host.unread = rest
        return b"".join(self._answer_to(host, line.strip(b"\n")) for line in lines)

    def _answer_to(self, host: Host, line: bytes) -> bytes:
        frame = _SLCAN_FRAME.fullmatch(line)
        if frame:
            note_command(host, int(frame[1] or frame[2], 16), bytes.fromhex(frame[4].decode()))
            return b"z\r" if frame[1] else b"Z\r"
        if line in (b"O", b"L"):
            host.listens = host.has_started = True
        elif line == b"C":
            host.listens = False
        elif line == b"V":
            return b"V0101\r"
        elif line == b"N":
            return b"NSLSH\r"
        elif line == b"F":
            return b"F00\r"
        elif _SLCAN_OTHER_FRAME.fullmatch(line):
            return b"z\r"
        # settings of bit rate, filter and time stamps mean nothing here; a real adapter says yes to them
        elif line and line[:1] not in b"SsYZMmXWQU":
            return b"\a"
        return b"\r"
