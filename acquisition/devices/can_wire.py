"""How a CAN device puts its samples on the bus."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.frames import FrameArray, FrameKind, can_frame
from acquisition.devices.wire import Wire
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import CountArray
from acquisition.wire.can_frames import ENDED, LOST_DATA, RUNNING, checksums, control_frame, encode_samples
from acquisition.wire.can_layout import STATUS, STATUS_ID, CanLayout, SampleMessage
from sloshlab.errors import InputError

FOREIGN_IDS: Final = range(0x600, 0x640)
"""Identifiers of frames that belong to somebody else on the bus."""

_REPEATS_OF_END = 3  # one lost frame must not hide the end
_LATCH_SAMPLES = 8  # as far as the three bits of the multiplexor count


class CanWire(Wire):
    """Frames of a device with this layout.

    Parameters
    ----------
    layout : CanLayout
    clock : DeviceClock
    """

    def __init__(self, layout: CanLayout, clock: DeviceClock) -> None:
        if layout.clock_hz is None or layout.status is None:
            raise InputError("layout of a simulated device", got="no clock or status", allowed="ours")
        self.layout, self._clock = layout, clock
        self.channels = layout.channels
        self.n_groups = len(layout.messages)
        self.samples_per_frame = max(message.samples_per_frame for message in layout.messages)
        # classic frames in rows of 8 bytes: most of 64 would be copied for nothing
        self._type = can_frame(64 if layout.fd else 8)
        self._messages: dict[int, SampleMessage] = {m.arbitration_id: m for m in layout.messages}

    def described_as(self, channels: tuple[Channel, ...]) -> None:
        """Nothing: a CAN device describes its channels in its DBC file only."""

    def samples(self, stream: int, first_counter: int, counts: CountArray) -> FrameArray:
        """Frames of consecutive samples, in the order in which their last samples are taken."""
        counters = np.arange(first_counter, first_counter + len(counts))
        latched = self._clock.ticks(np.array([first_counter // _LATCH_SAMPLES * _LATCH_SAMPLES]))
        encoded = encode_samples(
            self.layout, first_counter, self._clock.ticks(counters), counts, latched_ticks=int(latched[0])
        )
        parts = []
        for group, ((arbitration_id, data), message) in enumerate(zip(encoded, self.layout.messages, strict=True)):
            starts = np.arange(len(data)) * message.samples_per_frame
            part = np.zeros(len(data), self._type)
            part["group"], part["id"], part["length"] = group, arbitration_id, message.length
            part["counter"] = first_counter + starts
            part["n_samples"] = np.minimum(message.samples_per_frame, len(counts) - starts)
            part["data"][:, : message.length] = data
            parts.append(part)
        made = np.concatenate(parts)
        # A frame can leave when its last sample has been taken; stable, so that messages keep their order.
        return made[np.argsort(made["counter"] + made["n_samples"], kind="stable")]

    def description(self, stream: int, counter: int) -> FrameArray:
        """``device_status``: running."""
        return self._status(RUNNING, stream, counter, 1)

    def end(self, stream: int, counter: int) -> FrameArray:
        """``device_status``: ended, said three times."""
        return self._status(ENDED, stream, counter, _REPEATS_OF_END)

    def _status(self, state: int, stream: int, counter: int, n_times: int) -> FrameArray:
        data = control_frame(STATUS, state=state, stream=stream, n_samples=counter)
        made = np.zeros(n_times, self._type)
        made["kind"], made["id"], made["length"] = FrameKind.CONTROL, STATUS_ID, len(data)
        made["data"][:, : len(data)] = np.frombuffer(data, np.uint8)
        return made

    def garbage(self, n_bytes: int, generator: np.random.Generator) -> FrameArray:
        """Frames of somebody else with about so many bytes of data, the last one an error frame."""
        made = np.zeros(-(-n_bytes // 8) + 1, self._type)
        made["kind"], made["length"] = FrameKind.GARBAGE, 8
        made["id"] = generator.choice(FOREIGN_IDS, len(made))
        made["data"][:, :8] = generator.integers(0, 256, (len(made), 8))
        made["kind"][-1], made["id"][-1], made["length"][-1] = FrameKind.ERROR, 4, 0
        return made

    def corrupted(self, frames: FrameArray, chosen: int, n_bits: int, generator: np.random.Generator) -> None:
        """Flip data bits of one frame, in place."""
        n_all = 8 * int(frames["length"][chosen])
        for bit in generator.choice(n_all, size=min(n_bits, n_all), replace=False):
            frames["data"][chosen, bit // 8] ^= 1 << (bit % 8)

    def flag_lost_data(self, frames: FrameArray, chosen: int) -> bool:
        """Set the bit of lost data in one frame, in place; False if the frame carries no flags."""
        message = self._messages.get(int(frames["id"][chosen]))
        # only one in eight classic frames carries the flags: the next that does will say it
        if message is None or message.flags is None or frames["kind"][chosen] != FrameKind.SAMPLES:
            return False
        row = frames["data"][chosen : chosen + 1, : message.length]
        selector = int(message.multiplexor.read(row)[0]) if message.multiplexor is not None else 0
        if message.flags.selectors and selector not in message.flags.selectors:
            return False
        message.flags.field.write(row, LOST_DATA)
        if message.crc is not None:
            value = checksums(message.arbitration_id, row, message.crc)
            # `write` only sets bits
            for piece in message.crc.pieces():
                row[:, piece.byte] = 0
            message.crc.write(row, value)
        return True
