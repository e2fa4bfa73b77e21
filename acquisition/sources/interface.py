"""What every source of samples is: open, read what has arrived, close, say what it is.

A source never repairs, joins or reorders: it delivers the samples of each device as they arrived,
with the device's own sample counter unwrapped to 64 bits, and says what went wrong on the way. Whoever
puts samples in their place uses the counter and nothing else.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Delivery


@dataclass(frozen=True)
class SourceInfo:
    """What a device says about itself.

    Attributes
    ----------
    device : str
        Short name, unique among the sources of a recording.
    url : str
        How it was addressed.
    sampling_rate_hz : float
        Nominal rate of the sample counter.
    channels : tuple of Channel
        In the order of the device.
    groups : tuple of tuple of int
        Channels (numbers in `channels`) that travel together and share a counter: all in one group on
        a serial line, one group per message on CAN. Each channel is in exactly one group.
    clock_hz : float or None
        Ticks per second of the device clock; None without one.
    """

    device: str
    url: str
    sampling_rate_hz: float
    channels: tuple[Channel, ...]
    groups: tuple[tuple[int, ...], ...]
    clock_hz: float | None = None


class Source(ABC):
    """A device that delivers samples.

    Use it as a context manager::

        with open_source("serial:/dev/ttyUSB0") as source:
            source.start()
            for delivery in source.read(timeout_s=0.2): ...

    Errors raised by any method are `SourceError`; after one the source can only be closed.
    """

    url: str

    @abstractmethod
    def open(self) -> None:
        """Connect and learn what the device is; `info` is known afterwards.

        Raises
        ------
        SourceError
            If there is no device, it does not answer in time, or describes itself impossibly.
        """

    @property
    @abstractmethod
    def info(self) -> SourceInfo:
        """What the device says about itself; SourceError before `open`."""

    def start(self) -> None:  # noqa: B027 - a source that streams anyway has nothing to do
        """Ask the device to begin sampling; a device that streams anyway ignores it."""

    @abstractmethod
    def read(self, timeout_s: float) -> Sequence[Delivery]:
        """What has arrived, in order of arrival.

        Returns as soon as there is something, or after `timeout_s` with nothing. Memory is bounded
        whatever the device sends.
        """

    def finish(self) -> Sequence[Delivery]:
        """Stop the device where it can be stopped and hand over what still waits for later samples.

        Called once, after the last `read` and before `close`. Nothing waits in most sources.
        """
        return ()

    @abstractmethod
    def close(self) -> None:
        """Stop the device where it can be stopped and let it go; may be called twice."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass(frozen=True)
class SourceURL:
    """``scheme:target?option=value&…`` taken apart.

    Attributes
    ----------
    text : str
        As it was given.
    scheme : str
        Name of the backend: file, serial, can, sim, or one that a plug-in brings.
    target : str
        What stands between the colon and the question mark.
    options : mapping of str to str
    """

    text: str
    scheme: str
    target: str
    options: Mapping[str, str] = field(default_factory=dict)
