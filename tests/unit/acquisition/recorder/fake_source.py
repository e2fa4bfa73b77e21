"""A source that does what a test says."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery
from acquisition.sources.interface import Source, SourceInfo

Step = Sequence[Delivery] | BaseException | Callable[[], Sequence[Delivery]]


def info(device: str = "daq", *, n_channels: int = 2, rate_hz: float = 1000.0, n_groups: int = 1) -> SourceInfo:
    """A device with so many channels, dealt to its groups in turn."""
    channels = tuple(Channel(f"force_{device}_{k}", "force", "N") for k in range(n_channels))
    groups = tuple(tuple(range(group, n_channels, n_groups)) for group in range(n_groups))
    return SourceInfo(device, f"fake:{device}", rate_hz, channels, groups)


def counts_of(counter: int, n_samples: int, n_channels: int = 2) -> np.ndarray:
    """Counts that say which sample and channel they are; the same for the same counter."""
    samples = np.arange(counter, counter + n_samples)[:, np.newaxis]
    return ((samples * 31 + 7 * np.arange(n_channels)) % 60_001 - 30_000).astype(np.int32)


def block(counter: int, n_samples: int = 10, *, n_channels: int = 2, group: int = 0, stream: int = 1) -> Block:
    """A block of known counts, read now."""
    counts = counts_of(counter, n_samples, n_channels)
    return Block(group, stream, counter, counts, counter * 3, time.monotonic_ns(), time.time_ns())


def endless(n_samples: int = 10, *, pause_s: float = 0.001) -> Iterator[Sequence[Delivery]]:
    """Blocks without end."""
    counter = 0
    while True:
        yield [block(counter, n_samples)]
        counter += n_samples
        time.sleep(pause_s)


class FakeSource(Source):
    """Every read takes the next step: deliveries, an error, or something to call."""

    def __init__(
        self,
        steps: Iterable[Step] = (),
        source_info: SourceInfo | None = None,
        *,
        on_open: Callable[[], None] | None = None,
        on_start: Callable[[], None] | None = None,
        on_close: Callable[[], None] | None = None,
    ) -> None:
        self._info = source_info or info()
        self.url = self._info.url
        self._steps = iter(steps)
        self._on_open, self._on_start, self._on_close = on_open, on_start, on_close
        self.n_opened = self.n_started = self.n_closed = self.n_read = 0
        self.closed = threading.Event()

    def open(self) -> None:
        self.n_opened += 1
        if self._on_open:
            self._on_open()

    @property
    def info(self) -> SourceInfo:
        return self._info

    def start(self) -> None:
        self.n_started += 1
        if self._on_start:
            self._on_start()

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        self.n_read += 1
        step = next(self._steps, ())
        if isinstance(step, BaseException):
            raise step
        return step() if callable(step) else step

    def close(self) -> None:
        self.n_closed += 1
        self.closed.set()
        if self._on_close:
            self._on_close()
