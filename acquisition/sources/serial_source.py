"""A device on a serial line, ``serial:PORT?option=value``; ``docs/serial_protocol.md`` has the protocol.

Everything happens in the thread that calls `SerialSource.read`. A line that breaks is opened again and
again until it is back or the source is closed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Final

from acquisition.samples.delivery import Delivery, Trouble, TroubleKind
from acquisition.sources.driver_counters import DriverLosses, nothing_counted
from acquisition.sources.interface import Source, SourceInfo, SourceURL
from acquisition.sources.serial_line import Line, LineLostError, open_line
from acquisition.sources.urls import URLOptions
from acquisition.wire.serial_decoding import HostTime, SerialDecoder
from acquisition.wire.serial_frames import CommandFrame, CommandKind, encode_frame
from sloshlab.errors import SourceError

_ASK_AGAIN_NS: Final = 500_000_000
"""A request that brought nothing is repeated after this long: requests can be lost like anything else."""

_RETRY_S: Final = 0.2
_HIGHEST_BAUDRATE: Final = 50_000_000


class SerialSource(Source):
    """Samples of one serial device.

    Parameters
    ----------
    url : SourceURL
        Target: a port, a pseudo-terminal, or a URL of pyserial such as ``socket://127.0.0.1:7000``.
        Options: ``baudrate`` (115200), ``device`` (name instead of the device's own), ``open_timeout_s``
        (5), ``reconnect`` (yes), ``longest_gap_s`` (3600).
    monotonic_ns, utc_ns : callable
        Clocks of this computer.
    sleep : callable
        Waits between two attempts to open a line that broke.
    connect : callable
        ``connect(target, baudrate)`` opens the line.
    """

    def __init__(
        self,
        url: SourceURL,
        *,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        utc_ns: Callable[[], int] = time.time_ns,
        sleep: Callable[[float], None] = time.sleep,
        connect: Callable[[str, int], Line] = open_line,
    ) -> None:
        options = URLOptions(url)
        self.url = url.text
        self._target = url.target
        self._baudrate = options.integer("baudrate", 115_200, lowest=50, highest=_HIGHEST_BAUDRATE)
        self._device = options.device("serial") if "device" in url.options else None
        self._open_timeout_s = options.number("open_timeout_s", 5.0, lowest=0.1, highest=600.0)
        self._reconnect = options.yes("reconnect", True)
        longest_gap_s = options.number("longest_gap_s", 3600.0, lowest=0.001, highest=1e6)
        options.text("device")
        options.refuse_others()
        if not self._target:
            raise SourceError(f"source {self.url}", got="no port", allowed="serial:PORT")
        self._monotonic_ns, self._utc_ns, self._sleep, self._connect = monotonic_ns, utc_ns, sleep, connect
        self._decoder = SerialDecoder(self.url, longest_gap_s)
        self._line: Line | None = None
        self._losses = DriverLosses(nothing_counted, 0)
        self._waiting: list[Delivery] = []
        self._opened = self._started = self._away = False
        self._asked_ns = self._retried_ns = 0

    def open(self) -> None:
        """Connect and ask the device what it is, until it answers or ``open_timeout_s`` is over.

        Raises
        ------
        SourceError
            If there is no such port, another program has it, nothing answers, or the answer is impossible.
        """
        self._take(self._connect(self._target, self._baudrate))
        try:
            self._await_calibration()
        except BaseException:
            self.close()
            raise
        # samples of a free-running device that came meanwhile wait in `_waiting` and are the first to be delivered
        self._opened = True

    def _take(self, line: Line) -> None:
        self._line = line
        self._losses = DriverLosses(line.driver_counts, self._monotonic_ns())

    def _await_calibration(self) -> None:
        deadline_ns = self._monotonic_ns() + int(self._open_timeout_s * 1e9)
        self._ask(CommandKind.SEND_CALIBRATION)
        while self._decoder.calibration is None:
            remaining_ns = deadline_ns - self._monotonic_ns()
            if remaining_ns <= 0:
                raise self._no_answer()
            self._waiting += self._received(min(remaining_ns, _ASK_AGAIN_NS) * 1e-9)
            self._raise_failure()
            if self._decoder.calibration is None and self._is_time_to_ask():
                self._ask(CommandKind.SEND_CALIBRATION)

    def _no_answer(self) -> SourceError:
        decoder = self._decoder
        got = "no answer"
        if decoder.n_frames:
            got = f"{decoder.n_frames} frames, none of them a calibration"
        elif decoder.n_bytes:
            got = f"{decoder.n_bytes} bytes, none of them of a frame"
        if decoder.words:
            got += f"; the device says {decoder.words!r}"
        return SourceError(
            f"source {self.url}",
            got=f"{got} within {self._open_timeout_s:g} s",
            remedy="check that the device is switched on, that it is on this port, and the option baudrate",
        )

    @property
    def info(self) -> SourceInfo:
        """What the device says about itself.

        Raises
        ------
        SourceError
            Before `open`.
        """
        calibration = self._decoder.calibration
        if calibration is None:
            raise SourceError(f"source {self.url}", got="no device yet", remedy="open the source first")
        return SourceInfo(
            device=self._device or calibration.device,
            url=self.url,
            sampling_rate_hz=calibration.sampling_rate_hz,
            channels=calibration.channels,
            groups=(tuple(range(len(calibration.channels))),),
            clock_hz=calibration.clock_hz,
        )

    def start(self) -> None:
        """Ask the device to begin; asked again by `read` until samples come."""
        self._require_open()
        self._started, self._decoder.sampling = True, False
        try:
            self._ask(CommandKind.START)
        except LineLostError as error:
            self._waiting += self._lost(error)

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        """What has arrived; returns as soon as there is something, or after `timeout_s` with nothing.

        Raises
        ------
        SourceError
            If the counter of the device jumps further than ``longest_gap_s``, or the line broke and
            ``reconnect=no``.
        """
        self._require_open()
        deadline_ns = self._monotonic_ns() + int(timeout_s * 1e9)
        deliveries, self._waiting = self._waiting, []
        while not deliveries:
            self._raise_failure()
            remaining_s = (deadline_ns - self._monotonic_ns()) * 1e-9
            try:
                if self._line is None:
                    self._try_again(remaining_s)
                else:
                    deliveries = self._received(min(max(remaining_s, 0.0), _ASK_AGAIN_NS * 1e-9))
                    deliveries = [*deliveries, *self._losses.grown(self._monotonic_ns())]
                    self._ask_what_is_due()
            except LineLostError as error:
                deliveries = deliveries + self._lost(error)
            if remaining_s <= 0:
                break
        return deliveries

    def finish(self) -> Sequence[Delivery]:
        """What the driver has counted since the last look."""
        return self._losses.grown(self._monotonic_ns(), at_once=True)

    def close(self) -> None:
        """Ask the device to stop and let the line go; may be called twice."""
        line, self._line = self._line, None
        self._opened = False
        if line is None:
            return
        try:
            if self._started:
                line.write(_request(CommandKind.STOP))
        except LineLostError:
            pass  # nobody is there who could be stopped
        finally:
            line.close()

    def _received(self, timeout_s: float) -> list[Delivery]:
        assert self._line is not None
        data = self._line.read(timeout_s)
        if not data:
            return []
        # after the read and before decoding: the clock fit takes it for the arrival of the last byte
        host = HostTime(self._monotonic_ns(), self._utc_ns())
        n_frames = self._decoder.n_frames
        deliveries = self._decoder.feed(data, host)
        # back with the first good frame only: noise is not the device coming back
        if self._away and self._decoder.n_frames > n_frames:
            self._away = False
            back = Trouble(TroubleKind.RECONNECTED, self._target, 1, host.monotonic_ns)
            return [back, *deliveries]
        return deliveries

    def _lost(self, error: LineLostError) -> list[Delivery]:
        """Let a broken line go; one trouble however often it breaks before the device is back.

        None if the device has said that it is done: nothing is lost then.
        """
        if self._line is not None:
            self._line.close()
            self._line = None
        # the rest of a cut frame would spoil the first frame of the new connection
        self._decoder.break_off()
        now_ns = self._monotonic_ns()
        self._retried_ns = now_ns
        if self._away or self._decoder.complete:
            return []
        if not self._reconnect:
            raise error
        self._away = True
        return [Trouble(TroubleKind.DISCONNECTED, error.got, 1, now_ns)]

    def _try_again(self, remaining_s: float) -> None:
        if not self._reconnect:
            self._sleep(max(0.0, remaining_s))
            return
        wait_s = self._retried_ns * 1e-9 + _RETRY_S - self._monotonic_ns() * 1e-9
        if wait_s > 0:
            self._sleep(max(0.0, min(wait_s, remaining_s)))
            if wait_s > remaining_s:
                return
        self._retried_ns = self._monotonic_ns()
        try:
            self._take(self._connect(self._target, self._baudrate))
        except SourceError:
            return  # not back yet
        self._ask_for_everything()

    def _ask_what_is_due(self) -> None:
        """Repeat what the device has not answered."""
        unanswered = self._away or (self._started and not self._decoder.sampling)
        if unanswered and self._is_time_to_ask():
            self._ask_for_everything()

    def _ask_for_everything(self) -> None:
        self._ask(CommandKind.SEND_CALIBRATION)
        # a device that is done is not started again
        if self._started and not (self._decoder.sampling and self._decoder.complete):
            self._ask(CommandKind.START)

    def _raise_failure(self) -> None:
        if self._decoder.failure is not None:
            raise self._decoder.failure

    def _ask(self, kind: CommandKind) -> None:
        assert self._line is not None
        self._asked_ns = self._monotonic_ns()
        self._line.write(_request(kind))

    def _is_time_to_ask(self) -> bool:
        return self._monotonic_ns() - self._asked_ns >= _ASK_AGAIN_NS

    def _require_open(self) -> None:
        if not self._opened:
            raise SourceError(f"source {self.url}", got="a source that is not open", remedy="open it first")


def _request(kind: CommandKind) -> bytes:
    """The frame, after a zero that ends whatever noise the device has read before."""
    # zeros in a row mean nothing
    return b"\0" + encode_frame(CommandFrame(kind))
