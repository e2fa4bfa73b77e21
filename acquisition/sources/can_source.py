"""A device on a CAN bus, ``can:INTERFACE?channel=…&dbc=FILE.dbc``; ``docs/can_protocol.md`` has the frames.

Everything happens in the thread that calls `CanSource.read`. A bus that is lost is opened again and
again until it is back or the source is closed.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.files.can_database import read_layout
from acquisition.samples.delivery import Delivery, End, Trouble, TroubleKind
from acquisition.sources.can_links import CanLink, PythonCanLink, Received, open_bus
from acquisition.sources.can_text_links import SLCAN_BITRATES, open_slcan, open_socketcand
from acquisition.sources.driver_counters import (
    Counts,
    DriverLosses,
    interface_counts,
    nothing_counted,
    socket_counts,
)
from acquisition.sources.interface import Source, SourceInfo, SourceURL
from acquisition.sources.multicast_loopback import DEFAULT_GROUP, open_multicast_bus
from acquisition.sources.serial_line import LineLostError
from acquisition.sources.urls import URLOptions
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_counter import CounterTracker
from acquisition.wire.can_frames import START, STOP, control_frame, decode
from acquisition.wire.can_layout import CanLayout
from acquisition.wire.can_receiver import CanReceiver
from sloshlab.errors import SourceError

_STEP_S: Final = 0.1
_RETRY_S: Final = 0.2
_RETRY_TIMEOUT_S: Final = 0.5
"""A server that does not answer must not keep `CanSource.read` for long."""

_LAST_WORDS_NS: Final = 1_000_000_000
"""So long a device may take to say its end after it was asked to stop."""

# as in the serial protocol
_ASK_AGAIN_NS: Final = 500_000_000
# the default port of socketcand
_SOCKETCAND_PORT: Final = 29536
# python-can's own
_MULTICAST_PORT: Final = 43113
_INTERFACE: Final = re.compile(r"[a-z0-9_]{1,32}")
_PASSED_ON: Final = "bus."
_SOCKETS: Final = frozenset({"socketcan", "udp_multicast"})
"""Interfaces of python-can that are sockets of the system."""


class CanSource(Source):
    """Samples of one device on a CAN bus.

    Parameters
    ----------
    url : SourceURL
        Target: ``socketcand``, ``slcan``, ``udp_multicast``, ``virtual``, or another interface of
        python-can. Options: ``dbc`` (needed), ``channel``, ``host``, ``port``, ``bitrate``, ``baudrate``,
        ``fd``, ``expose``, ``device``, ``reconnect`` (yes), ``open_timeout_s`` (5), ``longest_gap_s``
        (3600); ``bus.NAME`` goes to python-can's interface as NAME.
    monotonic_ns, utc_ns : callable
        Clocks of this computer.
    sleep : callable
        Waits for more frames, and between two attempts to open a bus that was lost.
    """

    def __init__(
        self,
        url: SourceURL,
        *,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        utc_ns: Callable[[], int] = time.time_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.url = url.text
        self._monotonic_ns, self._utc_ns, self._sleep = monotonic_ns, utc_ns, sleep
        if not _INTERFACE.fullmatch(url.target):
            allowed = "can:INTERFACE, for example can:socketcand, can:slcan or can:socketcan"
            raise SourceError(f"source {self.url}", got=repr(url.target)[:80], allowed=allowed)
        self._interface = url.target
        options = URLOptions(url)
        self._dbc = options.text("dbc")
        self._device = options.device("can") if "device" in url.options else None
        self._reconnect = options.yes("reconnect", True)
        self._longest_gap_s = options.number("longest_gap_s", 3600.0, lowest=0.001, highest=1e6)
        self._timeout_s = options.number("open_timeout_s", 5.0, lowest=0.1, highest=600.0)
        self._connect = self._connection(options, url)
        options.text("device")
        options.refuse_others()
        self._layout: CanLayout | None = None
        self._link: CanLink | None = None
        self._losses = DriverLosses(nothing_counted, 0)
        self._waiting: list[Delivery] = []
        self._started = self._away = self._heard = self._complete = False
        self._asked_ns = self._retried_ns = 0

    def open(self) -> None:
        """Read the DBC file and join the bus.

        Raises
        ------
        SourceError
            If the DBC file describes no device, or there is no such bus.
        """
        if self._dbc is None:
            remedy = "add dbc=FILE.dbc, which describes the frames of the device"
            raise SourceError(f"source {self.url}: dbc", got="none", allowed="a DBC file", remedy=remedy)
        layout = read_layout(Path(self._dbc))
        controls = [message for message in (layout.status, layout.command) if message is not None]
        # socketcand's text has no CAN FD: such a device would stay silent without a word
        if self._interface == "socketcand" and (layout.fd or any(message.fd for message in controls)):
            allowed = "classic frames, as socketcand carries no others"
            raise SourceError(f"source {self.url}: {self._dbc}", got="messages of CAN FD", allowed=allowed)
        self._receiver = CanReceiver(layout, self._longest_gap_s)
        # before the bus is open: multicast lost 900 frames while compiled code was loaded at the first of them
        _load_decoder(layout)
        self._take(self._connect(self._timeout_s))
        self._layout = layout

    def _take(self, link: CanLink) -> None:
        self._link = link
        self._losses = DriverLosses(link.driver_counts, self._monotonic_ns())

    @property
    def info(self) -> SourceInfo:
        """What the DBC file says about the device; SourceError before `open`."""
        layout = self._required_layout()
        return SourceInfo(
            device=self._device or layout.device,
            url=self.url,
            sampling_rate_hz=layout.sampling_rate_hz,
            channels=layout.channels,
            groups=layout.groups,
            clock_hz=layout.clock_hz,
        )

    def start(self) -> None:
        """Let frames come and ask the device to begin; asked again by `read` until something comes."""
        self._required_layout()
        self._started = True
        try:
            self._begin()
        except LineLostError as error:
            self._waiting += self._lost(error)

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        """What has arrived; returns as soon as there is something, or after `timeout_s` with nothing.

        Raises
        ------
        SourceError
            If the counter of the device makes no sense, or the bus was lost and ``reconnect=no``.
        """
        self._required_layout()
        self._raise_failure()
        deadline_ns = self._monotonic_ns() + int(timeout_s * 1e9)
        deliveries, self._waiting = self._waiting, []
        # what came before the counter made no sense is delivered; the next call raises the failure
        while not deliveries and self._receiver.failure is None:
            remaining_s = max(0.0, (deadline_ns - self._monotonic_ns()) * 1e-9)
            try:
                received = self._received(min(remaining_s, _STEP_S))
                deliveries = [*self._delivered(received), *self._losses.grown(self._monotonic_ns())]
                self._ask_again()
            except LineLostError as error:
                deliveries = deliveries + self._lost(error)
            if not remaining_s:
                break
        if not deliveries:
            self._raise_failure()
        return deliveries

    def finish(self) -> Sequence[Delivery]:
        """Ask the device to stop, wait a moment for the end that it announces, and decide all that waits.

        Raises
        ------
        SourceError
            If the counter of the device makes no sense.
        """
        layout = self._required_layout()
        deliveries, self._waiting = self._waiting, []
        self._raise_failure()
        try:
            if self._started and self._heard and not self._complete and self._link is not None:
                # asked before the decision: the end that the device announces proves its last frames, up to 18 of
                # each message
                _command(self._link, layout, STOP)
                deliveries += self._until_end() if layout.command is not None and layout.status is not None else []
        except LineLostError:
            pass  # what has come is decided below
        deliveries += self._losses.grown(self._monotonic_ns(), at_once=True)
        return [*deliveries, *self._receiver.finish(self._monotonic_ns())]

    def _until_end(self) -> list[Delivery]:
        assert self._link is not None
        deliveries: list[Delivery] = []
        deadline_ns = self._monotonic_ns() + _LAST_WORDS_NS
        while not self._complete and self._monotonic_ns() < deadline_ns and self._receiver.failure is None:
            try:
                received = self._link.receive(_STEP_S)
            except LineLostError:
                break
            deliveries += self._delivered(received)
        return deliveries

    def close(self) -> None:
        """Ask the device to stop and leave the bus; may be called twice."""
        link, self._link, self._layout, layout = self._link, None, None, self._layout
        if link is None:
            return
        try:
            if self._started and layout is not None:
                _command(link, layout, STOP)
        except LineLostError:
            pass  # nobody is there who could be stopped
        finally:
            link.close()

    def _required_layout(self) -> CanLayout:
        if self._layout is None:
            raise SourceError(f"source {self.url}", got="a source that is not open", remedy="open it first")
        return self._layout

    def _raise_failure(self) -> None:
        """Raise what the last `read` met; what had come before it was delivered first."""
        error = self._receiver.failure
        if error is not None:
            what = f"source {self.url}: {error.what}"
            raise SourceError(what, got=error.got, allowed=error.allowed, remedy=error.remedy)

    def _received(self, timeout_s: float) -> Received:
        if self._link is None:
            self._try_again(timeout_s)
            return Received(FrameBatch.empty())
        return self._link.receive(timeout_s)

    def _delivered(self, received: Received) -> list[Delivery]:
        now_ns, utc_ns = self._monotonic_ns(), self._utc_ns()
        deliveries: list[Delivery] = []
        # asked as the receiver asks: a remote frame of the same number, or one with 29 bits, is somebody else's
        if not self._heard and self._receiver.knows_any(received.batch):
            self._heard = True
            if self._away:
                self._away = False
                deliveries.append(Trouble(TroubleKind.RECONNECTED, self._interface, 1, now_ns))
        taken = self._receiver.take(received.batch, now_ns, utc_ns)
        for delivery in taken:
            self._note_end(delivery)
        deliveries += taken
        for count, kind, detail in (
            (received.n_error_frames, TroubleKind.BUS_ERROR, "error frames on the bus"),
            (received.n_garbage, TroubleKind.GARBAGE, "what belongs to no frame was skipped"),
        ):
            if count:
                deliveries.append(Trouble(kind, detail, count, now_ns))
        return deliveries

    def _note_end(self, delivery: Delivery) -> None:
        if isinstance(delivery, End):
            self._complete = True
        elif isinstance(delivery, Trouble) and delivery.kind is TroubleKind.RESTARTED:
            self._complete = False

    def _begin(self) -> None:
        if self._link is not None and self._layout is not None:
            self._asked_ns = self._monotonic_ns()
            self._link.start()
            _command(self._link, self._layout, START)

    def _ask_again(self) -> None:
        """Repeat the command while nothing comes: commands can be lost like anything else."""
        is_due = self._monotonic_ns() - self._asked_ns >= _ASK_AGAIN_NS
        if self._started and not self._heard and is_due and self._link is not None and self._layout is not None:
            self._asked_ns = self._monotonic_ns()
            _command(self._link, self._layout, START)

    def _lost(self, error: LineLostError) -> list[Delivery]:
        """Let a lost bus go; one trouble however often it is lost before the device is heard again.

        None if the device has said that it is done: nothing is lost then.
        """
        if self._link is not None:
            self._link.close()
            self._link = None
        self._retried_ns = self._monotonic_ns()
        # a device that lost power meanwhile, and whose first status nobody hears, counts on through the place
        # where its old stream stopped: its samples would be taken for that stream
        given_up = self._receiver.break_off(self._retried_ns)
        if self._away or self._complete:
            return given_up
        if not self._reconnect:
            raise error
        self._away, self._heard = True, False
        return [*given_up, Trouble(TroubleKind.DISCONNECTED, error.got, 1, self._retried_ns)]

    def _try_again(self, timeout_s: float) -> None:
        # a server that refuses at once must not be asked without a pause
        wait_s = _RETRY_S - (self._monotonic_ns() - self._retried_ns) * 1e-9
        if wait_s > 0 or not self._reconnect:
            self._sleep(min(wait_s, timeout_s) if self._reconnect else timeout_s)
            return
        try:
            self._take(self._connect(min(_RETRY_TIMEOUT_S, self._timeout_s)))
        except SourceError:
            return  # not back yet
        finally:
            self._retried_ns = self._monotonic_ns()
        if self._started:
            self._begin()

    def _connection(self, options: URLOptions, url: SourceURL) -> Callable[[float], CanLink]:
        """What opens the link within so many seconds; all options are read now, nothing is opened."""
        fd = options.yes("fd", False)
        if self._interface == "socketcand":
            return self._socketcand(options)
        if self._interface == "slcan":
            return self._slcan(options)
        if self._interface == "udp_multicast":
            group = options.text("channel") or DEFAULT_GROUP
            port = options.integer("port", _MULTICAST_PORT, lowest=1, highest=65535)
            exposed = options.yes("expose", False)
            name = f"source {self.url}"
            # a bus with CAN FD takes classic frames, too
            return lambda _: self._python_can(open_multicast_bus(group, port, fd=True, exposed=exposed, name=name))
        return self._hardware(options, url, fd)

    def _socketcand(self, options: URLOptions) -> Callable[[float], CanLink]:
        host = options.text("host") or "127.0.0.1"
        port = options.integer("port", _SOCKETCAND_PORT, lowest=1, highest=65535)
        bus = options.text("channel") or "can0"
        return lambda timeout_s: open_socketcand(
            host,
            port,
            bus,
            url=self.url,
            timeout_s=timeout_s,
            monotonic_ns=self._monotonic_ns,
            sleep=self._sleep,
        )

    def _slcan(self, options: URLOptions) -> Callable[[float], CanLink]:
        port = options.text("channel")
        if port is None:
            raise options.error("channel", "", "the port of the adapter")
        baudrate = options.integer("baudrate", 115_200, lowest=50, highest=50_000_000)
        bitrate = options.integer("bitrate", 0, lowest=0, highest=1_000_000)
        if bitrate and bitrate not in SLCAN_BITRATES:
            raise options.error("bitrate", str(bitrate), ", ".join(map(str, SLCAN_BITRATES)))
        return lambda _: open_slcan(port, baudrate, bitrate, url=self.url, sleep=self._sleep)

    def _hardware(self, options: URLOptions, url: SourceURL, fd: bool) -> Callable[[float], CanLink]:
        configuration: dict[str, Any] = {"interface": self._interface, **({"fd": True} if fd else {})}
        configuration["channel"] = options.text("channel")
        bitrate = options.integer("bitrate", 0, lowest=0, highest=10_000_000)
        if bitrate:
            configuration["bitrate"] = bitrate
        for name in url.options:
            if name.startswith(_PASSED_ON):
                configuration[name.removeprefix(_PASSED_ON)] = _typed(options.text(name) or "")
        # names of SocketCAN are those of network interfaces
        interface = configuration["channel"] if self._interface == "socketcan" else None
        return lambda _: self._python_can(open_bus(f"source {self.url}", configuration), interface)

    def _python_can(self, bus: Any, network_interface: str | None = None) -> CanLink:
        def count() -> Counts:
            found = dict(socket_counts(bus.fileno())) if self._interface in _SOCKETS else {}
            return {**found, **(interface_counts(network_interface) if network_interface else {})}

        return PythonCanLink(bus, f"source {self.url}", sleep=self._sleep, count=count)


def _load_decoder(layout: CanLayout) -> None:
    """Take a made-up frame apart and throw it away.

    What is compiled or loaded at first use takes seconds on a busy computer, and so long the buffers of
    the interface do not hold what arrives.
    """
    message = layout.messages[0]
    frames = decode(message, np.zeros((1, message.length), np.uint8))
    CounterTracker(message, layout.sampling_rate_hz).take(frames.counter, frames.counter_known)


def _command(link: CanLink, layout: CanLayout, command: int) -> None:
    """Send ``host_command``, if the device knows it."""
    message = layout.command
    if message is not None:
        data = control_frame(message, command=command)
        link.send(message.arbitration_id, data, extended=message.extended, fd=message.fd)


def _typed(text: str) -> str | int | bool:
    """Option of a python-can interface: yes, no, a whole number, or text."""
    if text in ("yes", "no"):
        return text == "yes"
    # drivers want numbers as numbers; longer texts of digits are serial numbers
    return int(text) if re.fullmatch(r"-?[0-9]{1,18}", text) else text
