"""What the tracker proves, and what it must not believe; the bits in each frame are written out by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from acquisition.samples.channel import Channel
from acquisition.wire.can_bits import BitField
from acquisition.wire.can_counter import CounterTracker
from acquisition.wire.can_layout import SampleMessage, Selected, device_database

RATE_HZ = 1000.0
MESSAGE = device_database("daq", RATE_HZ, None, [Channel("force_cell_1", "force", "N")]).messages[0]


def on_the_wire(counters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bits of the counter in classic frames, and which are known: 0–7 always, one more byte in three of eight."""
    counters = np.asarray(counters, np.int64)
    known = np.full(len(counters), 0xFF, np.int64)
    known[counters % 8 == 0] |= 0xFF00
    known[counters % 8 == 1] |= 0xFF0000
    known[counters % 8 == 2] |= 0xFF000000
    return counters & known, known


def tracked(
    counters: np.ndarray,
    *,
    begin: int | None = None,
    end: int | None = None,
    per_call: int = 50,
    tracker: CounterTracker | None = None,
) -> np.ndarray:
    """Counter of every frame, −1 where not accepted."""
    tracker = tracker or CounterTracker(MESSAGE, RATE_HZ)
    if begin is not None:
        tracker.begin_near(begin)
        tracker.begins_at(begin)
    value, known = on_the_wire(counters)
    found = [
        tracker.take(value[k : k + per_call], known[k : k + per_call]).counters
        for k in range(0, len(value), per_call)
    ]
    if end is not None:
        found.append(tracker.ends_at(end).counters)
    found.append(tracker.give_up().counters)
    joined = np.concatenate(found)
    assert len(joined) == len(counters)
    return joined


class TestCleanStream:
    @pytest.mark.parametrize("per_call", [1, 3, 8, 1000, 100_000])
    @pytest.mark.parametrize("start", [0, 5, 2**16 - 300, 2**24 - 300, 2**32 - 300])
    def test_every_frame_is_accepted(self, start: int, per_call: int) -> None:
        counters = np.arange(start, start + 700)
        found = tracked(counters, begin=start, end=start + 700, per_call=per_call)
        np.testing.assert_array_equal(found, counters)

    def test_many_frames_in_one_call(self) -> None:
        counters = np.arange(300_000)
        np.testing.assert_array_equal(tracked(counters, begin=0, end=300_000, per_call=300_000), counters)

    def test_nothing_is_accepted_before_it_is_proved(self) -> None:
        tracker = CounterTracker(MESSAGE, RATE_HZ)
        tracker.begins_at(0)
        value, known = on_the_wire(np.arange(8))
        assert not tracker.take(value[:2], known[:2]).accepted.any()
        # frames 0, 1, 2 prove frame 0 and no other: behind it 256 frames may be missing
        assert tracker.take(value[2:], known[2:]).counters.tolist() == [0]
        assert tracker.n_waiting == 7

    @pytest.mark.parametrize("n_samples", [1, 2, 9, 256, 257])
    def test_short_stream_is_whole_with_its_end(self, n_samples: int) -> None:
        found = tracked(np.arange(n_samples), begin=0, end=n_samples)
        assert found.tolist() == list(range(n_samples))

    def test_without_beginning_and_end_a_few_at_the_ends_are_given_up(self) -> None:
        counters = np.arange(123_456, 124_456)
        found = tracked(counters)
        refused = np.flatnonzero(found < 0)
        assert set(found[found >= 0]) <= set(counters)
        np.testing.assert_array_equal(found[found >= 0], counters[found >= 0])
        assert ((refused < 16) | (refused >= 984)).all()


class TestGaps:
    @pytest.mark.parametrize(
        "n_lost", [1, 7, 64, 128, 192, 255, 256, 257, 511, 512, 4096, 65536, 196608, 2**20 + 256]
    )
    @pytest.mark.parametrize("at", [400, 403, 407])
    def test_no_frame_beside_a_gap_is_moved(self, n_lost: int, at: int) -> None:
        counters = np.concatenate([np.arange(at), np.arange(at + n_lost, at + n_lost + 400)])
        found = tracked(counters, begin=0, end=at + n_lost + 400)
        accepted = found >= 0
        np.testing.assert_array_equal(found[accepted], counters[accepted])
        # only a gap that the low 8 bits cannot show costs frames, those to the next page on either side
        assert (~accepted).sum() <= (0 if n_lost <= 128 else 18)
        assert (np.abs(counters[~accepted] - at) < n_lost + 16).all()

    @pytest.mark.parametrize("k", [1, 2, 256, 257])
    def test_loss_of_multiples_of_256_inside_a_cycle(self, k: int) -> None:
        """The frames look as if nothing were missing; the pages that follow tell."""
        counters = np.concatenate([np.arange(804), np.arange(804 + 256 * k, 1200 + 256 * k)])
        found = tracked(counters, begin=0, end=1200 + 256 * k)
        accepted = found >= 0
        np.testing.assert_array_equal(found[accepted], counters[accepted])
        assert not accepted[804:808].any()

    def test_lost_beginning_is_known_to_be_lost(self) -> None:
        counters = np.arange(5, 300)
        np.testing.assert_array_equal(tracked(counters, begin=0, end=300), counters)

    def test_all_pages_lost_proves_nothing(self) -> None:
        counters = np.arange(10_000)
        counters = counters[counters % 8 > 2]
        assert (tracked(counters, begin=0) < 0).all()


class TestOrder:
    def test_repeated_frames_are_dropped_across_calls(self) -> None:
        counters = np.repeat(np.arange(500), 2)
        tracker = CounterTracker(MESSAGE, RATE_HZ)
        found = tracked(counters, begin=0, end=500, per_call=7, tracker=tracker)
        np.testing.assert_array_equal(found[found >= 0], np.arange(500))

    def test_frame_64_late_is_placed(self) -> None:
        counters = np.delete(np.arange(600), 300)
        counters = np.insert(counters, 364, 300)
        assert counters[364] == 300
        np.testing.assert_array_equal(tracked(counters, begin=0, end=600, per_call=1), counters)

    def test_reversed_runs(self) -> None:
        counters = np.arange(640).reshape(-1, 64)[:, ::-1].ravel()
        np.testing.assert_array_equal(tracked(counters, begin=0, end=640, per_call=33), counters)


class TestRestarts:
    def test_announced_restart_begins_anew(self) -> None:
        tracker = CounterTracker(MESSAGE, RATE_HZ)
        first = tracked(np.arange(300), begin=0, end=300, tracker=tracker)
        assert (first >= 0).all()
        assert tracker.restart() == 0
        np.testing.assert_array_equal(tracked(np.arange(100), begin=0, end=100, tracker=tracker), np.arange(100))

    @pytest.mark.parametrize("before", [150, 1000, 100_000, 2**26])
    def test_unannounced_restart_places_nothing_and_ends_in_an_error(self, before: int) -> None:
        tracker = CounterTracker(MESSAGE, RATE_HZ)
        tracked(np.arange(before, before + 64), begin=before, tracker=tracker)
        assert tracker.highest is not None
        highest = tracker.highest
        value, known = on_the_wire(np.arange(2000))
        for k in range(0, 2000, 40):
            assert not tracker.take(value[k : k + 40], known[k : k + 40]).accepted.any()
        assert tracker.highest == highest
        value, known = on_the_wire(np.arange(2000, 6000))  # past the place where the device was before
        assert not tracker.take(value, known).accepted.any()
        assert f"frames that do not follow counter {highest}" in str(tracker.failure)

    def test_jump_beyond_the_longest_gap_is_an_error(self) -> None:
        tracker = CounterTracker(MESSAGE, RATE_HZ, longest_gap_s=10.0)
        counters = np.concatenate([np.arange(800), np.arange(20_000, 26_000)])
        value, known = on_the_wire(counters)
        tracker.begins_at(0)
        found = tracker.take(value, known).counters
        assert len(found) == len(counters)
        # what was proved before the error is not lost with it
        np.testing.assert_array_equal(found[:750], np.arange(750))
        assert (found[800:] == -1).all()
        assert "allowed: a gap of ≤ 10000 samples" in str(tracker.failure)
        assert "larger longest_gap_s" in str(tracker.failure)
        assert tracker.highest is not None
        assert tracker.highest < 800

    @pytest.mark.parametrize("per_call", [1, 50, 3001])
    def test_one_frame_too_late_costs_its_neighbours_only(self, per_call: int) -> None:
        counters = np.insert(np.arange(3000), 1504, 1000)
        found = tracked(counters, begin=0, end=3000, per_call=per_call)
        accepted = found >= 0
        assert 1 <= (~accepted).sum() < 60
        in_place = np.delete(accepted, 1504)
        np.testing.assert_array_equal(np.delete(found, 1504)[in_place], np.arange(3000)[in_place])


class TestOtherCounters:
    def whole(self, n_bits: int, per_frame: int = 1) -> SampleMessage:
        samples = (tuple(MESSAGE.samples[0][0] for _ in range(per_frame)),)
        counter = (Selected(BitField("sample_counter_0", 0, n_bits)),)
        return dataclasses.replace(MESSAGE, counter=counter, samples=samples, multiplexor=None)

    @pytest.mark.parametrize("n_bits", [16, 24, 32])
    def test_whole_counter_is_decided_at_once(self, n_bits: int) -> None:
        tracker = CounterTracker(self.whole(n_bits), RATE_HZ)
        counters = 7 * np.arange(40_000)
        known = np.full(len(counters), 2**n_bits - 1)
        found = tracker.take(counters & known, known)
        np.testing.assert_array_equal(found.counters, counters)

    def test_a_silence_in_which_the_counter_may_have_come_round_proves_nothing(self) -> None:
        known = np.full(100, 2**16 - 1)
        for silence_s, is_refused in ((60.0, False), (66.0, True), (6600.0, True)):
            tracker = CounterTracker(self.whole(16), RATE_HZ)  # comes round every 65.536 s
            tracker.take(np.arange(100), known)
            tracker.refuse_after_silence(silence_s, RATE_HZ)
            assert (tracker.failure is not None) == is_refused
            assert tracker.take(np.arange(200, 300), known).accepted.any() != is_refused
        assert "got 6.6e+03 s of silence" in str(tracker.failure)

    def test_many_samples_per_frame_may_come_late(self) -> None:
        tracker = CounterTracker(self.whole(32, per_frame=13), RATE_HZ)
        order = np.arange(640).reshape(-1, 64)[:, ::-1].ravel()
        known = np.full(640, 2**32 - 1)
        tracker.begins_at(0)
        np.testing.assert_array_equal(tracker.take(13 * order, known).counters, 13 * order)

    def test_messages_of_a_device_unwrap_alike(self) -> None:
        tracker = CounterTracker(self.whole(32), RATE_HZ)
        tracker.begin_near(2**32 + 5)
        known = np.full(3, 2**32 - 1)
        assert tracker.take(np.arange(3), known).counters.tolist() == [2**32, 2**32 + 1, 2**32 + 2]


def test_repeated_low_bits_do_not_fill_the_memory() -> None:
    tracker = CounterTracker(MESSAGE, RATE_HZ)
    tracker.begins_at(0)
    value, known = on_the_wire(np.full(50_000, 5))
    decided = tracker.take(value, known)
    assert not decided.accepted.any()
    assert tracker.n_waiting <= 4096
