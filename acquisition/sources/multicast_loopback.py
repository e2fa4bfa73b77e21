"""CAN buses over multicast: on this computer, or, if somebody asks for it, on the network."""

from __future__ import annotations

import ipaddress
import os
import socket
from typing import Any, Final

from sloshlab.errors import SourceError

DEFAULT_GROUP: Final = "239.74.163.2"
"""python-can's own group for IPv4."""

# a million bytes hold a second of 8000 frames of some 100 bytes
RECEIVE_BUFFER_BYTES: Final = 8 << 20
"""Asked for; the system may give less (on Linux net.core.rmem_max)."""


def open_multicast_bus(group: str, port: int, *, fd: bool, exposed: bool, name: str | None = None) -> Any:
    """A bus over multicast.

    Parameters
    ----------
    group : str
        IPv4 multicast address; IPv6 only if `exposed`, since loopback interfaces have no route for it.
    port : int
    fd : bool
        Whether CAN FD frames are taken on the network; on this computer they always are.
    exposed : bool
        Speak and listen on the network, one hop far, instead of on this computer only.
    name : str, optional
        For error messages; ``can:udp_multicast?channel=GROUP&port=PORT`` by default.

    Returns
    -------
    can.BusABC

    Raises
    ------
    SourceError
        If `group` is no such address, or the bus cannot be opened or confined.
    """
    import can

    from acquisition.sources.loopback_bus import LoopbackMulticastBus

    name = name or f"can:udp_multicast?channel={group}&port={port}"
    _check_group(name, group, exposed)
    if exposed:
        try:
            bus = can.Bus(
                interface="udp_multicast", channel=group, port=port, hop_limit=1, fd=fd, ignore_config=True
            )
        except (can.CanError, OSError, ImportError) as error:
            raise SourceError(name, got=str(error)) from error
        _widen(bus.fileno())
        return bus
    try:
        return LoopbackMulticastBus(group, port, RECEIVE_BUFFER_BYTES)
    except (OSError, AttributeError) as error:
        raise SourceError(
            name,
            got=f"a socket that cannot be confined to this computer ({error})",
            remedy="use another interface, or expose=yes, by which all of the network can listen and send frames",
        ) from error


def _check_group(name: str, group: str, exposed: bool) -> None:
    try:
        address = ipaddress.ip_address(group)
    except ValueError:
        address = ipaddress.ip_address("0.0.0.0")
    # the confinement below is for IPv4
    if not address.is_multicast or (address.version == 6 and not exposed):
        raise SourceError(name, got=repr(group), allowed="a multicast address, for example " + DEFAULT_GROUP)


def _widen(fileno: int) -> None:
    # a copy of the descriptor, as python-can offers no way to its socket's options and this object closes its own
    with socket.socket(fileno=os.dup(fileno)) as same:
        same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
