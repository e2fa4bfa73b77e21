"""Devices that speak the serial protocol, over a pseudo-terminal or TCP."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

from acquisition.devices.appearance import Appearance, listening_host, port_text
from acquisition.devices.connection import Listener, ListeningSocket, PseudoTerminal
from acquisition.devices.conversation import SerialConversation
from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.endpoint import Endpoint, StartRule, StreamEndpoint
from acquisition.devices.faults import OverrunFault
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.serial_wire import SerialWire
from acquisition.devices.truth import Truth
from acquisition.devices.uart import Uart
from acquisition.devices.wire import Wire
from acquisition.samples.channel import Channel
from acquisition.sources.interface import SourceURL
from acquisition.sources.urls import URLOptions
from sloshlab.errors import SourceError

_SOCKET = "socket://"


class SerialAppearance(Appearance):
    """``serial:PATH`` links a pseudo-terminal there; ``serial:socket://127.0.0.1:PORT`` listens.

    Parameters
    ----------
    url : SourceURL
    number, expose : int, str or None
        As for `appearance`.
    """

    # a serial frame tells its own size, a calibration frame may come at any time, and bytes go where there is room
    takes_samples_per_frame = can_announce = offers_bytes = True

    def __init__(self, url: SourceURL, *, number: int, expose: str | None = None) -> None:
        options = URLOptions(url)
        super().__init__(url, options.device(f"device_{number}"))
        self._host, self._port = "", 0
        self._is_socket = url.target.startswith(_SOCKET)
        if self._is_socket:
            self._host, self._port = _host_and_port(url, expose)
        elif not url.target:
            raise SourceError(f"--as {url.text}", got="no path", allowed="serial:PATH")
        options.refuse_others()

    @property
    def listens(self) -> bool:
        """Not where it is a pseudo-terminal."""
        return self._is_socket

    @property
    def address(self) -> str:
        """Host and port."""
        return port_text(self._host, self._port)

    def wire(
        self, channels: tuple[Channel, ...], clock: DeviceClock, samples_per_frame: int | None = None
    ) -> SerialWire:
        """Frames of the serial protocol."""
        return SerialWire(self.device, clock, channels, samples_per_frame=samples_per_frame)

    def line(self, fault: OverrunFault, wire: Wire, truth: Truth) -> Uart:
        """A FIFO of bytes."""
        return Uart(fault, wire, truth)

    def endpoint(self, laboratory: LaboratoryTime, describe: Callable[[], bytes], start: StartRule) -> Endpoint:
        """One host at the end of a stream of bytes."""
        listener: Listener
        if self._is_socket:
            # one host, as at the end of a cable
            listener, url = ListeningSocket(self._host, self._port, most=1), "serial:socket://{at}"
        else:
            listener, url = PseudoTerminal(Path(self.url.target)), f"serial:{quote(self.url.target)}"
        return StreamEndpoint(
            listener,
            SerialConversation(describe),
            lambda frames: b"".join(frames["bytes"]),
            lambda at: url.format(at=at),
            n_hosts=start.n_hosts,
            runs_freely=start.runs_freely,
        )


def _host_and_port(url: SourceURL, expose: str | None) -> tuple[str, int]:
    host, _, port = url.target.removeprefix(_SOCKET).rpartition(":")
    if not port.isdecimal() or int(port) > 65535:
        raise SourceError(f"--as {url.text}", got=url.target, allowed="serial:socket://127.0.0.1:PORT")
    return listening_host(url, host, expose), int(port)
