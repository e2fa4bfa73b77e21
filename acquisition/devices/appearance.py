"""Where a simulated device appears: a URL becomes a place that hosts can open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from acquisition.devices.bus_endpoint import BusEndpoint
from acquisition.devices.can_conversation import SlcanConversation, SocketcandConversation
from acquisition.devices.can_text import slcan_text, socketcand_text
from acquisition.devices.connection import ListeningSocket, PseudoTerminal
from acquisition.devices.conversation import SerialConversation
from acquisition.devices.endpoint import Endpoint, StreamEndpoint
from acquisition.devices.frames import FrameArray
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.sources.interface import SourceURL
from acquisition.sources.multicast_loopback import DEFAULT_GROUP, open_multicast_bus
from acquisition.sources.urls import URLOptions
from sloshlab.errors import InputError, SourceError

LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
_FRAMES_PER_S_BY_MULTICAST = 4000.0
_MULTICAST_PORT = 43113
_SOCKET = "socket://"


@dataclass(frozen=True)
class Appearance:
    """How a device appears, as its URL says.

    Attributes
    ----------
    url : SourceURL
    transport : str
        ``serial`` or ``can``.
    interface : str
        ``pty`` or ``socket``; ``socketcand``, ``slcan`` or an interface of python-can.
    device : str
        Name of the device.
    fd : bool
        CAN FD.
    dbc : Path or None
        Where a CAN device writes its DBC file.
    host, port : str, int
        Where it listens.
    channel : str
        Name of the bus, or path of the serial port.
    options : dict
        What is passed on to python-can.
    is_exposed : bool
        Whether others than this computer reach it.
    """

    url: SourceURL
    transport: str
    interface: str
    device: str
    fd: bool = False
    dbc: Path | None = None
    host: str = "127.0.0.1"
    port: int = 0
    channel: str = ""
    options: tuple[tuple[str, Any], ...] = ()
    is_exposed: bool = False

    @property
    def listens(self) -> bool:
        """Whether it opens a network port."""
        return self.interface in ("socket", "socketcand", "udp_multicast")

    def exposure(self) -> str:
        """What anybody can do who reaches the port."""
        where = f"{self.host}:{self.port or 'a free port'}"
        if self.interface == "udp_multicast":
            where = f"multicast group {self.channel}"
        return (
            f"exposed: {self.device} on {where}, for more than this computer; "
            "whoever reaches it can read every sample and stop the device"
        )


def appearance(url: SourceURL, *, number: int, expose: str | None = None) -> Appearance:
    """Understand the URL of ``--as``.

    Parameters
    ----------
    url : SourceURL
        ``serial:PATH``, ``serial:socket://127.0.0.1:PORT``, ``can:socketcand?port=…&dbc=…``,
        ``can:slcan?channel=PATH&dbc=…``, ``can:virtual?channel=…&dbc=…``, ``can:udp_multicast?…``.
    number : int
        Of the device, from 1, for its name.
    expose : str, optional
        Address to listen on instead of the loopback interface.

    Raises
    ------
    SourceError
        If it cannot be understood.
    """
    options = URLOptions(url)
    device = options.device(f"device_{number}")
    if url.scheme == "serial":
        found = _serial(url, device, expose)
    elif url.scheme == "can":
        found = _can(url, options, device, expose)
    else:
        raise SourceError(f"--as {url.text}", got=f"scheme {url.scheme!r}", allowed="serial, can")
    options.refuse_others()
    return found


def _serial(url: SourceURL, device: str, expose: str | None) -> Appearance:
    if not url.target.startswith(_SOCKET):
        if not url.target:
            raise SourceError(f"--as {url.text}", got="no path", allowed="serial:PATH")
        return Appearance(url, "serial", "pty", device, channel=url.target)
    host, _, port = url.target.removeprefix(_SOCKET).rpartition(":")
    if not port.isdecimal() or int(port) > 65535:
        raise SourceError(f"--as {url.text}", got=url.target, allowed="serial:socket://127.0.0.1:PORT")
    return Appearance(url, "serial", "socket", device, host=_bound(url, host, expose), port=int(port))


def _can(url: SourceURL, options: URLOptions, device: str, expose: str | None) -> Appearance:
    dbc, fd = options.text("dbc"), options.yes("fd", False)
    if not dbc:
        raise SourceError(
            f"--as {url.text}", got="no dbc", allowed="dbc=FILE.dbc, where the device writes its DBC"
        )
    if url.target == "socketcand":
        if fd:
            remedy = "use slcan, udp_multicast or virtual"
            raise SourceError(f"--as {url.text}", got="fd=yes", allowed="classic frames", remedy=remedy)
        host = _bound(url, options.text("host", "127.0.0.1") or "", expose)
        port = options.integer("port", 0, lowest=0, highest=65535)
        channel = options.text("channel", "can0") or ""
        return Appearance(url, "can", "socketcand", device, fd, Path(dbc), host, port, channel)
    channel = options.text("channel") or ""
    if not channel and url.target != "udp_multicast":
        raise SourceError(f"--as {url.text}", got="no channel", allowed="channel=…")
    if url.target == "slcan":
        return Appearance(url, "can", "slcan", device, fd, Path(dbc), channel=channel)
    passed = {key: value for key, value in url.options.items() if key not in ("dbc", "fd", "device", "channel")}
    for key in passed:
        options.text(key)
    if url.target == "udp_multicast":
        channel = channel or DEFAULT_GROUP
        passed = {"port": str(options.integer("port", _MULTICAST_PORT, lowest=1, highest=65535))}
    more = tuple((key, int(value) if value.isdecimal() else value) for key, value in passed.items())
    return Appearance(
        url, "can", url.target, device, fd, Path(dbc), channel=channel, options=more, is_exposed=bool(expose)
    )


def _bound(url: SourceURL, host: str, expose: str | None) -> str:
    if expose:
        return expose
    if host not in LOOPBACK:
        remedy = "give --expose HOST if others shall reach the device"
        raise SourceError(f"--as {url.text}", got=f"host {host}", allowed=", ".join(LOOPBACK), remedy=remedy)
    return host


def endpoint(
    found: Appearance,
    laboratory: LaboratoryTime,
    describe: Callable[[], bytes],
    *,
    n_hosts: int = 1,
    runs_freely: bool = False,
) -> Endpoint:
    """Make the place.

    Parameters
    ----------
    found : Appearance
    laboratory : LaboratoryTime
        For the time stamps of CAN frames.
    describe : callable
        Gives the calibration frame of a serial device.
    n_hosts, runs_freely : int, bool
        As for `StreamEndpoint`.
    """
    if n_hosts > 1 and found.interface != "socketcand":
        raise InputError("--wait-clients", got=str(n_hosts), allowed=f"1 for {found.url.text}")

    def stamped(frames: FrameArray) -> bytes:
        return socketcand_text(frames, laboratory.utc_s(frames["due_s"]))

    def stream(door: Any, conversation: Any, text: Callable[[FrameArray], bytes], url: str) -> Endpoint:
        return StreamEndpoint(
            door, conversation, text, lambda at: url.format(at=at), n_hosts=n_hosts, runs_freely=runs_freely
        )

    dbc = quote(str(found.dbc))
    if found.transport == "serial":
        door = PseudoTerminal(Path(found.channel)) if found.interface == "pty" else _socket(found, most=1)
        url = f"serial:{quote(found.channel)}" if found.interface == "pty" else "serial:socket://{at}"
        return stream(door, SerialConversation(describe), lambda frames: b"".join(frames["bytes"]), url)
    if found.interface == "socketcand":
        url = f"can:socketcand?host={_reachable(found.host)}&port={{at}}&channel={quote(found.channel)}&dbc={dbc}"
        return stream(_Port(found.host, found.port), SocketcandConversation(found.channel), stamped, url)
    fd = "&fd=yes" if found.fd else ""
    url = f"can:{found.interface}?channel={quote(found.channel)}&dbc={dbc}{fd}"
    if found.interface == "slcan":
        terminal = PseudoTerminal(Path(found.channel))
        return stream(terminal, SlcanConversation(), lambda frames: slcan_text(frames, fd=found.fd), url)
    others = "".join(f"&{key}={value}" for key, value in found.options)
    pace = _FRAMES_PER_S_BY_MULTICAST if found.interface == "udp_multicast" else None
    return BusEndpoint(
        lambda: _opened_bus(found), url + others, fd=found.fd, runs_freely=runs_freely, frames_per_s=pace
    )


def _socket(found: Appearance, *, most: int) -> ListeningSocket:
    return ListeningSocket(found.host, found.port, most=most)


class _Port(ListeningSocket):
    """A listening socket that is known by its port alone."""

    def open(self) -> str:
        return super().open().rpartition(":")[2]


def _reachable(host: str) -> str:
    return "127.0.0.1" if host in ("0.0.0.0", "::") else host


def _opened_bus(found: Appearance) -> Any:
    import can

    options: dict[str, Any] = dict(found.options)
    if found.interface == "udp_multicast":
        return open_multicast_bus(found.channel, options["port"], fd=True, exposed=found.is_exposed)
    if found.interface != "virtual":
        options["fd"] = found.fd
    return can.Bus(interface=found.interface, channel=found.channel, **options)
