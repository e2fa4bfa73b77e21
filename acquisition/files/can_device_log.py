"""Logs of devices that count their samples: placed by the counter, as the recorder does, not by time stamps.

The frames go the way that live ones go (`acquisition.wire.can_receiver`); what is lost is NaN, and
counts stay counts.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.files.can_database import read_layout
from acquisition.files.reading_limits import LARGEST_DECODED_BYTES, check_declared
from acquisition.files.table import Column, RawCounts
from acquisition.samples.channel import Channel, attributes_of
from acquisition.samples.delivery import Block, CountArray, Delivery, Trouble, TroubleKind
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_layout import CanLayout, ControlMessage, SampleMessage
from acquisition.wire.can_receiver import CanReceiver
from sloshlab.errors import FileFormatError, SourceError

# taken apart together, which is far cheaper than one by one
_FRAMES_AT_ONCE: Final = 8192
_STARTED_FOR_US_S: Final = 1.0
"""A stream whose first sample has a counter below this began with the log: what is missing then was lost."""


class DeviceLog:
    """Collects the frames of one device from a log.

    Parameters
    ----------
    path : Path
        Of the log, for messages.
    layout : CanLayout
    """

    def __init__(self, path: Path, layout: CanLayout) -> None:
        self._path, self._layout = path, layout
        self._receiver = CanReceiver(layout)
        controls = [control for control in (layout.status, layout.command) if control is not None]
        everything: list[SampleMessage | ControlMessage] = [*layout.messages, *controls]
        # both, as an identifier of 11 bits and one of 29 may have the same number
        self._keys = {(message.arbitration_id, message.extended) for message in everything}
        self._pending: list[Any] = []
        self._buses: set[Any] = set()
        self._blocks: dict[int, list[Block]] = {}
        self._ends: dict[int, int | None] = {}
        self._troubles: Counter[TroubleKind] = Counter()

    @classmethod
    def of_database(cls, path: Path, database: Path, signals: set[str]) -> DeviceLog | None:
        """A collector if the database describes a sample counter.

        Raises
        ------
        FileFormatError
            If it has one but breaks the convention of ``docs/can_protocol.md``.
        """
        if "sample_counter_0" not in signals:
            return None
        try:
            return cls(path, read_layout(database))
        except SourceError as error:
            raise FileFormatError(error.what, got=error.got, allowed=error.allowed, remedy=error.remedy) from error

    def takes(self, message: Any) -> bool:
        """Whether a frame of python-can is one of the device's; it is kept then."""
        if (message.arbitration_id, bool(message.is_extended_id)) not in self._keys:
            return False
        self._buses.add(message.channel)
        self._pending.append(message)
        if len(self._pending) >= _FRAMES_AT_ONCE:
            self._feed()
        return True

    def finish(self) -> None:
        """Decide what still waits: no more frames come.

        Raises
        ------
        FileFormatError
            If the frames were on several buses, or their counter makes no sense.
        """
        self._feed()
        self._keep(self._receiver.finish(0))
        if len(self._buses) > 1:
            raise FileFormatError(
                f"source {self._path}",
                got=f"frames of {self._layout.device} on channels {', '.join(sorted(map(str, self._buses)))}",
                allowed="one channel",
                remedy="state can_channel in [source]",
            )

    def _feed(self) -> None:
        pending, self._pending = self._pending, []
        if not pending:
            return
        # they serve to notice silences in which a counter may have come round, never to place samples
        stamps_ns = np.array([round(message.timestamp * 1e9) for message in pending], np.int64)
        self._keep(self._receiver.take(FrameBatch.from_messages(pending), stamps_ns, stamps_ns))
        error = self._receiver.failure
        if error is not None:
            what = f"source {self._path}: {error.what}"
            raise FileFormatError(what, got=error.got, allowed=error.allowed, remedy=error.remedy) from error

    def _keep(self, deliveries: list[Delivery]) -> None:
        for delivery in deliveries:
            if isinstance(delivery, Block):
                self._blocks.setdefault(delivery.stream, []).append(delivery)
            elif isinstance(delivery, Trouble):
                self._troubles[delivery.kind] += delivery.count
            else:
                self._ends[delivery.stream] = delivery.n_samples

    @property
    def _main_stream(self) -> int | None:
        """The stream with the most samples; a recording can hold one."""
        sizes = {stream: sum(len(block.counts) for block in blocks) for stream, blocks in self._blocks.items()}
        return max(sizes, key=lambda stream: sizes[stream], default=None)

    def columns(self) -> Iterator[Column]:
        """One column per channel, all of the same length.

        Raises
        ------
        FileFormatError
            If so much is missing that the columns would not fit into memory.
        """
        stream = self._main_stream
        if stream is None:
            return
        blocks = self._blocks[stream]
        first, stop = self._bounds(stream)
        check_declared(
            self._path,
            "samples with gaps",
            # before the arrays: a wrong counter may span years
            12 * (stop - first) * len(self._layout.channels),
            LARGEST_DECODED_BYTES,
        )
        for group, message in enumerate(self._layout.messages):
            group_blocks = [block for block in blocks if block.group == group]
            if group_blocks:
                counts, is_there = _placed(group_blocks, first, stop, len(message.channels))
                for number, index in enumerate(message.channels):
                    channel = self._layout.channels[index]
                    yield self._column(message.name, channel, counts[:, number], is_there)

    def _bounds(self, stream: int) -> tuple[int, int]:
        blocks = self._blocks[stream]
        first = min(block.counter for block in blocks)
        stop = max(block.counter + len(block.counts) for block in blocks)
        if first <= math.ceil(_STARTED_FOR_US_S * self._layout.sampling_rate_hz):
            first = 0
        return first, max(stop, self._ends.get(stream) or 0)

    def _column(self, message: str, channel: Channel, counts: CountArray, is_there: NDArray[np.bool_]) -> Column:
        if channel.missing_count is not None:
            is_there = is_there & (counts != channel.missing_count)
        values = counts.astype(np.float64) * channel.scale_factor + channel.add_offset
        values[~is_there] = np.nan
        # the device's integers beside the lost ones as well, so that the recording is the one that the recorder
        # makes
        stored: CountArray | NDArray[np.int16] = counts.astype(np.int16) if channel.bits == 16 else counts.copy()
        return Column(
            f"{message}.{channel.name}",
            values,
            units=channel.units or None,
            step_s=1.0 / self._layout.sampling_rate_hz,
            raw=RawCounts(stored, channel.scale_factor, channel.add_offset),
            aliases=(channel.name,),
            declared=_declared(channel),
        )

    def traps(self) -> list[str]:
        """What a person should know about the log."""
        name, stream = self._layout.device, self._main_stream
        if stream is None:
            return [f"{name}: no sample of the device is in the log"] if self._buses else []
        first, stop = self._bounds(stream)
        traps = [
            f"{name}: placed by its sample counter at {self._layout.sampling_rate_hz:.9g} Hz, as the "
            "database says; the time stamps of the log are not used"
        ]
        for group, message in enumerate(self._layout.messages):
            group_blocks = [block for block in self._blocks[stream] if block.group == group]
            n_lost = stop - first - sum(len(block.counts) for block in group_blocks)
            if n_lost:
                traps.append(
                    f"{message.name}: {n_lost} of {stop - first} samples are lost; they are NaN and flagged"
                )
        traps += [f"{name}: {kind.value} ({count})" for kind, count in self._troubles.items()]
        if self._receiver.n_repeated:
            traps.append(f"{name}: {self._receiver.n_repeated} frames came twice")
        if self._ends.get(stream) is None:
            traps.append(f"{name}: the log does not hold the end of the stream; samples may be missing there")
        traps += [
            f"{name}: stream {other} is left out ({sum(len(block.counts) for block in blocks)} samples)"
            for other, blocks in self._blocks.items()
            if other != stream
        ]
        return traps


def _declared(channel: Channel) -> dict[str, Any]:
    """What the database says about the sensor."""
    attributes = attributes_of(channel)
    return {key: value for key, value in attributes.items() if key not in ("units", "quantity")}


def _placed(blocks: list[Block], first: int, stop: int, n_channels: int) -> tuple[CountArray, NDArray[np.bool_]]:
    """Counts at their places, and which places have any."""
    counts = np.zeros((stop - first, n_channels), np.int32)
    is_there = np.zeros(stop - first, np.bool_)
    for block in blocks:
        at = slice(block.counter - first, block.counter - first + len(block.counts))
        counts[at] = block.counts
        is_there[at] = True
    return counts, is_there
