"""How a device puts samples and words into frames, and how these can be spoilt."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from acquisition.devices.frames import FrameArray
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import CountArray


class Wire(ABC):
    """The frames of one device.

    Attributes
    ----------
    channels : tuple of Channel
    n_groups : int
        Groups of channels that travel together and share a counter.
    samples_per_frame : int
        At most.
    """

    channels: tuple[Channel, ...]
    n_groups: int
    samples_per_frame: int

    @abstractmethod
    def described_as(self, channels: tuple[Channel, ...]) -> None:
        """Describe the channels differently from now on."""

    @abstractmethod
    def samples(self, stream: int, first_counter: int, counts: CountArray) -> FrameArray:
        """Frames of consecutive samples."""

    @abstractmethod
    def description(self, stream: int, counter: int) -> FrameArray:
        """What the device says once per second."""

    @abstractmethod
    def end(self, stream: int, counter: int) -> FrameArray:
        """What it says at its end."""

    @abstractmethod
    def garbage(self, n_bytes: int, generator: np.random.Generator) -> FrameArray:
        """Bytes or frames that belong to nobody."""

    @abstractmethod
    def corrupted(self, frames: FrameArray, chosen: int, n_bits: int, generator: np.random.Generator) -> None:
        """Flip bits of one frame, in place."""

    @abstractmethod
    def flag_lost_data(self, frames: FrameArray, chosen: int) -> bool:
        """Say so in one frame, in place; False if it cannot carry that."""
