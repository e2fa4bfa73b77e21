"""Sensors that are stuck, clipped, or connected where another belongs: faults of samples, not of frames."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.faults import SENSOR_FAULTS, ClippedFault, Faults, StuckFault, SwappedFault
from acquisition.devices.signal import Piece
from acquisition.devices.truth import Truth
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import CountArray


class SensorFaults:
    """What a device's sensors make of the true counts.

    Exchanged sensors act first, then clipped ones, then stuck ones. Missing readings stay missing.

    Parameters
    ----------
    faults : Faults
    channels : sequence of Channel
    clock : DeviceClock
        Tells which samples fall into the times of a fault.
    truth : Truth
        Where it is noted what was changed.
    """

    def __init__(self, faults: Faults, channels: Sequence[Channel], clock: DeviceClock, truth: Truth) -> None:
        self._faults, self._channels, self._clock, self._truth = faults, tuple(channels), clock, truth
        self._numbers = {channel.name: k for k, channel in enumerate(channels)}
        self._held: dict[StuckFault, int] = {}

    def announcements(self) -> dict[int, tuple[Channel, ...]]:
        """Samples from which the device describes its channels differently, and how.

        Sensors that are exchanged take their serial numbers along.
        """
        described: dict[int, tuple[Channel, ...]] = {}
        channels = list(self.first_description())
        moments = [(fault.from_s, fault) for fault in self._faults.swapped if fault.announced]
        moments += [(fault.to_s, fault) for _, fault in moments if math.isfinite(fault.to_s)]
        for time_s, fault in sorted(moments, key=lambda moment: moment[0]):
            a, b = (self._numbers[name] for name in fault.channels)
            first, second = channels[a], channels[b]
            channels[a] = dataclasses.replace(first, sensor_serial=second.sensor_serial)
            channels[b] = dataclasses.replace(second, sensor_serial=first.sensor_serial)
            described[self._clock.sample_at(time_s)] = tuple(channels)
        return described

    def first_description(self) -> tuple[Channel, ...]:
        """The channels as described before any fault; with serial numbers if those are to change."""
        if not any(fault.announced for fault in self._faults.swapped):
            return self._channels
        return tuple(
            dataclasses.replace(channel, sensor_serial=channel.sensor_serial or f"sensor-{k + 1}")
            for k, channel in enumerate(self._channels)
        )

    def applied(self, start: int, piece: Piece) -> Piece:
        """Counts as the faulty sensors give them; pieces in order, `start` is the first sample's number."""
        counts, samples = piece.counts.copy(), np.arange(start, start + len(piece.counts))
        act: dict[str, Callable[..., int]] = {"swapped": self._swap, "clipped": self._clip, "stuck": self._stick}
        for name in SENSOR_FAULTS:
            for fault in getattr(self._faults, name):
                n_changed = act[name](fault, counts, samples)
                if n_changed:
                    self._truth.counts[name] += n_changed
        # a sample that the device says it has not cannot be stuck, clipped or another sensor's
        for k, channel in enumerate(self._channels):
            if channel.missing_count is not None:
                missing = piece.counts[:, k] == channel.missing_count
                counts[missing, k] = channel.missing_count
        return Piece(counts, piece.taken)

    def _during(
        self, fault: StuckFault | ClippedFault | SwappedFault, samples: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        last = self._clock.sample_at(fault.to_s) if math.isfinite(fault.to_s) else np.iinfo(np.int64).max
        return (samples >= self._clock.sample_at(fault.from_s)) & (samples < last)

    def _swap(self, fault: SwappedFault, counts: CountArray, samples: NDArray[np.int64]) -> int:
        rows = self._during(fault, samples)
        a, b = (self._numbers[name] for name in fault.channels)
        counts[rows, a], counts[rows, b] = (
            _as_if_from(counts[rows, b], self._channels[b], self._channels[a]),
            _as_if_from(counts[rows, a], self._channels[a], self._channels[b]),
        )
        return int(rows.sum())

    def _clip(self, fault: ClippedFault, counts: CountArray, samples: NDArray[np.int64]) -> int:
        rows, k = self._during(fault, samples), self._numbers[fault.channel]
        channel = self._channels[k]
        ends = sorted((sign * fault.limit - channel.add_offset) / channel.scale_factor for sign in (-1.0, 1.0))
        # a limit that is a whole count must not lose one by its last digit
        lowest, highest = math.ceil(ends[0] - 1e-9), math.floor(ends[1] + 1e-9)
        clipped = np.clip(counts[rows, k], lowest, highest)
        n_changed = int((clipped != counts[rows, k]).sum())
        counts[rows, k] = clipped
        return n_changed

    def _stick(self, fault: StuckFault, counts: CountArray, samples: NDArray[np.int64]) -> int:
        rows, k = self._during(fault, samples), self._numbers[fault.channel]
        if rows.any():
            # kept over blocks: the sensor stays at the count of its first stuck sample
            held = self._held.setdefault(fault, int(counts[np.argmax(rows), k]))
            counts[rows, k] = held
        return int(rows.sum())


def _as_if_from(counts: CountArray, own: Channel, other: Channel) -> CountArray:
    """Counts of `own` as the input of `other` gives the same value."""
    if (own.scale_factor, own.add_offset, own.units) == (other.scale_factor, other.add_offset, other.units):
        converted = counts.astype(np.float64)
    else:
        values = counts * own.scale_factor + own.add_offset
        converted = np.rint((values - other.add_offset) / other.scale_factor)
    limit = 1 << (other.bits - 1)
    # the lowest count is left out, as it may stand for a missing reading
    return np.clip(converted, 1 - limit, limit - 1).astype(np.int32)
