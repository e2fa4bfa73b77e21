"""Where a simulated device appears: a URL becomes a place that hosts can open.

The scheme names a kind of appearance, found by the entry-point group ``sloshlab.appearances`` just as sources
are found by ``sloshlab.sources``; nothing of it is imported before it is asked for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.endpoint import Endpoint, StartRule
from acquisition.devices.faults import OverrunFault
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.sender import LossyLine
from acquisition.devices.truth import Truth
from acquisition.devices.wire import Wire
from acquisition.samples.channel import Channel
from acquisition.sources.interface import SourceURL
from sloshlab.errors import FaultsError, SourceError
from sloshlab.registry import Registry

# whoever reaches a device can stop it and read every sample: others only where the user says so
LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")

APPEARANCES: Final[Registry[Callable[..., Appearance]]] = Registry(
    "appearance",
    group="sloshlab.appearances",
    error=SourceError,
    remedy="check the word before the colon, or install the package that brings the appearance",
)
"""By the scheme of a URL: classes or functions that make an `Appearance` of it, given as `appearance` is."""
APPEARANCES.declare("serial", "acquisition.devices.serial_appearance:SerialAppearance")
APPEARANCES.declare("can", "acquisition.devices.can_appearance:can_appearance")


class Appearance(ABC):
    """How a device appears, as its URL says.

    A kind of appearance is a child class, or a function that returns one; it is called with a URL, the number
    of the device and the address to expose it on. It refuses what it cannot understand with a `SourceError`,
    options included.

    Parameters
    ----------
    url : SourceURL
    device : str
        Name of the device.
    """

    most_hosts: int = 1
    """Hosts that it can wait for."""

    takes_samples_per_frame: bool = False
    """Whether the user may say how many samples a frame has."""

    can_announce: bool = False
    """Whether the device can describe its channels anew while it runs."""

    offers_bytes: bool = False
    """Whether a slow line before it is fed what the host takes; see `Sender`."""

    def __init__(self, url: SourceURL, device: str) -> None:
        self.url, self.device = url, device

    @abstractmethod
    def wire(
        self, channels: tuple[Channel, ...], clock: DeviceClock, samples_per_frame: int | None = None
    ) -> Wire:
        """Frames of a device with these channels; files that a host needs to read them are written.

        Parameters
        ----------
        channels : tuple of Channel
        clock : DeviceClock
        samples_per_frame : int, optional
            Only given where `takes_samples_per_frame`.
        """

    @abstractmethod
    def endpoint(self, laboratory: LaboratoryTime, describe: Callable[[], bytes], start: StartRule) -> Endpoint:
        """Make the place, not yet open.

        Parameters
        ----------
        laboratory : LaboratoryTime
            For time stamps.
        describe : callable
            Gives the frame by which the device describes itself now, where that is bytes.
        start : StartRule
            Of at most `most_hosts` hosts.
        """

    def line(self, fault: OverrunFault, wire: Wire, truth: Truth) -> LossyLine:
        """The buffer and the line before the hosts that lose what comes too fast.

        Raises
        ------
        FaultsError
            If none is simulated here.
        """
        raise FaultsError(f"--as {self.url.text}", got="faults with overrun", allowed="none: it has no slow line")

    @property
    def listens(self) -> bool:
        """Whether it opens a network port."""
        return False

    @property
    def address(self) -> str:
        """Where whoever reaches it finds it, for `exposure`."""
        return self.url.target

    def exposure(self) -> str:
        """What anybody can do who reaches the port."""
        return (
            f"exposed: {self.device} on {self.address}, for more than this computer; "
            "whoever reaches it can read every sample and stop the device"
        )


def appearance(url: SourceURL, *, number: int, expose: str | None = None) -> Appearance:
    """Understand the URL of ``--as``.

    Parameters
    ----------
    url : SourceURL
        ``serial:PATH``, ``serial:socket://127.0.0.1:PORT``, ``can:socketcand?port=…&dbc=…``,
        ``can:slcan?channel=PATH&dbc=…``, ``can:virtual?channel=…&dbc=…``, ``can:udp_multicast?…``,
        or of a scheme that another package brings.
    number : int
        Of the device, from 1, for its name.
    expose : str, optional
        Address to listen on instead of the loopback interface.

    Raises
    ------
    SourceError
        If it cannot be understood, or its scheme is not known.
    """
    return APPEARANCES.named(url.scheme, asked_for=f"--as {url.text}")(url, number=number, expose=expose)


def listening_host(url: SourceURL, host: str, expose: str | None) -> str:
    """The address to listen on: on this computer only, unless it is to be exposed.

    Raises
    ------
    SourceError
        If the URL asks for another one.
    """
    if expose:
        return expose
    if host not in LOOPBACK:
        remedy = "give --expose HOST if others shall reach the device"
        raise SourceError(f"--as {url.text}", got=f"host {host}", allowed=", ".join(LOOPBACK), remedy=remedy)
    return host


def port_text(host: str, port: int) -> str:
    """Host and port for a person; port 0 is one that is free."""
    return f"{host}:{port or 'a free port'}"
