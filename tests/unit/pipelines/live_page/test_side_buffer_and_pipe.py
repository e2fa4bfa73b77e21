"""From the recorder to the page's process: nothing waits, what is skipped is counted, the rest arrives."""

from __future__ import annotations

import io
import threading

import numpy as np
import pytest

from acquisition.samples.delivery import Block, Trouble, TroubleKind
from pipelines.live_page.pipe_frames import joined, packed_blocks, packed_message, read_frames
from pipelines.live_page.side_buffer import SideBuffer


def block(counter: int, n_samples: int = 10, *, stream: int = 1, group: int = 0) -> Block:
    counts = (np.arange(counter, counter + n_samples)[:, np.newaxis] * [1, -3]).astype(np.int32)
    return Block(group, stream, counter, counts, None, counter * 1000, 5)


def test_what_does_not_fit_is_skipped_and_counted() -> None:
    buffer = SideBuffer(most_bytes=1000)
    for counter in range(0, 100, 10):  # 80 bytes and 200 for the delivery: three fit
        buffer.put(0, [block(counter)])
    assert buffer.n_skipped == 70
    assert [one.counter for _, one in buffer.take() if isinstance(one, Block)] == [0, 10, 20]
    buffer.put(1, [block(100), Trouble(TroubleKind.GARBAGE, "", 1, 0)])
    assert [source for source, _ in buffer.take()] == [1, 1]
    assert buffer.n_skipped == 70


def test_whoever_puts_never_waits_for_who_takes() -> None:
    """A thread that takes one thing and then nothing more: every call of the other returns."""
    buffer = SideBuffer(most_bytes=100_000)
    is_stopped = threading.Event()
    taking = threading.Thread(target=lambda: (buffer.take(), is_stopped.wait(30)))
    taking.start()
    for counter in range(0, 100_000, 10):
        buffer.put(0, [block(counter)])
    assert taking.is_alive()
    is_stopped.set()
    taking.join()
    kept = sum(len(one.counts) for _, one in buffer.take() if isinstance(one, Block))
    assert 0 < kept <= 100_000 - buffer.n_skipped


@pytest.mark.parametrize("n_bytes", [3, 40])
def test_frames_come_back_and_a_cut_one_ends_them(n_bytes: int) -> None:
    data = packed_message("event", {"message": "µ – ≤"}) + packed_blocks(3, [block(70), block(80, 5)])
    said, (source, found) = read_frames(io.BytesIO(data + packed_blocks(1, [block(9)])[:n_bytes]))
    assert said == {"about": "event", "message": "µ – ≤"}
    assert (source, found.group, found.stream, found.counter) == (3, 0, 1, 70)
    assert found.host_monotonic_ns == 80_000
    np.testing.assert_array_equal(found.counts, block(70, 15).counts)


def test_only_what_follows_is_joined() -> None:
    deliveries = [
        (0, block(0)), (0, block(10)), (1, block(20)), (0, block(20)), (0, block(40)),
        (0, block(50, stream=2)), (0, block(50, group=1)), (0, block(60, stream=2)),
    ]  # fmt: skip
    found = [(source, own[0].group, [one.counter for one in own]) for source, own in joined(deliveries)]
    assert sorted(found) == [
        (0, 0, [0, 10, 20]), (0, 0, [40]), (0, 0, [50, 60]), (0, 1, [50]), (1, 0, [20]),
    ]  # fmt: skip
