"""What drivers and the system count of data that never reached this program: ports, CAN interfaces, sockets.

A port whose buffer runs over, a CAN controller that is read too late and a socket that is full drop data without
a word to the reader; each keeps a count. Where the platform has none, nothing is counted.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

from acquisition.samples.delivery import Trouble, TroubleKind

INTERVAL_NS: Final = 500_000_000
"""Counters are looked at this often."""

INTERFACES: Path = Path("/sys/class/net")

# linux/serial.h, struct serial_icounter_struct: eleven int, the last seven of which follow, and nine reserved
_TIOCGICOUNT: Final = 0x545D
_PORT_COUNTS: Final = struct.Struct("<20I")
_PORT_COUNTERS: Final = {
    6: ("framing errors", TroubleKind.LINE_ERROR),
    7: ("overruns of the port", TroubleKind.OVERRUN),
    8: ("parity errors", TroubleKind.LINE_ERROR),
    10: ("overruns of the driver's buffer", TroubleKind.OVERRUN),
}
# linux/if_link.h, struct rtnl_link_stats64: each frame that was lost is in one of these
_LOST_FRAMES: Final = ("rx_dropped", "rx_over_errors", "rx_fifo_errors", "rx_missed_errors")
# asm-generic/socket.h SO_MEMINFO and linux/sock_diag.h SK_MEMINFO_DROPS
_SO_MEMINFO: Final = 55
_SOCKET_MEMORY: Final = struct.Struct("=9I")
_DROPS: Final = 8


class Counter(NamedTuple):
    """One counter: what it counts, as which trouble, and the number at which it comes round to 0."""

    name: str
    kind: TroubleKind
    modulus: int


Counts = Mapping[Counter, int]


def nothing_counted() -> Counts:
    """Of what has no counters."""
    return {}


class DriverLosses:
    """What the counters of one connection have grown by.

    Parameters
    ----------
    read : callable
        The counts now; what it had counted before this is made is not told.
    now_ns : int
        Monotonic clock.
    """

    def __init__(self, read: Callable[[], Counts], now_ns: int) -> None:
        self._read, self._counts, self._looked_ns = read, dict(read()), now_ns

    def grown(self, now_ns: int, *, at_once: bool = False) -> list[Trouble]:
        """A trouble for each counter that has grown since the last look; none before it is time to look again."""
        if not at_once and now_ns - self._looked_ns < INTERVAL_NS:
            return []
        self._looked_ns = now_ns
        troubles = []
        for counter, count in self._read().items():
            before = self._counts.get(counter, 0)
            # a counter of 32 bits comes round; one of 64 bits that falls was reset with its interface
            growth = (count - before) % counter.modulus if counter.modulus <= 1 << 32 else count - before
            growth = count if growth < 0 else growth
            self._counts[counter] = count
            if growth:
                troubles.append(Trouble(counter.kind, f"{counter.name}: {growth} more", growth, now_ns))
        return troubles


def port_counts(descriptor: int) -> Counts:
    """Counts of a serial port by TIOCGICOUNT; pseudo-terminals and many USB adapters have none."""
    # the number of the request means something else elsewhere
    if sys.platform != "linux":
        return {}
    import fcntl

    try:
        answer = fcntl.ioctl(descriptor, _TIOCGICOUNT, bytes(_PORT_COUNTS.size))
    # the latter for a port that was closed
    except (OSError, ValueError):
        return {}
    counts = _PORT_COUNTS.unpack(answer)
    return {Counter(name, kind, 1 << 32): counts[place] for place, (name, kind) in _PORT_COUNTERS.items()}


def interface_counts(interface: str) -> Counts:
    """Counts of a network interface of Linux, such as ``can0``, since it came up."""
    folder = INTERFACES / interface / "statistics"
    counts = {
        Counter(f"{name} of {interface}", TroubleKind.OVERRUN, 1 << 64): count
        for name in _LOST_FRAMES
        if (count := _number_in(folder / name)) is not None
    }
    n_wrong = _number_in(folder / "rx_errors")
    if n_wrong is not None:
        # drivers of CAN count a frame that ran over among the wrong ones, too
        n_wrong = max(0, n_wrong - (_number_in(folder / "rx_over_errors") or 0))
        counts[Counter(f"other rx_errors of {interface}", TroubleKind.LINE_ERROR, 1 << 64)] = n_wrong
    return counts


def _number_in(path: Path) -> int | None:
    try:
        return int(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def socket_counts(descriptor: int) -> Counts:
    """What Linux dropped because a socket was full: frames of a CAN socket, datagrams of UDP."""
    try:
        # a copy of the descriptor, as this object closes its own
        with socket.socket(fileno=os.dup(descriptor)) as same:
            memory = same.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _SOCKET_MEMORY.size)
    except OSError:
        return {}
    if len(memory) < _SOCKET_MEMORY.size:
        return {}
    full = Counter("drops of a full socket", TroubleKind.OVERRUN, 1 << 32)
    return {full: _SOCKET_MEMORY.unpack(memory)[_DROPS]}
