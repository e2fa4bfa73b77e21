"""A device at work: waits for its hosts, takes samples, makes frames of them, ends."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.endpoint import Endpoint
from acquisition.devices.faults import DisconnectFault
from acquisition.devices.faulty_frames import FrameFaults
from acquisition.devices.frames import FrameArray
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.sender import STEP_S, HostGoneError, Sender, StoppedError
from acquisition.devices.sensor_faults import SensorFaults
from acquisition.devices.signal import Piece, Signal
from acquisition.devices.truth import Truth
from acquisition.devices.wire import Wire
from acquisition.samples.channel import Channel

LINGER_S: Final = 10.0
"""So long the device waits at its end for the hosts to read everything and to go."""

# bounds what is prepared at once, and how late a device notices that it is to stop
_LONGEST_BLOCK_SAMPLES = 8192
_PACED_BLOCK_S, _UNPACED_BLOCK_S = 0.25, 1.0
_DESCRIBED_EVERY_S = 1.0  # as both protocols say
_UNPLUGGED_S = 0.5  # of the host's time, where physical time means nothing to it: as fast as possible
_READ_LINGER_S, _STOPPED_LINGER_S = 2.0, 1.0


@dataclass
class Progress:
    """Where a device stands.

    Attributes
    ----------
    stream : int
        Drawn at each start of the counter.
    base : int
        Counter of the signal's sample 0; negative after a restart.
    next_sample : int
        The next one to be taken.
    """

    stream: int
    base: int
    next_sample: int = 0

    @property
    def counter(self) -> int:
        """Counter of the next sample."""
        return self.base + self.next_sample


class Stretch(NamedTuple):
    """Samples first … last − 1, taken while the device is plugged in, or not because of `fault`."""

    first: int
    last: int
    fault: DisconnectFault | None = None


def stretches(faults: Sequence[DisconnectFault], clock: DeviceClock, n_samples: int) -> list[Stretch]:
    """All samples of a device in stretches with and without a connection.

    Examples
    --------
    >>> pulled = DisconnectFault(at_s=2.0, for_s=1.0)
    >>> [(s.first, s.last, s.fault is None) for s in stretches([pulled], DeviceClock(10.0), 100)]
    [(0, 20, True), (20, 30, False), (30, 100, True)]
    """
    found, position = [], 0
    for fault in sorted(faults, key=lambda fault: fault.at_s):
        first = min(clock.sample_at(fault.at_s), n_samples)
        last = min(clock.sample_at(fault.at_s + fault.for_s), n_samples)
        if first < n_samples:
            found += [Stretch(position, first), Stretch(first, last, fault)]
            position = last
    return [*found, Stretch(position, n_samples)]


@dataclass(eq=False)
class Player:
    """One device and its life.

    Attributes
    ----------
    signal : Signal
        What its sensors see, as its clock samples it.
    wire : Wire
    sender : Sender
    clock : DeviceClock
    streams : iterator of int
        Numbers of streams.
    sensor_faults : SensorFaults
    frame_faults : FrameFaults
    disconnects : sequence of DisconnectFault
    announcements : mapping of int to tuple of Channel
        Samples from which the device describes its channels differently.
    """

    signal: Signal
    wire: Wire
    sender: Sender
    clock: DeviceClock
    streams: Iterator[int]
    sensor_faults: SensorFaults
    frame_faults: FrameFaults
    disconnects: Sequence[DisconnectFault] = ()
    announcements: Mapping[int, tuple[Channel, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.progress = Progress(next(self.streams), self.clock.counter_start)
        self.has_lost_host = False
        self.awaited = self.endpoint.awaited  # other threads may read it
        self._described_second = -1
        self._block_end = 0
        self._has_arrived = False

    @property
    def endpoint(self) -> Endpoint:
        """Where the device appears."""
        return self.sender.endpoint

    @property
    def laboratory(self) -> LaboratoryTime:
        """Its clock on the wall."""
        return self.sender.laboratory

    @property
    def truth(self) -> Truth:
        """What it did."""
        return self.sender.truth

    def stop(self) -> None:
        """End the device from outside."""
        self.sender.stop.set()

    def describe(self) -> FrameArray:
        """What the device says about itself now."""
        return self.wire.description(self.progress.stream, self.progress.counter)

    def play(self) -> None:
        """Live: wait for the start, play everything, end, and wait until it has been read."""
        try:
            self._await_start()
            for stretch in stretches(self.disconnects, self.clock, self.signal.n_samples):
                if stretch.fault is None:
                    self._play(stretch)
                else:
                    self._pass_unplugged(stretch, stretch.fault)
            self._end()
        except HostGoneError:
            self.has_lost_host = True
        except StoppedError as stopped:
            self.progress.next_sample = self._block_end
            if stopped.next_counter is not None:
                self.progress.next_sample = stopped.next_counter - self.progress.base
            self._end()
        finally:
            if not self._has_arrived:
                # devices that never start must say so, too, or the others would wait for them without end
                self.laboratory.arrive()
            self.endpoint.close()

    def _await_start(self) -> None:
        while (awaited := self.endpoint.awaited).n_missing > 0:
            self.awaited = awaited
            self.sender.serve(STEP_S)
        self._has_arrived, self.awaited = True, awaited
        self.laboratory.arrive()
        while not self.laboratory.has_begun:
            self.sender.serve(STEP_S)

    def _play(self, stretch: Stretch) -> None:
        for start, stop in self._blocks(stretch):
            self._announce(start)
            self._block_end = stop
            frames = self._frames(start, self._taken(start, stop))
            self.sender.transmit(self.frame_faults.applied(frames, self.progress.stream), self.progress.stream)
            self.progress.next_sample = stop
        held = self.frame_faults.flushed()
        if held is not None:
            self.sender.transmit(held, self.progress.stream)
        self.sender.drain(self.progress.stream)

    def _blocks(self, stretch: Stretch) -> Iterator[tuple[int, int]]:
        """Samples prepared at once: a fraction of a second in real time, whole frames, one description."""
        block_s = min(_PACED_BLOCK_S * self.laboratory.speed, _UNPACED_BLOCK_S)
        samples = max(1, min(int(block_s * self.signal.sampling_rate_hz), _LONGEST_BLOCK_SAMPLES))
        # whole frames, so that blocks do not show in how samples are divided into frames
        length = max(samples // self.wire.samples_per_frame, 1) * self.wire.samples_per_frame
        inner = [sample for sample in sorted(self.announcements) if stretch.first < sample < stretch.last]
        for first, last in zip([stretch.first, *inner], [*inner, stretch.last], strict=True):
            for start in range(first, last, length):
                yield start, min(start + length, last)

    def _announce(self, start: int) -> None:
        if start in self.announcements:
            self.wire.described_as(self.announcements[start])
            # the new description is sent with the next frames, not a second later
            self._described_second = -1

    def _taken(self, start: int, stop: int) -> Piece:
        piece = self.sensor_faults.applied(start, self.signal.piece(start, stop))
        self.truth.n_taken += int(piece.taken.sum())
        return piece

    def _frames(self, start: int, piece: Piece) -> FrameArray:
        """Frames of a piece that begins with sample `start`; no frame spans a lost sample."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], piece.taken, [False]]).astype(np.int8)))
        parts = [self._description_due(start)]
        for first, last in edges.reshape(-1, 2).tolist():
            counter = self.progress.base + start + first
            parts.append(self.wire.samples(self.progress.stream, counter, piece.counts[first:last]))
            samples = parts[-1]["counter"] - self.progress.base + parts[-1]["n_samples"] - 1
            parts[-1]["due_s"] = self.clock.taken_s(samples)
        return np.concatenate(parts)

    def _description_due(self, start: int) -> FrameArray:
        said = self.wire.description(self.progress.stream, self.progress.base + start)
        said["due_s"] = self.clock.taken_s(np.array([start]))[0]
        second = int(start / (_DESCRIBED_EVERY_S * self.signal.sampling_rate_hz))
        is_due, self._described_second = second != self._described_second, second
        return said if is_due else said[:0]

    def _pass_unplugged(self, stretch: Stretch, fault: DisconnectFault) -> None:
        """Lose the connection; the counter runs on, or starts anew if the device lost power."""
        # what was sent before the plug was pulled arrives: a fault takes samples of its own interval only
        self.sender.await_read()
        self.endpoint.unplug()
        for group in range(self.wire.n_groups):
            self.truth.note(
                "disconnect",
                stream=self.progress.stream,
                group=group,
                counter=self.progress.base + stretch.first,
                n_samples=stretch.last - stretch.first,
            )
        for start, stop in self._blocks(stretch):
            self._announce(start)
            # the counter runs on, and stuck sensors and jitter go on as if the plug were in
            if not fault.restart:
                self._taken(start, stop)
        self._wait_unplugged(fault)
        self.endpoint.plug_in()
        self.progress.next_sample = stretch.last
        if fault.restart:
            # the counter of the next sample is 0
            self.progress = Progress(next(self.streams), -stretch.last, stretch.last)
        self._described_second = -1

    def _wait_unplugged(self, fault: DisconnectFault) -> None:
        if self.laboratory.is_paced:
            self.sender.await_until(fault.at_s + fault.for_s)
            return
        until_s = self.laboratory.monotonic_s() + _UNPLUGGED_S
        while self.laboratory.monotonic_s() < until_s:
            self.sender.serve(STEP_S)

    def _end(self) -> None:
        """Say that the stream is complete, and wait until the hosts have read it or gone."""
        # no stream was begun that could end
        if not self.laboratory.has_begun:
            return
        frames = self.wire.end(self.progress.stream, self.progress.counter)
        self.endpoint.send(frames, is_given_up=self.sender.is_given_up)
        until_s = self.laboratory.monotonic_s() + LINGER_S
        read_until_s = math.inf
        while self.endpoint.has_hosts and not self.sender.stop.is_set():
            now_s = self.laboratory.monotonic_s()
            patience_s = _STOPPED_LINGER_S if self.endpoint.is_stopped else _READ_LINGER_S
            read_until_s = min(read_until_s, now_s + patience_s) if self.endpoint.is_read() else math.inf
            if now_s > min(until_s, read_until_s):
                return
            self.endpoint.serve(STEP_S)
