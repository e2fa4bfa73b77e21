"""Devices on a CAN bus: at a socketcand server, behind an slcan adapter, or on a bus of python-can."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

from acquisition.devices.appearance import Appearance, listening_host, port_text
from acquisition.devices.bus_endpoint import BusEndpoint
from acquisition.devices.can_conversation import SlcanConversation, SocketcandConversation
from acquisition.devices.can_text import slcan_text, socketcand_text
from acquisition.devices.can_wire import CanWire
from acquisition.devices.connection import MOST_CONNECTIONS, ListeningSocket, PseudoTerminal
from acquisition.devices.device_clock import CLOCK_HZ, DeviceClock
from acquisition.devices.endpoint import Endpoint, StartRule, StreamEndpoint
from acquisition.devices.faults import OverrunFault
from acquisition.devices.frames import FrameArray
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.truth import Truth
from acquisition.devices.uart import TransmitQueue
from acquisition.devices.wire import Wire
from acquisition.files.can_database_text import write_dbc
from acquisition.samples.channel import Channel
from acquisition.sources.interface import SourceURL
from acquisition.sources.multicast_loopback import DEFAULT_GROUP, open_multicast_bus
from acquisition.sources.urls import URLOptions
from acquisition.wire.can_layout import device_database
from sloshlab.errors import SourceError

# nothing makes a sender of datagrams wait: what comes faster than hosts read would be lost on the bus itself
_FRAMES_PER_S_BY_MULTICAST = 4000.0
_MULTICAST_PORT = 43113


def can_appearance(url: SourceURL, *, number: int, expose: str | None = None) -> CanAppearance:
    """The appearance on a CAN bus that the target names.

    Parameters
    ----------
    url : SourceURL
    number, expose : int, str or None
        As for `appearance`.
    """
    options = URLOptions(url)
    device = options.device(f"device_{number}")
    kinds: dict[str, type[CanAppearance]] = {
        "socketcand": SocketcandAppearance,
        "slcan": SlcanAppearance,
        "udp_multicast": MulticastAppearance,
    }
    made = kinds.get(url.target, BusAppearance)(url, device, options, expose)
    options.refuse_others()
    return made


class CanAppearance(Appearance):
    """A device that describes its frames in a DBC file.

    Parameters
    ----------
    url : SourceURL
    device : str
    options : URLOptions
        Of the URL, as far as they have not been read.
    expose : str or None
        As for `appearance`.
    """

    def __init__(self, url: SourceURL, device: str, options: URLOptions, expose: str | None) -> None:
        super().__init__(url, device)
        dbc, self._fd = options.text("dbc"), options.yes("fd", False)
        if not dbc:
            raise SourceError(
                f"--as {url.text}", got="no dbc", allowed="dbc=FILE.dbc, where the device writes its DBC"
            )
        self._dbc = Path(dbc)
        self._read(options, expose)

    @abstractmethod
    def _read(self, options: URLOptions, expose: str | None) -> None:
        """Read the options that are left."""

    def _channel(self, options: URLOptions) -> str:
        channel = options.text("channel")
        if not channel:
            raise SourceError(f"--as {self.url.text}", got="no channel", allowed="channel=…")
        return channel

    @property
    def _quoted_dbc(self) -> str:
        return quote(str(self._dbc))

    def wire(
        self, channels: tuple[Channel, ...], clock: DeviceClock, samples_per_frame: int | None = None
    ) -> CanWire:
        """Frames laid out as `device_database` does; the DBC file is written."""
        layout = device_database(self.device, clock.sampling_rate_hz, CLOCK_HZ, channels, fd=self._fd)
        write_dbc(layout, self._dbc)
        return CanWire(layout, clock)

    def line(self, fault: OverrunFault, wire: Wire, truth: Truth) -> TransmitQueue:
        """The queue of a CAN controller."""
        return TransmitQueue(fault, wire, truth)


class SocketcandAppearance(CanAppearance):
    """A socketcand server with classic frames."""

    most_hosts = MOST_CONNECTIONS
    listens = True

    def _read(self, options: URLOptions, expose: str | None) -> None:
        if self._fd:
            remedy = "use slcan, udp_multicast or virtual"
            raise SourceError(f"--as {self.url.text}", got="fd=yes", allowed="classic frames", remedy=remedy)
        self._host = listening_host(self.url, options.text("host", "127.0.0.1") or "", expose)
        self._port = options.integer("port", 0, lowest=0, highest=65535)
        self._bus = options.text("channel", "can0") or ""

    @property
    def address(self) -> str:
        """Host and port."""
        return port_text(self._host, self._port)

    def endpoint(self, laboratory: LaboratoryTime, describe: Callable[[], bytes], start: StartRule) -> Endpoint:
        """Several hosts at a TCP port."""
        # the line "ready" must name an address that can be opened from this computer
        host = "127.0.0.1" if self._host in ("0.0.0.0", "::") else self._host
        url = f"can:socketcand?host={host}&port={{at}}&channel={quote(self._bus)}&dbc={self._quoted_dbc}"

        def stamped(frames: FrameArray) -> bytes:
            # stamped with the time at which a frame was due, not that of sending, as a real bus would have carried
            # it then
            return socketcand_text(frames, laboratory.utc_s(frames["due_s"]))

        return StreamEndpoint(
            _Port(self._host, self._port),
            SocketcandConversation(self._bus),
            stamped,
            lambda at: url.format(at=at),
            n_hosts=start.n_hosts,
            runs_freely=start.runs_freely,
        )


class SlcanAppearance(CanAppearance):
    """An adapter with Lawicel's commands at a pseudo-terminal."""

    def _read(self, options: URLOptions, expose: str | None) -> None:
        self._path = self._channel(options)

    def endpoint(self, laboratory: LaboratoryTime, describe: Callable[[], bytes], start: StartRule) -> Endpoint:
        """One host at a pseudo-terminal."""
        url = f"can:slcan?channel={quote(self._path)}&dbc={self._quoted_dbc}{'&fd=yes' if self._fd else ''}"
        return StreamEndpoint(
            PseudoTerminal(Path(self._path)),
            SlcanConversation(),
            lambda frames: slcan_text(frames, fd=self._fd),
            lambda at: url.format(at=at),
            n_hosts=start.n_hosts,
            runs_freely=start.runs_freely,
        )


class BusAppearance(CanAppearance):
    """A node of a bus that python-can opens: ``virtual``, or hardware; other options are passed on to it."""

    _frames_per_s: float | None = None

    def _read(self, options: URLOptions, expose: str | None) -> None:
        self._bus = self._channel(options)
        others = self._others(options).items()
        self._passed: dict[str, Any] = {key: int(value) if value.isdecimal() else value for key, value in others}

    def _others(self, options: URLOptions) -> dict[str, str]:
        """Options that are not ours, none of which is refused."""
        others = {k: v for k, v in self.url.options.items() if k not in ("dbc", "fd", "device", "channel")}
        for key in others:
            options.text(key)
        return others

    def endpoint(self, laboratory: LaboratoryTime, describe: Callable[[], bytes], start: StartRule) -> Endpoint:
        """A node that does not know who listens."""
        fd = "&fd=yes" if self._fd else ""
        others = "".join(f"&{key}={value}" for key, value in self._passed.items())
        url = f"can:{self.url.target}?channel={quote(self._bus)}&dbc={self._quoted_dbc}{fd}{others}"
        return BusEndpoint(
            self._opened, url, fd=self._fd, runs_freely=start.runs_freely, frames_per_s=self._frames_per_s
        )

    def _opened(self) -> Any:
        import can

        options = dict(self._passed)
        if self.url.target != "virtual":
            options["fd"] = self._fd
        return can.Bus(interface=self.url.target, channel=self._bus, **options)


class MulticastAppearance(BusAppearance):
    """python-can's multicast bus, confined to this computer unless exposed."""

    listens = True
    _frames_per_s = _FRAMES_PER_S_BY_MULTICAST

    def _read(self, options: URLOptions, expose: str | None) -> None:
        self._others(options)
        self._bus = options.text("channel") or DEFAULT_GROUP
        self._passed = {"port": options.integer("port", _MULTICAST_PORT, lowest=1, highest=65535)}
        self._is_exposed = bool(expose)

    @property
    def address(self) -> str:
        """The group."""
        return f"multicast group {self._bus}"

    def _opened(self) -> Any:
        return open_multicast_bus(self._bus, self._passed["port"], fd=True, exposed=self._is_exposed)


class _Port(ListeningSocket):
    """A listening socket that is known by its port alone."""

    def open(self) -> str:
        return super().open().rpartition(":")[2]
