"""The recorder with sources that do what the test says: nothing lost, no error swallowed, no thread left."""

from __future__ import annotations

import errno
import itertools
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fake_source import FakeSource, block, counts_of, endless, info

from acquisition.recorder import recorder as recorder_module
from acquisition.recorder.journal import JournalWriter, read_journal
from acquisition.recorder.recorder import Recorder, RecorderSettings, opened
from acquisition.recorder.status import Event, RecorderStatus, SourceState, StopReason
from acquisition.samples.delivery import Block, End, Trouble, TroubleKind
from sloshlab.errors import SourceError

PATIENCE_S = 60.0


class Watching:
    """An observer that remembers, and can act on what it sees."""

    def __init__(self, act: Callable[[Event | RecorderStatus], None] | None = None) -> None:
        self.events: list[Event] = []
        self.states: list[RecorderStatus] = []
        self._act = act

    def event(self, event: Event) -> None:
        self.events.append(event)
        if self._act:
            self._act(event)

    def status(self, status: RecorderStatus) -> None:
        self.states.append(status)
        if self._act:
            self._act(status)


def made(path: Path, sources: list[FakeSource], settings: RecorderSettings | None = None, **options) -> Recorder:
    journal = JournalWriter(path, {}, [source.info for source in sources])
    return Recorder(sources, journal, settings, **options)


def recorded(path: Path, source: int = 0, group: int = 0) -> tuple[list[int], np.ndarray]:
    """Counters of all samples of a group, and their counts."""
    with read_journal(path) as journal:
        entries = journal.entries[source, group]
        counters = [
            int(entries.counter[k]) + sample for k in range(len(entries)) for sample in range(entries.n_samples[k])
        ]
        counts = [journal.counts(entries[k]) for k in range(len(entries))]
        return counters, np.concatenate(counts) if counts else np.empty((0, 0), np.int32)


def assert_continuous(path: Path, n_samples: int, source: int = 0) -> None:
    counters, counts = recorded(path, source)
    assert counters == list(range(n_samples))
    assert np.array_equal(counts, counts_of(0, n_samples))


def test_all_sources_until_all_have_ended(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    first = FakeSource([[block(10 * k)] for k in range(20)] + [[End(1, 200)]], info("a"))
    second = FakeSource(
        [[block(50 * k, 50), block(50 * k + 25, 0)] for k in range(30)] + [[End(1, 1500)]], info("b")
    )
    outcome = made(path, [first, second]).run()
    assert outcome.reason is StopReason.END
    assert outcome.failures == {}
    assert outcome.storage_error is None
    assert_continuous(path, 200, 0)
    assert_continuous(path, 1500, 1)
    with read_journal(path) as journal:
        assert journal.closing == {"reason": "END", "duration_s": None}
        assert journal.ends == ((0, End(1, 200)), (1, End(1, 1500))) or journal.ends == (
            (1, End(1, 1500)), (0, End(1, 200))
        )  # fmt: skip
        # 20 deliveries within milliseconds are few entries
        assert len(journal.entries[0, 0]) < 20
    assert [source.state for source in outcome.status.sources] == [SourceState.ENDED, SourceState.ENDED]
    assert [source.n_samples for source in outcome.status.sources] == [200, 1500]
    assert (first.n_started, first.n_closed, second.n_started, second.n_closed) == (1, 1, 1, 1)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (SourceError("fake:a", got="an unplugged cable", remedy="plug it in"), "fake:a: got an unplugged cable"),
        (ZeroDivisionError("by zero"), "fake:a: got an error inside its driver (ZeroDivisionError: by zero)"),
    ],
)
def test_an_error_of_one_source_is_told_at_once_and_the_others_go_on(tmp_path: Path, error, message: str) -> None:
    path = tmp_path / "run.journal"
    told = threading.Event()
    going_on = iter(())

    def wait_for_the_news() -> list:
        assert told.wait(PATIENCE_S)
        return [block(10)]

    going_on = iter([[block(0)], wait_for_the_news, [End(1, 20)]])
    failing = FakeSource([[block(0)], error], info("a"))
    watching = Watching(lambda seen: told.set() if isinstance(seen, Event) else None)
    outcome = made(path, [failing, FakeSource(going_on, info("b"))]).run(watching)
    assert [(event.source, event.is_failure) for event in watching.events] == [(0, True)]
    assert message in watching.events[0].message
    assert outcome.reason is StopReason.END
    assert list(outcome.failures) == [0]
    assert message in outcome.failures[0]
    assert_continuous(path, 10, 0)
    assert_continuous(path, 20, 1)
    with read_journal(path) as journal:
        assert journal.failures == ((0, outcome.failures[0]),)
    assert outcome.status.sources[0].state is SourceState.FAILED
    assert failing.n_closed == 1


def test_an_error_overtakes_what_waits_in_the_queue(tmp_path: Path) -> None:
    """The writer hangs in a write; the error of a source is told nevertheless."""
    path = tmp_path / "run.journal"
    release, in_write = threading.Event(), threading.Event()

    class HangingDisk:
        def __init__(self, place: Path) -> None:
            self.file = place.open("xb", buffering=0)
            self.n_written = 0

        def write(self, data: bytes | memoryview, /) -> int:
            self.n_written += 1
            # behind the header and two copies of the descriptions
            if self.n_written > 5:
                in_write.set()
                assert release.wait(PATIENCE_S)
            return self.file.write(data)

        def __getattr__(self, name: str):
            return getattr(self.file, name)

    def fail_while_the_disk_hangs() -> list:
        assert in_write.wait(PATIENCE_S)
        raise SourceError("fake:a", got="no answer")

    def sources_info() -> list:
        return [source.info]

    source = FakeSource([[block(0), End(1, None)], fail_while_the_disk_hangs], info("a"))
    journal = JournalWriter(path, {}, sources_info(), open_file=lambda place, _: HangingDisk(place))
    watching = Watching(lambda seen: release.set() if isinstance(seen, Event) else None)
    recording = Recorder([source], journal)
    # the state needs the writer; what is asked for here is the event
    recording.status = lambda: RecorderStatus(0.0, None, 0, False, ())  # type: ignore[method-assign]
    recording.run(watching)
    assert "no answer" in watching.events[0].message


@pytest.mark.parametrize(
    "wrong",
    [
        Block(1, 1, 0, np.zeros((3, 2), np.int32), None, 0, 0),
        Block(-1, 1, 0, np.zeros((3, 2), np.int32), None, 0, 0),
        Block(0, 1, 0, np.zeros((3, 3), np.int32), None, 0, 0),
        Block(0, 1, 0, np.zeros(3, np.int32), None, 0, 0),
        Block(0, 1, 0, np.zeros((3, 2), np.float64), None, 0, 0),  # type: ignore[arg-type]
        Block(0, 1, 2**63 - 2, np.zeros((3, 2), np.int32), None, 0, 0),
        Block(0, 2**70, 0, np.zeros((3, 2), np.int32), None, 0, 0),
    ],
)
def test_impossible_blocks_end_their_source_only(tmp_path: Path, wrong: Block) -> None:
    path = tmp_path / "run.journal"
    sources = [FakeSource([[wrong]], info("a")), FakeSource([[block(0)], [End(1, 10)]], info("b"))]
    outcome = made(path, sources).run()
    assert list(outcome.failures) == [0]
    assert_continuous(path, 10, 1)


def test_errors_at_start_and_close_are_told(tmp_path: Path) -> None:
    def refuse() -> None:
        raise SourceError("fake", got="refused")

    path = tmp_path / "run.journal"
    sources = [
        FakeSource([[block(0)]], info("a"), on_start=refuse),
        FakeSource([[block(0)], [End(1, 10)]], info("b"), on_close=refuse),
    ]
    watching = Watching()
    outcome = made(path, sources).run(watching)
    assert sorted(outcome.failures) == [0, 1]
    assert sorted(event.source for event in watching.events) == [0, 1]
    assert recorded(path)[0] == []
    assert_continuous(path, 10, 1)


def test_a_silence_counts_towards_the_longest_recording(tmp_path: Path) -> None:
    """A device that came back would leave a gap of this length, in a recording that nothing could read."""
    source = FakeSource([[block(0)]])
    outcome = made(tmp_path / "run.journal", [source], RecorderSettings(longest_s=0.5)).run()
    assert outcome.reason is StopReason.TOO_LONG
    assert outcome.status.sources[0].n_samples == 10


def test_waiting_for_the_first_sample_does_not_count(tmp_path: Path) -> None:
    began = time.monotonic()

    def late() -> list:
        return [block(0), End(1, 10)] if time.monotonic() - began > 1.0 else []

    source = FakeSource(itertools.repeat(late))
    assert made(tmp_path / "run.journal", [source], RecorderSettings(longest_s=0.5)).run().reason is StopReason.END


def test_nothing_left_to_read_ends_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    outcome = made(path, [FakeSource([[block(0)], SourceError("gone")])]).run()
    assert outcome.reason is StopReason.SOURCES_FAILED
    assert_continuous(path, 10)


def test_devices_are_started_at_the_same_time(tmp_path: Path) -> None:
    """Each start waits for the other: one after the other they would wait for ever."""
    together = threading.Barrier(2)

    def start() -> None:
        together.wait(PATIENCE_S)

    sources = [FakeSource([[End(1, 0)]], info(name), on_start=start) for name in "ab"]
    assert made(tmp_path / "run.journal", sources).run().failures == {}


def test_the_duration_is_one_of_device_samples(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    source = FakeSource(endless(10))
    outcome = made(path, [source], RecorderSettings(duration_s=0.5)).run()
    assert outcome.reason is StopReason.DURATION
    counters, _ = recorded(path)
    # 500 samples at 1 kHz; what arrived until the source was stopped is kept
    assert len(counters) >= 500
    assert counters == list(range(len(counters)))
    assert outcome.status.sources[0].n_samples == len(counters)


def test_lost_samples_count_for_the_duration(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    source = FakeSource([[block(0)], [block(490)]])
    assert made(path, [source], RecorderSettings(duration_s=0.5)).run().reason is StopReason.DURATION
    assert recorded(path)[0] == [*range(10), *range(490, 500)]


def test_later_sources_cover_the_first_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    quick = FakeSource([[block(0, 600)]], info("quick"))
    slow = FakeSource(endless(20, pause_s=0.002), info("slow"))
    settings = RecorderSettings(duration_s=0.5, margin_s=0.25)
    assert made(path, [quick, slow], settings).run().reason is StopReason.DURATION
    counters, _ = recorded(path, 1)
    assert len(counters) >= 750


def test_a_silent_second_source_does_not_hold_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    sources = [FakeSource(endless(20), info("a")), FakeSource([[block(0)]], info("b"))]
    settings = RecorderSettings(duration_s=0.2, margin_s=0.01, silence_warning_s=0.3)
    watching = Watching()
    assert made(path, sources, settings).run(watching).reason is StopReason.DURATION
    assert [(event.source, event.message) for event in watching.events] == [
        (1, "source fake:b: no samples any more")
    ]


def test_silence_ends_a_recording_of_given_duration(tmp_path: Path) -> None:
    settings = RecorderSettings(duration_s=10.0, silence_warning_s=0.1, silence_limit_s=0.3)
    outcome = made(tmp_path / "run.journal", [FakeSource([[block(0)]])], settings).run()
    assert outcome.reason is StopReason.SILENCE
    assert_continuous(tmp_path / "run.journal", 10)


def test_a_stop_request_keeps_everything_that_was_read(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    delivered = []

    def counted() -> Iterator[list]:
        for deliveries in endless(10):
            delivered.append(deliveries)
            yield deliveries

    source = FakeSource(counted())
    recording = made(path, [source])

    def stop_after_some(seen: Event | RecorderStatus) -> None:
        if isinstance(seen, RecorderStatus) and seen.sources[0].n_samples > 300:
            recording.request_stop()

    outcome = recording.run(Watching(stop_after_some))
    assert outcome.reason is StopReason.REQUESTED
    assert_continuous(path, 10 * len(delivered))
    with read_journal(path) as journal:
        assert journal.closing == {"reason": "REQUESTED", "duration_s": None}
    assert source.n_closed == 1


def test_troubles_reach_journal_status_and_user(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    source = FakeSource(
        [
            [block(0), Trouble(TroubleKind.CORRUPT_FRAME, "first", 1, 11)],
            [Trouble(TroubleKind.CORRUPT_FRAME, "second", 4, 12)],
            [Trouble(TroubleKind.DISCONNECTED, "cable", 1, 13)],
            [Trouble(TroubleKind.RECONNECTED, "cable", 1, 14), block(50), End(1, 60)],
        ]
    )
    watching = Watching()
    outcome = made(path, [source]).run(watching)
    assert outcome.status.sources[0].troubles == {
        TroubleKind.CORRUPT_FRAME: 5,
        TroubleKind.DISCONNECTED: 1,
        TroubleKind.RECONNECTED: 1,
    }
    assert outcome.status.sources[0].n_lost == 40
    assert [event.message for event in watching.events] == [
        "daq: the connection was lost: cable",
        "daq: the connection came back: cable",
    ]
    with read_journal(path) as journal:
        assert journal.trouble_counts == {(0, "CORRUPT_FRAME"): 5, (0, "DISCONNECTED"): 1, (0, "RECONNECTED"): 1}


class FullDisk:
    """Fails after so many bytes, as a full disk does."""

    def __init__(self, path: Path, n_bytes_free: int) -> None:
        self._file, self._free = path.open("xb", buffering=0), n_bytes_free

    def write(self, data: bytes | memoryview, /) -> int:
        if not self._free:
            raise OSError(errno.ENOSPC, "No space left on device")
        n_bytes = self._file.write(bytes(data[: self._free]))
        self._free -= n_bytes
        return n_bytes

    def __getattr__(self, name: str):
        return getattr(self._file, name)


def test_a_full_disk_ends_the_recording_with_one_line_and_a_sound_journal(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    sources = [FakeSource(endless(100), info("a")), FakeSource(endless(100), info("b"))]
    journal = JournalWriter(
        path, {}, [source.info for source in sources], open_file=lambda place, _: FullDisk(place, 300_000)
    )
    watching = Watching()
    outcome = Recorder(sources, journal).run(watching)
    assert outcome.reason is StopReason.STORAGE
    assert "No space left on device" in str(outcome.storage_error)
    assert "\n" not in str(outcome.storage_error)
    assert [event.message for event in watching.events] == [outcome.storage_error]
    assert [source.n_closed for source in sources] == [1, 1]
    counters, counts = recorded(path)
    assert counters
    assert counters == list(range(len(counters)))
    assert np.array_equal(counts, counts_of(0, len(counters)))
    with read_journal(path) as journal_read:
        assert journal_read.n_bytes_left_out == 0


def test_memory_is_bounded_while_the_disk_hangs(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    release = threading.Event()

    class HangingDisk(FullDisk):
        def write(self, data: bytes | memoryview, /) -> int:
            if len(data) > 10_000:
                assert release.wait(PATIENCE_S)
            return super().write(data)

    n_blocks = 400
    source = FakeSource([*([block(1000 * k, 1000)] for k in range(n_blocks)), [End(1, 1000 * n_blocks)]])
    journal = JournalWriter(path, {}, [source.info], open_file=lambda place, _: HangingDisk(place, 1 << 30))
    recording = Recorder([source], journal, RecorderSettings(bytes_per_source=80_000))
    reads_while_hanging = []

    def let_go() -> None:
        # until the number of reads stands still: the queue is full
        for _ in itertools.count():
            before = source.n_read
            time.sleep(0.3)
            if before and source.n_read == before:
                break
        reads_while_hanging.append(source.n_read)
        release.set()

    helper = threading.Thread(target=let_go)
    helper.start()
    outcome = recording.run()
    helper.join()
    # a MiB in the joiner, one batch that was taken, 80 kB in the queue, one block in the reader's hand
    assert reads_while_hanging[0] * 8000 < (1 << 20) + 3 * 88_000 + 8000
    assert outcome.reason is StopReason.END
    assert_continuous(path, 1000 * n_blocks)


def test_a_driver_that_never_returns_is_left_behind(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(recorder_module, "_READER_DEADLINE_NS", 200_000_000)
    release = threading.Event()
    path = tmp_path / "run.journal"

    def hang() -> list:
        release.wait(PATIENCE_S)
        return []

    hanging = FakeSource([[block(0)], hang], info("a"))
    sources = [hanging, FakeSource(endless(10), info("b"))]
    recording = made(path, sources)

    def stop(seen: Event | RecorderStatus) -> None:
        if isinstance(seen, RecorderStatus) and seen.sources[1].n_samples > 50:
            recording.request_stop()

    outcome = recording.run(Watching(stop))
    assert "does not return" in outcome.failures[0]
    assert_continuous(path, 10, 0)
    release.set()
    assert hanging.closed.wait(PATIENCE_S)
    for thread in threading.enumerate():
        if thread.name == "reader of a":
            thread.join(PATIENCE_S)


def test_an_observer_that_fails_does_not_cost_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    source = FakeSource(endless(10))

    def fail(seen: Event | RecorderStatus) -> None:
        if isinstance(seen, RecorderStatus) and seen.sources[0].n_samples > 50:
            raise BrokenPipeError("the terminal is gone")

    with pytest.raises(BrokenPipeError):
        made(path, [source]).run(Watching(fail))
    assert source.n_closed == 1
    with read_journal(path) as journal:
        assert journal.closed_cleanly
    counters, _ = recorded(path)
    assert counters == list(range(len(counters)))


@pytest.mark.parametrize("problem", [SourceError("fake:b", got="nobody"), KeyboardInterrupt()])
def test_what_was_opened_is_closed_when_another_cannot_be(problem: BaseException) -> None:
    def fail() -> None:
        raise problem

    sources = [FakeSource(source_info=info("a")), FakeSource(source_info=info("b"), on_open=fail), FakeSource()]

    def open_all() -> None:
        with opened(sources):
            pytest.fail("opened")

    with pytest.raises(type(problem)):
        open_all()
    assert [(source.n_opened, source.n_closed) for source in sources] == [(1, 1), (1, 1), (0, 0)]


def test_status_says_what_is_left(tmp_path: Path) -> None:
    source = FakeSource([[block(0, 250)]], info("a"))
    recording = made(tmp_path / "run.journal", [source], RecorderSettings(duration_s=1.0))
    seen: list[RecorderStatus] = []

    def stop(status: Event | RecorderStatus) -> None:
        if isinstance(status, RecorderStatus) and status.sources[0].n_samples:
            seen.append(status)
            recording.request_stop()

    recording.run(Watching(stop))
    assert seen[0].remaining_s == pytest.approx(0.75)
    assert seen[0].sources[0].state is SourceState.RUNNING
    assert seen[0].n_bytes_written > 0
