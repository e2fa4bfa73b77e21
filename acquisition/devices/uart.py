"""The buffer between a device and a line that may be too slow, or a host that does not read.

A pseudo-terminal or a socket makes the writer wait. A UART does not: what finds no room is lost. This
is simulated before the frames reach the terminal, on the laboratory's clock, so that it repeats.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from acquisition.devices.faults import OverrunFault, Stall
from acquisition.devices.frames import FrameArray, FrameKind, place
from acquisition.devices.truth import Truth
from acquisition.devices.wire import Wire


class SlowLine:
    """A line of constant speed that stands still while the host does not read.

    Parameters
    ----------
    units_per_s : float or None
        Bytes or bits per second; None for a line without limit.
    stalls : sequence of Stall
    """

    def __init__(self, units_per_s: float | None, stalls: Sequence[Stall]) -> None:
        self._units_per_s = units_per_s
        self._stalls = sorted((stall.at_s, stall.at_s + stall.for_s) for stall in stalls)

    def done_s(self, begin_s: float, units: float) -> float:
        """When a transmission is done that begins at `begin_s` or as soon as the line moves.

        Examples
        --------
        >>> line = SlowLine(100.0, [Stall(at_s=1.0, for_s=2.0)])
        >>> line.done_s(0.5, 30.0), line.done_s(0.5, 80.0), line.done_s(2.0, 10.0)
        (0.8, 3.3, 3.1)
        """
        left_s = units / self._units_per_s if self._units_per_s else 0.0
        now_s = begin_s
        for from_s, to_s in self._stalls:
            if to_s <= now_s:
                continue
            if now_s + left_s <= from_s and not (left_s == 0.0 and now_s == from_s):
                break
            left_s -= max(from_s - now_s, 0.0)
            now_s = to_s
        return now_s + left_s


class Uart:
    """A FIFO of bytes. After an overflow nothing enters until it is half empty.

    The frame that overflows is cut. Its rest has no zero at its end, so that it takes the next frame
    with it; the first frame that gets through whole says that data were lost.

    Parameters
    ----------
    fault : OverrunFault
    wire : Wire
    truth : Truth
    """

    def __init__(self, fault: OverrunFault, wire: Wire, truth: Truth) -> None:
        bytes_per_s = fault.baud_rate / fault.bits_per_byte if fault.baud_rate else None
        self._line = SlowLine(bytes_per_s, fault.stalls)
        self._capacity, self._wire, self._truth = fault.fifo_bytes, wire, truth
        self._inside: deque[tuple[float, int]] = deque()
        self._n_inside = 0
        self._is_overflowing = self._is_torn = self._has_lost = False
        self._free_from_s = 0.0

    def carried(self, frames: FrameArray, stream: int, *, n_waiting_bytes: int = 0) -> FrameArray:
        """Frames as they come out at the other end; `due_s` is when their last byte does.

        Parameters
        ----------
        frames : FrameArray
            Serial frames in the order in which they are due.
        stream : int
            For the truth.
        n_waiting_bytes : int
            Bytes that the line has carried and the host has not taken; they fill the FIFO, too.
        """
        frames = frames.copy()
        for k in range(len(frames)):
            self._carry(frames, k, stream, n_waiting_bytes)
        return frames[[len(data) > 0 for data in frames["bytes"]]]

    def _carry(self, frames: FrameArray, k: int, stream: int, n_waiting_bytes: int) -> None:
        due_s, whole = float(frames["due_s"][k]), frames["bytes"][k]
        self._drain(due_s)
        room = self._room(n_waiting_bytes)
        survives = len(whole) <= room and not self._is_torn
        # the flag is set in a frame that gets through whole, else nobody would see it
        if survives and self._has_lost and self._wire.flag_lost_data(frames, k):
            self._has_lost, whole = False, frames["bytes"][k]
        # what finds no room is lost, not delayed: a UART does not make its writer wait
        data = whole[: max(room, 0)]
        frames["bytes"][k] = data
        if data:
            self._free_from_s = self._line.done_s(max(due_s, self._free_from_s), len(data))
            self._inside.append((self._free_from_s, len(data)))
            self._n_inside += len(data)
            # a cut frame has no zero at its end: the host reads it and the next one as one frame, and rejects both
            self._is_torn = len(data) < len(whole)
            frames["due_s"][k] = self._free_from_s
        if len(data) < len(whole):
            self._is_overflowing = self._has_lost = True
            self._truth.counts["overrun_bytes"] += len(whole) - len(data)
        if not survives:
            if frames["kind"][k] == FrameKind.SAMPLES:
                self._truth.note("overrun", stream=stream, **place(frames[k]))
            frames["kind"][k] = FrameKind.SPOILED

    def _drain(self, now_s: float) -> None:
        while self._inside and self._inside[0][0] <= now_s:
            self._n_inside -= self._inside.popleft()[1]

    def _room(self, n_waiting_bytes: int) -> int:
        used = self._n_inside + n_waiting_bytes
        if self._is_overflowing and used > self._capacity // 2:
            return 0
        self._is_overflowing = False
        return self._capacity - used


class TransmitQueue:
    """The queue of a CAN controller; a frame that finds it full is lost.

    Parameters
    ----------
    fault : OverrunFault
    wire : Wire
    truth : Truth

    Notes
    -----
    A frame of n data bytes takes 47 + 8 n bits and one stuff bit per ten bits that may be stuffed,
    (34 + 8 n)/10: 8333 full frames per second at 1 Mbit/s. CAN FD frames are taken at the same bit rate.
    """

    def __init__(self, fault: OverrunFault, wire: Wire, truth: Truth) -> None:
        self._line = SlowLine(fault.bit_rate, fault.stalls)
        self._capacity, self._wire, self._truth = fault.queue_frames, wire, truth
        self._inside: deque[float] = deque()
        self._lossy_groups: set[int] = set()
        self._free_from_s = 0.0

    def carried(self, frames: FrameArray, stream: int, *, n_waiting_bytes: int = 0) -> FrameArray:
        """Frames as they appear on the bus, those that were lost left out."""
        frames = frames.copy()
        kept = np.ones(len(frames), dtype=bool)
        for k in range(len(frames)):
            due_s, group = float(frames["due_s"][k]), int(frames["group"][k])
            is_samples = frames["kind"][k] == FrameKind.SAMPLES
            while self._inside and self._inside[0] <= due_s:
                self._inside.popleft()
            kept[k] = len(self._inside) < self._capacity
            if not kept[k]:
                if is_samples:
                    self._lossy_groups.add(group)
                    self._truth.note("overrun", stream=stream, **place(frames[k]))
                continue
            if is_samples and group in self._lossy_groups and self._wire.flag_lost_data(frames, k):
                self._lossy_groups.discard(group)
            n = int(frames["length"][k])
            # 47 bits of frame around the data and, on average, one stuff bit per ten bits that may be stuffed
            self._free_from_s = self._line.done_s(max(due_s, self._free_from_s), 47 + 8 * n + (34 + 8 * n) // 10)
            self._inside.append(self._free_from_s)
            frames["due_s"][k] = self._free_from_s
        return frames[kept]
