"""CAN buses behind text on a line: a socketcand server, and an slcan adapter."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Final

from acquisition.sources.can_links import Received, TextLink
from acquisition.sources.serial_line import Line, LineLostError, open_line
from acquisition.wire.slcan_text import parse_slcan, slcan_send
from acquisition.wire.socketcand_text import parse_socketcand, socketcand_send
from sloshlab.errors import SourceError

SLCAN_BITRATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""Bitrates that the Lawicel commands S0 … S8 set."""

_OPEN: Final = b"O\r"
_CLOSE: Final = b"C\r"
_BUS_NAME: Final = re.compile(r"[A-Za-z0-9_.-]{1,31}")
# a server that never stops talking costs no more memory than this
_LONGEST_ANSWER_BYTES: Final = 1024
_MADE_UP: Final = b"< frame 101 0.000000 00 >"
"""Taken apart once before frames can come: what is compiled or loaded then takes seconds on a busy computer."""


def open_socketcand(
    host: str,
    port: int,
    bus: str,
    *,
    url: str,
    timeout_s: float,
    monotonic_ns: Callable[[], int] = time.monotonic_ns,
    sleep: Callable[[float], None] = time.sleep,
) -> TextLink:
    """Connect to a socketcand server and open one of its buses; frames come after `TextLink.start`.

    Parameters
    ----------
    host, port : str, int
    bus : str
        Name of the bus at the server, for example ``can0``.
    url : str
        Of the source, for error messages.
    timeout_s : float
        For all of the handshake.
    monotonic_ns, sleep : callable

    Raises
    ------
    SourceError
        If nobody listens, it is no socketcand, or it has no such bus.
    """
    # the name is sent within a message: a ">" in it would be a command of its own
    if not _BUS_NAME.fullmatch(bus):
        allowed = "the name of a bus, for example can0"
        raise SourceError(f"source {url}: channel", got=repr(bus)[:80], allowed=allowed)
    _parse_socketcand(_MADE_UP)
    address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    name = f"source {url}: {address}"
    line = open_line(f"socket://{address}", 0, name=name)
    deadline_ns = monotonic_ns() + int(timeout_s * 1e9)
    try:
        # one deadline for both answers; a server that trickles must not extend it
        rest = _answered(name, line, b"", b"hi", lambda: deadline_ns - monotonic_ns())
        line.write(f"< open {bus} >".encode())
        rest = _answered(name, line, rest, b"ok", lambda: deadline_ns - monotonic_ns())
    except BaseException:
        line.close()
        raise
    return TextLink(
        line,
        _parse_socketcand,
        _socketcand_frame,
        opening=b"< rawmode >",
        rest=rest,
        sleep=sleep,
    )


def _answered(name: str, line: Line, text: bytes, expected: bytes, remaining_ns: Callable[[], int]) -> bytes:
    """Wait for ``< expected >``; returns what came after it."""
    while b">" not in text:
        if remaining_ns() <= 0 or len(text) > _LONGEST_ANSWER_BYTES:
            raise _no_socketcand(name, text, expected)
        try:
            text += line.read(remaining_ns() * 1e-9)
        except LineLostError as error:
            raise _no_socketcand(name, text or error.got.encode(), expected) from error
    # two answers may come in one piece, and frames with the last: python-can's client breaks there
    message, _, rest = text.partition(b">")
    if message.strip().removeprefix(b"<").strip() != expected:
        raise _no_socketcand(name, message + b">", expected)
    return rest


def _no_socketcand(name: str, text: bytes, expected: bytes) -> SourceError:
    return SourceError(
        name,
        got=repr(text[:60])[1:] if text else "no answer",
        allowed=f"'< {expected.decode()} >', as socketcand says",
        remedy="check port and channel",
    )


def _socketcand_frame(arbitration_id: int, data: bytes, *, extended: bool, fd: bool) -> bytes:
    return socketcand_send(arbitration_id, data, extended=extended)


def _parse_socketcand(text: bytes) -> tuple[Received, bytes]:
    parsed = parse_socketcand(text)
    return Received(parsed.batch, parsed.n_error_frames, parsed.n_garbage_bytes), parsed.rest


def open_slcan(
    port: str, baudrate: int, bitrate: int, *, url: str, sleep: Callable[[float], None] = time.sleep
) -> TextLink:
    """Open the port of an slcan adapter; frames come after `TextLink.start`.

    Parameters
    ----------
    port : str
        A serial port, a pseudo-terminal or a URL of pyserial.
    baudrate : int
        Of the port.
    bitrate : int
        Of the bus, one of `SLCAN_BITRATES`; 0 leaves the adapter's own.
    url : str
        Of the source, for error messages.
    sleep : callable

    Raises
    ------
    SourceError
        If there is no such port or somebody else has it.
    """
    speed = f"S{SLCAN_BITRATES.index(bitrate)}\r".encode() if bitrate else b""
    return TextLink(
        open_line(port, baudrate, name=f"source {url}"),
        _parse_slcan,
        slcan_send,
        # an adapter that a killed program left open refuses everything else until it is closed
        opening=b"\r" + _CLOSE + speed + _OPEN,
        farewell=_CLOSE,
        sleep=sleep,
    )


def _parse_slcan(text: bytes) -> tuple[Received, bytes]:
    parsed = parse_slcan(text)
    return Received(parsed.batch, 0, parsed.n_garbage_bytes), parsed.rest
