"""A device whose samples are all known beforehand: a recording played, or a run of the virtual laboratory.

The sample counter is the master: clocks only decide when a sample may be delivered, never which.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Final

from acquisition.samples.delivery import Block, CountArray, Delivery, End
from acquisition.sources.interface import Source, SourceInfo, SourceURL
from acquisition.sources.urls import URLOptions
from sloshlab.errors import SourceError

STREAM: Final = 1
"""A played device starts its counter once."""

BLOCK_SAMPLES: Final = 4096
"""Most samples in one block."""

FASTEST: Final = 1e4
"""Largest factor of `speed`."""

_PIECE_S = 0.02
"""In real time samples come in pieces of this length."""


class PlayedSource(Source):
    """What playing needs beyond the samples; a child class has the samples.

    Options of the URL: ``real_time=yes|no``, ``speed=X`` (times real time, implies ``real_time=yes``) and
    ``device=NAME``.

    Parameters
    ----------
    url : SourceURL
    device : str
        Name of the device where the URL gives none.
    real_time : bool
        What holds where the URL says neither.
    monotonic_ns, utc_ns : callable
        Clocks of this computer.
    sleep : callable
        Waits for a number of seconds.
    """

    def __init__(
        self,
        url: SourceURL,
        *,
        device: str,
        real_time: bool = False,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        utc_ns: Callable[[], int] = time.time_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.url = url.text
        self._options = URLOptions(url)
        self._device = self._options.device(device)
        self._speed = self._options.number("speed", 1.0, lowest=1e-3, highest=FASTEST)
        self._real_time = self._options.yes("real_time", real_time or "speed" in url.options)
        if "speed" in url.options and not self._real_time:
            raise self._options.error("speed", url.options["speed"], "real_time=yes beside it")
        self._monotonic_ns, self._utc_ns, self._sleep = monotonic_ns, utc_ns, sleep
        self._info: SourceInfo | None = None
        self._started_ns: int | None = None
        self._position = 0
        self._ended = False

    @property
    def info(self) -> SourceInfo:
        """What is played; SourceError before `open`."""
        if self._info is None:
            raise SourceError(f"source {self.url}", got="a source that is not open", remedy="open it first")
        return self._info

    @abstractmethod
    def _n_samples(self) -> int:
        """How many samples there are in all."""

    @abstractmethod
    def _counts(self, start: int, stop: int) -> CountArray:
        """Counts of the samples start … stop − 1, shape (stop − start, n_channels)."""

    def start(self) -> None:
        """Begin with the first sample; a second call changes nothing."""
        _ = self.info
        if self._started_ns is None:
            self._started_ns = self._monotonic_ns()

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        """The next block; at the end one `End`, thereafter nothing.

        Parameters
        ----------
        timeout_s : float
            How long to wait in real time for the next sample.
        """
        self._sleep_until_due(timeout_s)
        stop = min(self._due(), self._position + BLOCK_SAMPLES)
        if stop > self._position:
            start, self._position = self._position, stop
            counts = self._counts(start, stop)
            return (Block(0, STREAM, start, counts, None, self._monotonic_ns(), self._utc_ns()),)
        if self._at_end() and not self._ended:
            self._ended = True
            return (End(STREAM, self._n_samples()),)
        return ()

    def close(self) -> None:
        """Forget the samples; may be called twice."""
        self._info = None

    def _at_end(self) -> bool:
        return self._started_ns is not None and self._position >= self._n_samples()

    def _due(self) -> int:
        """Samples that may have been delivered by now; sample k is there k steps after the start."""
        if self._started_ns is None:
            return 0
        if not self._real_time:
            return self._n_samples()
        played_ns = self._monotonic_ns() - self._started_ns
        # from the start each time, not added up read by read: no drift comes of rounding
        return min(int(played_ns * 1e-9 * self._played_rate_hz()) + 1, self._n_samples())

    def _played_rate_hz(self) -> float:
        return self.info.sampling_rate_hz * self._speed

    def _sleep_until_due(self, timeout_s: float) -> None:
        """Sleep until a piece worth a block is due, at most `timeout_s`; single samples would cost a core."""
        rate_hz, n_samples = self._played_rate_hz(), self._n_samples()
        if self._started_ns is None or self._ended:
            self._sleep(timeout_s)
        elif self._real_time and not self._at_end():
            wanted = min(self._position + max(int(_PIECE_S * rate_hz), 1), n_samples)
            due_ns = self._started_ns + (wanted - 1) / rate_hz * 1e9
            waiting_s = min((due_ns - self._monotonic_ns()) * 1e-9, timeout_s)
            if waiting_s > 0:
                self._sleep(waiting_s)
