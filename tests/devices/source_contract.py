"""What every source must do, whatever brings the samples: one class, run on every backend."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from acquisition.sources import Block, End, Source, Trouble, open_source
from sloshlab.errors import SourceError

PATIENCE_S = 60.0


@dataclass(frozen=True)
class WorkingDevice:
    """A device that a source can be opened on.

    Attributes
    ----------
    url : str
    counts : ndarray of int, shape (n_samples, n_channels)
        What it will deliver.
    channels : list of str
    sampling_rate_hz : float
    """

    url: str
    counts: np.ndarray
    channels: list[str]
    sampling_rate_hz: float


@dataclass
class Delivered:
    """What a source has delivered, put in place by its counter."""

    counts: np.ndarray
    times_delivered: np.ndarray
    end: End | None
    troubles: list[Trouble]


class SourceContract:
    """The contract; a child class says which device, and what target there is not."""

    unknown_url: str
    """With ``FOLDER`` for an empty folder."""

    def device(self, folder, number: int) -> contextlib.AbstractContextManager[WorkingDevice]:
        """Device number 1 or 2, with samples of its own."""
        raise NotImplementedError

    @pytest.fixture
    def devices(self, tmp_path) -> Iterator[Callable[[int], WorkingDevice]]:
        """Makes devices and lets them go at the end."""
        with contextlib.ExitStack() as stack:
            yield lambda number=1: stack.enter_context(self.device(tmp_path, number))

    def test_it_says_nothing_before_it_is_open(self, devices):
        source = open_source(devices().url)
        with pytest.raises(SourceError):
            _ = source.info
        with pytest.raises(SourceError):
            source.read(0.0)
        source.close()

    def test_it_says_what_the_device_is(self, devices):
        device = devices()
        with open_source(device.url) as source:
            info = source.info
            assert info.url == source.url == device.url
            assert [channel.name for channel in info.channels] == device.channels
            assert info.sampling_rate_hz == device.sampling_rate_hz
            assert sorted(index for group in info.groups for index in group) == list(range(len(device.channels)))
            for channel in info.channels:
                assert channel.name.startswith(channel.quantity + "_")
                assert channel.bits in (16, 24, 32)
                assert np.isfinite(channel.scale_factor)

    def test_every_sample_is_delivered_once_in_its_place(self, devices):
        device = devices()
        with open_source(device.url) as source:
            source.start()
            delivered = everything(source, device)
        assert_complete(delivered, device)

    def test_a_read_in_silence_takes_its_time_and_no_processor(self, devices):
        device = devices()
        with open_source(device.url) as source:
            source.start()
            everything(source, device)
            began_s, used_s = time.monotonic(), time.thread_time()
            silent = [delivery for _ in range(3) for delivery in source.read(0.2)]
            waited_s, used_s = time.monotonic() - began_s, time.thread_time() - used_s
        # the device may hang up after its end; anything else would be invented
        assert not [delivery for delivery in silent if not isinstance(delivery, Trouble)]
        assert waited_s > 0.5 or silent
        assert used_s < 0.25 * waited_s + 0.02

    def test_a_read_without_patience_returns_at_once(self, devices):
        device = devices()
        with open_source(device.url) as source:
            source.start()
            everything(source, device)
            used_s = time.thread_time()
            for _ in range(20):
                source.read(0.0)
            assert time.thread_time() - used_s < 1.0

    def test_it_can_be_closed_twice_and_is_closed_then(self, devices):
        source = open_source(devices().url)
        source.open()
        source.close()
        source.close()
        with pytest.raises(SourceError):
            source.read(0.0)

    def test_nothing_is_left_of_it(self, tmp_path):
        with self.device(tmp_path, 1) as device, open_source(device.url) as source:
            source.start()
            everything(source, device)
        descriptors, threads = open_descriptors(), set(threading.enumerate())
        with self.device(tmp_path, 2) as device, open_source(device.url) as source:
            source.start()
            everything(source, device)
        assert open_descriptors() == descriptors
        assert set(threading.enumerate()) == threads

    def test_an_error_of_the_user_closes_it(self, devices):
        url = devices().url
        source = open_source(url)
        with pytest.raises(ZeroDivisionError):
            start_and_fail(source)
        with pytest.raises(SourceError):
            source.read(0.0)

    def test_an_unknown_target_is_one_line(self, tmp_path):
        descriptors = open_descriptors()
        with pytest.raises(SourceError) as caught:
            open_source(self.unknown_url.replace("FOLDER", str(tmp_path))).open()
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) > 20
        assert open_descriptors() == descriptors

    def test_two_sources_do_not_disturb_each_other(self, devices):
        first, second = devices(1), devices(2)
        with open_source(first.url) as first_source, open_source(second.url) as second_source:
            first_source.start()
            second_source.start()
            collecting = [Collector(first, first_source), Collector(second, second_source)]
            deadline = time.monotonic() + PATIENCE_S
            while not all(collector.is_finished for collector in collecting):
                assert time.monotonic() < deadline, "no end"
                for collector, source in zip(collecting, (first_source, second_source), strict=True):
                    collector.take(source.read(0.0 if collector.is_finished else 0.02))
        assert_complete(collecting[0].delivered, first)
        assert_complete(collecting[1].delivered, second)


def start_and_fail(source: Source) -> None:
    """A user whose work goes wrong."""
    with source:
        source.start()
        raise ZeroDivisionError


class Collector:
    """Puts the samples of a source in place and counts how often each came."""

    def __init__(self, device: WorkingDevice, source: Source) -> None:
        self._groups = source.info.groups
        self._stream: int | None = None
        self.delivered = Delivered(
            np.zeros(device.counts.shape, np.int64), np.zeros(device.counts.shape, np.int64), None, []
        )

    @property
    def is_finished(self) -> bool:
        """Whether the end has come."""
        return self.delivered.end is not None

    def take(self, deliveries) -> None:
        """Put deliveries in place."""
        for delivery in deliveries:
            if isinstance(delivery, Block):
                self._take_block(delivery)
            elif isinstance(delivery, End):
                assert self.delivered.end is None, "two ends"
                self.delivered.end = delivery
            else:
                self.delivered.troubles.append(delivery)

    def _take_block(self, block: Block) -> None:
        assert block.counts.dtype == np.int32
        assert block.counts.ndim == 2
        assert len(block.counts) > 0
        assert self._stream in (None, block.stream)
        self._stream = block.stream
        assert block.host_monotonic_ns > 0
        assert block.host_utc_ns > 1_600_000_000_000_000_000
        columns = self._groups[block.group]
        assert block.counts.shape[1] == len(columns)
        rows = slice(block.counter, block.counter + len(block.counts))
        assert rows.stop <= len(self.delivered.counts), "a sample that the device never took"
        self.delivered.counts[rows, columns] = block.counts
        self.delivered.times_delivered[rows, columns] += 1


def everything(source: Source, device: WorkingDevice) -> Delivered:
    """All that a started source delivers up to its end."""
    collector = Collector(device, source)
    deadline = time.monotonic() + PATIENCE_S
    while not collector.is_finished:
        assert time.monotonic() < deadline, "no end"
        collector.take(source.read(0.2))
    return collector.delivered


def assert_complete(delivered: Delivered, device: WorkingDevice) -> None:
    """Every sample once, with its counts, no trouble, and an end that knows how many there were."""
    assert delivered.troubles == []
    np.testing.assert_array_equal(delivered.times_delivered, np.ones(device.counts.shape, np.int64))
    np.testing.assert_array_equal(delivered.counts, device.counts)
    assert delivered.end is not None
    assert delivered.end.n_samples == len(device.counts)


def open_descriptors() -> list[str]:
    """Kinds and places of the files, sockets and terminals that this process has open."""
    found = []
    for number in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            target = os.readlink(f"/proc/self/fd/{number}")
            if "/proc/" not in target:  # the listing itself
                found.append(target.split(":")[0])
    return sorted(found)
