"""How a serial device puts its samples on the wire."""

from __future__ import annotations

import dataclasses

import numpy as np

from acquisition.devices.device_clock import CLOCK_HZ, DeviceClock
from acquisition.devices.frames import SERIAL_FRAME, FrameArray, FrameKind, serial_frames
from acquisition.devices.wire import Wire
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import CountArray
from acquisition.wire.serial_calibration import Calibration, calibration_text
from acquisition.wire.serial_frames import (
    LONGEST_BODY,
    CalibrationFrame,
    EndFrame,
    SamplesFrame,
    encode_frame,
    encode_samples,
    parse,
)
from sloshlab.errors import InputError

# ten samples at 512 Hz: that many and more per frame are good measure
_USUAL_FRAME_S = 0.02
_REPEATS_OF_END = 3  # one lost frame must not hide the end
_FRAME_OVERHEAD_BYTES = 28  # header and checksum


class SerialWire(Wire):
    """Frames of a device with these channels.

    Parameters
    ----------
    device : str
    clock : DeviceClock
    channels : tuple of Channel
    samples_per_frame : int, optional
        As many as come in 20 ms if not given, within what a frame can hold.
    """

    n_groups = 1

    def __init__(
        self,
        device: str,
        clock: DeviceClock,
        channels: tuple[Channel, ...],
        *,
        samples_per_frame: int | None = None,
    ) -> None:
        self._device, self._clock, self.channels = device, clock, channels
        self._bytes_per_count = max(channel.bits for channel in channels) // 8
        longest = (LONGEST_BODY - _FRAME_OVERHEAD_BYTES) // (self._bytes_per_count * len(channels))
        if samples_per_frame is not None and not 1 <= samples_per_frame <= longest:
            raise InputError("--samples-per-frame", got=str(samples_per_frame), allowed=f"1 … {longest}")
        usual = min(max(round(_USUAL_FRAME_S * clock.sampling_rate_hz), 1), longest)
        self.samples_per_frame = samples_per_frame or usual

    def described_as(self, channels: tuple[Channel, ...]) -> None:
        """Describe the channels differently from now on."""
        self.channels = channels

    def samples(self, stream: int, first_counter: int, counts: CountArray) -> FrameArray:
        """Frames of consecutive samples."""
        ticks = self._clock.ticks(np.arange(first_counter, first_counter + len(counts)))
        frames = encode_samples(
            stream, first_counter, ticks, counts, self._bytes_per_count, samples_per_frame=self.samples_per_frame
        )
        made = np.zeros(len(frames), SERIAL_FRAME)
        starts = np.arange(len(frames)) * self.samples_per_frame
        made["counter"] = first_counter + starts
        made["n_samples"] = np.minimum(self.samples_per_frame, len(counts) - starts)
        for k, frame in enumerate(frames):
            made["bytes"][k] = frame
        return made

    def description(self, stream: int, counter: int) -> FrameArray:
        """The calibration frame."""
        text = calibration_text(Calibration(self._device, self._clock.sampling_rate_hz, CLOCK_HZ, self.channels))
        ticks = int(self._clock.ticks(np.array([counter]))[0])
        return serial_frames([encode_frame(CalibrationFrame(stream, counter, ticks, text))])

    def end(self, stream: int, counter: int) -> FrameArray:
        """The end of a stream whose next sample would have this counter, said three times."""
        return serial_frames([encode_frame(EndFrame(stream, counter))] * _REPEATS_OF_END)

    def garbage(self, n_bytes: int, generator: np.random.Generator) -> FrameArray:
        """A burst of noise; like a frame it ends with a zero, so that it harms no other."""
        noise = generator.integers(0, 256, n_bytes, dtype=np.uint8).tobytes()
        return serial_frames([noise + b"\0"], FrameKind.GARBAGE)

    def corrupted(self, frames: FrameArray, chosen: int, n_bits: int, generator: np.random.Generator) -> None:
        """Flip bits of one frame, in place; not of the zero that ends it."""
        # damage of the zero would join two frames: that is a fault of its own, as of an overrun
        body = np.frombuffer(frames["bytes"][chosen][:-1], np.uint8).copy()
        bits = generator.choice(8 * body.size, size=min(n_bits, 8 * body.size), replace=False)
        np.bitwise_xor.at(body, bits // 8, (1 << (bits % 8)).astype(np.uint8))
        frames["bytes"][chosen] = body.tobytes() + b"\0"

    def flag_lost_data(self, frames: FrameArray, chosen: int) -> bool:
        """Set the overrun bit of one frame, in place; False if the frame has none."""
        parsed = parse(frames["bytes"][chosen]).frames
        if frames["kind"][chosen] != FrameKind.SAMPLES or len(parsed) != 1:
            return False
        if not isinstance(parsed[0], SamplesFrame):
            return False
        frames["bytes"][chosen] = encode_frame(dataclasses.replace(parsed[0], overrun=True))
        return True
