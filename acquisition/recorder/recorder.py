"""Recording any number of sources at once into a journal.

One thread per source reads; one thread writes the journal and decides when to stop; the caller's thread
watches. A terminal that is slow therefore delays nothing, and an interrupt never falls into a write.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from acquisition.recorder.block_joining import BlockJoiner
from acquisition.recorder.delivery_queue import BYTES_PER_SOURCE, Delivered, DeliveryQueue, Finished
from acquisition.recorder.journal_writing import JournalWriter
from acquisition.recorder.listener import Listener, NobodyListening
from acquisition.recorder.mark import MOST_MARKS, MarksToWrite
from acquisition.recorder.pre_trigger import PreTrigger
from acquisition.recorder.reader_thread import ReaderThread
from acquisition.recorder.source_record import SourceRecord
from acquisition.recorder.status import (
    Event,
    NobodyWatching,
    Observer,
    RecorderStatus,
    RecordingOutcome,
    SourceState,
    StopReason,
)
from acquisition.recorder.trigger_condition import Condition
from acquisition.samples.delivery import Block, Delivery
from acquisition.sources.interface import Source
from sloshlab.errors import JournalError, SloshlabError

STATUS_INTERVAL_S: Final = 0.25
_WRITER_TIMEOUT_S: Final = 0.05
# a driver that never returns is left behind after this; the others are kept
_READER_DEADLINE_NS: Final = 10_000_000_000


@dataclass(frozen=True)
class RecorderSettings:
    """When to stop, and how much to hold.

    Attributes
    ----------
    duration_s : float or None
        In samples of the devices, not in time of this computer; None records until all end or a stop.
    margin_s : float
        Sources after the first go on for this much longer, so that they cover the first to its end.
    silence_warning_s : float
        A source that brings nothing for so long is called silent.
    silence_limit_s : float
        With a duration: the recording ends when no source has brought anything for so long.
    longest_s : float or None
        The recording ends when a device has sampled for so long, silences included [s], see `longest_duration_s`.
    trigger : tuple of Condition
        Any of them starts the recording, see `PreTrigger`; without one it starts with the first sample.
    n_before_trigger : int
        Samples of the first device that are kept from before it. Durations count from the first sample kept.
    bytes_per_source : int
        Held in memory at most, per source, between reading and writing.
    """

    duration_s: float | None = None
    margin_s: float = 0.25
    silence_warning_s: float = 5.0
    silence_limit_s: float = 60.0
    longest_s: float | None = None
    trigger: tuple[Condition, ...] = ()
    n_before_trigger: int = 0
    bytes_per_source: int = BYTES_PER_SOURCE


@contextlib.contextmanager
def opened(sources: Sequence[Source]) -> Iterator[Sequence[Source]]:
    """Open all sources; if one cannot be, or on an interrupt, all are closed again.

    Raises
    ------
    SourceError
        Of the first source that cannot be opened.
    """
    with contextlib.ExitStack() as stack:
        for source in sources:
            # registered before it is opened: an interrupt in the middle must let it go as well
            stack.callback(_closed_quietly, source)
            source.open()
        yield sources


def _closed_quietly(source: Source) -> None:
    # its reader has reported what is worth reporting
    with contextlib.suppress(SloshlabError, OSError):
        source.close()


class Recorder:
    """Records opened sources into a journal.

    Parameters
    ----------
    sources : sequence of Source
        Opened; each is closed by its reader.
    journal : JournalWriter
        Made with the same sources in the same order; closed at the end.
    settings : RecorderSettings, optional
    listener : Listener, optional
        Gets everything that arrives, before it is written.
    monotonic_ns : callable
        Clock; given by tests.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        journal: JournalWriter,
        settings: RecorderSettings | None = None,
        *,
        listener: Listener | None = None,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._settings = settings or RecorderSettings()
        self._listener = listener or NobodyListening()
        self._journal, self._monotonic_ns = journal, monotonic_ns
        self._queue = DeliveryQueue(len(sources), self._settings.bytes_per_source)
        together = threading.Barrier(len(sources))
        self._together = together
        self._events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._readers = [
            ReaderThread(number, source, self._queue, together, self._failed)
            for number, source in enumerate(sources)
        ]
        self._records = [SourceRecord(source.info, monotonic_ns) for source in sources]
        self._gate: PreTrigger | None = None
        if self._settings.trigger:
            infos = [source.info for source in sources]
            self._gate = PreTrigger(infos, self._settings.trigger, self._settings.n_before_trigger)
        self._joiner = BlockJoiner(journal, monotonic_ns, self._written)
        self._marks = MarksToWrite()
        self._lock = threading.Lock()
        self._began_ns = 0
        self._first_done_ns: int | None = None
        self._stopped_ns: int | None = None
        self._is_stop_requested = False
        self._reason: StopReason | None = None
        self._storage_error: str | None = None

    def request_stop(self) -> None:
        """End cleanly and keep everything; may be called from a signal handler and more than once."""
        # a plain attribute: a lock could be held by the very thread that the signal interrupts
        self._is_stop_requested = True

    def mark(self, text: str) -> None:
        """Put a mark of this moment into the recording; may be called from any thread."""
        self._marks.put(text)

    def run(self, observer: Observer | None = None) -> RecordingOutcome:
        """Record until something ends it, then close the journal.

        Errors of a source are told to `observer` and kept in the outcome; the others go on. A journal
        that cannot be written ends the recording and is told likewise.
        """
        watching = observer or NobodyWatching()
        self._began_ns = self._monotonic_ns()
        self._listener.begins([record.info for record in self._records], self._journal.metadata, self.mark)
        # no daemon: the interpreter must not end within a write
        writer = threading.Thread(target=self._write, name="journal writer")
        try:
            for reader in self._readers:
                reader.start()
            writer.start()
            self._watch(watching)
        finally:
            self.request_stop()
            # a reader could not be started, or an interrupt came before the writer: nobody would empty the queue
            if writer.ident is None:
                self._together.abort()
                self._stop(StopReason.REQUESTED)
                self._queue.close()
                self._journal.abandon()
            else:
                writer.join()
        watching.status(self.status())
        reason = self._reason or StopReason.REQUESTED
        failures = {number: record.error for number, record in enumerate(self._records) if record.error}
        return RecordingOutcome(reason, self.status(), failures, self._storage_error)

    def status(self) -> RecorderStatus:
        """The state now; may be asked from any thread."""
        with self._lock:
            elapsed_s = (self._monotonic_ns() - self._began_ns) * 1e-9
            sources = tuple(record.status(self._queue.fill(number)) for number, record in enumerate(self._records))
            n_bytes, is_stopping = self._journal.n_bytes, self._stopped_ns is not None
            waiting_for = self._gate.waiting_for if self._gate is not None else ""
            return RecorderStatus(elapsed_s, self._remaining_s(), n_bytes, is_stopping, sources, waiting_for)

    def _remaining_s(self) -> float | None:
        running = [record for record in self._records if not record.is_finished]
        if self._settings.duration_s is None or not running or self._gate is not None:
            return None
        return max(0.0, self._settings.duration_s - running[0].recorded_s)

    def _watch(self, observer: Observer) -> None:
        """Pass events on as they come and the state in between, until the writer says it is done."""
        shown_ns = self._monotonic_ns()
        while True:
            try:
                event = self._events.get(timeout=STATUS_INTERVAL_S)
            except queue.Empty:
                event = Event(None, "", is_failure=False)
            if event is None:
                return
            if event.message:
                observer.event(event)
            if self._monotonic_ns() - shown_ns >= STATUS_INTERVAL_S * 1e9:
                shown_ns = self._monotonic_ns()
                observer.status(self.status())

    def _write(self) -> None:
        try:
            self._write_until_finished()
            # what still waits to be joined, before the last block says that all is there
            self._joiner.write_all()
            self._write_marks()
            # only here is the journal closed with its last block: it vouches that everything is in it
            reason = self._reason or StopReason.SOURCES_FAILED
            self._journal.close({"reason": reason.name, "duration_s": self._settings.duration_s})
        except JournalError as error:
            self._give_up(str(error))
        except Exception as error:  # noqa: BLE001 - whatever it is, the user must learn it and the readers must end
            self._give_up(" ".join(f"journal {self._journal.path}: {type(error).__name__}: {error}".split()))
        finally:
            self._events.put(None)

    def _give_up(self, message: str) -> None:
        self._storage_error = message
        self._stop(StopReason.STORAGE)
        # before the readers are waited for: those that wait for space let go
        self._queue.close()
        for reader in self._readers:
            reader.join(_READER_DEADLINE_NS * 1e-9)
        self._journal.abandon()
        self._tell(None, message, is_failure=True)

    def _write_until_finished(self) -> None:
        while not all(record.is_finished for record in self._records):
            for item in self._queue.take(_WRITER_TIMEOUT_S):
                # one item at a time: whoever asks for the status does not wait for the whole queue
                with self._lock:
                    self._take(item)
            with self._lock:
                self._joiner.write_due()
            self._write_marks()
            self._decide()
            # a driver that does not return keeps only its own samples from being complete
            if self._stopped_ns is not None and self._monotonic_ns() - self._stopped_ns > _READER_DEADLINE_NS:
                self._leave_hanging_readers()

    def _write_marks(self) -> None:
        for mark in self._marks.take():
            if mark is None:
                self._tell(None, f"marks not kept: a recording has {MOST_MARKS}", is_failure=False)
                continue
            self._journal.append_mark(mark)
            with self._lock:
                if self._gate is not None and self._gate.mark():
                    self._begin(self._gate)
            self._events.put(Event(None, f"mark: {mark.text}", False, mark.host_monotonic_ns))

    def _take(self, item: Delivered | Finished) -> None:
        if isinstance(item, Finished):
            self._finish(item.source, item.error)
            return
        self._listener.delivered(item.source, item.deliveries)
        for delivery in item.deliveries:
            if self._gate is None:
                self._joiner.add(item.source, delivery)
            message = self._records[item.source].take(delivery)
            if message:
                self._tell(item.source, message, is_failure=False)
            if self._gate is not None:
                self._hold(self._gate, item.source, delivery)

    def _hold(self, gate: PreTrigger, source: int, delivery: Delivery) -> None:
        """Keep a delivery for the case that the trigger comes soon, and begin if it is there."""
        if isinstance(delivery, Block) and len(delivery.counts):
            self._records[source].meters.update_levels([delivery])
        gate.take(source, delivery)
        if gate.trigger is not None:
            self._begin(gate)

    def _begin(self, gate: PreTrigger) -> None:
        """Begin to record, with what is held from before the trigger."""
        assert gate.trigger is not None
        # before its samples: a journal that is cut short says where they belong, too
        self._journal.update_metadata({"trigger": gate.trigger.described()})
        # what came while it waited is no part of the recording, and neither are its losses
        self._records = [record.begun_anew() for record in self._records]
        for source, delivery in gate.released():
            self._joiner.add(source, delivery)
            self._records[source].take(delivery)
        self._gate = None
        self._tell(None, f"trigger: {gate.trigger.condition}", is_failure=False)

    def _finish(self, number: int, error: str | None) -> None:
        self._records[number].finish(error)
        if error is not None:
            self._journal.append_failure(number, error)

    def _failed(self, number: int, error: str) -> None:
        self._tell(number, error, is_failure=True)

    def _written(self, source: int, blocks: list[Block]) -> None:
        self._records[source].meters.update_levels(blocks)

    def _tell(self, source: int | None, message: str, *, is_failure: bool) -> None:
        self._events.put(Event(source, message, is_failure))

    def _decide(self) -> None:
        """Stop everything, or single sources that have recorded enough."""
        if self._stopped_ns is not None:
            return
        for number, record in enumerate(self._records):
            if record.became_silent(self._settings.silence_warning_s):
                self._tell(number, f"source {record.info.url}: no samples any more", is_failure=False)
        reason = self._reason_to_stop()
        if reason is not None:
            self._stop(reason)

    def _reason_to_stop(self) -> StopReason | None:
        running = [record for record in self._records if not record.is_finished]
        if self._is_stop_requested:
            return StopReason.REQUESTED
        if not running:
            return StopReason.SOURCES_FAILED
        if all(record.state is SourceState.ENDED for record in running):
            return StopReason.END
        return self._reason_to_stop_running(running)

    def _reason_to_stop_running(self, running: list[SourceRecord]) -> StopReason | None:
        settings = self._settings
        if self._gate is not None:
            return StopReason.SILENCE if self._is_too_quiet(running) else None
        if settings.duration_s is not None and self._has_recorded(settings.duration_s, running):
            return StopReason.DURATION
        # what no reader takes would not be assembled, and its journal not be recovered by any command
        if settings.longest_s is not None and max(record.length_s for record in running) >= settings.longest_s:
            return StopReason.TOO_LONG
        return StopReason.SILENCE if self._is_too_quiet(running) else None

    def _is_too_quiet(self, running: list[SourceRecord]) -> bool:
        # without a duration silence is no reason to end: the person who started it decides
        quiet_s = min(record.quiet_s for record in running)
        return self._settings.duration_s is not None and quiet_s > self._settings.silence_limit_s

    def _has_recorded(self, duration_s: float, running: list[SourceRecord]) -> bool:
        """Whether the first source has recorded enough, and the others cover it or bring nothing more."""
        if running[0].recorded_s < duration_s and running[0].state is not SourceState.ENDED:
            return False
        now_ns = self._monotonic_ns()
        if self._first_done_ns is None:
            self._first_done_ns = now_ns
        waited_s = (now_ns - self._first_done_ns) * 1e-9
        target_s = duration_s + self._settings.margin_s
        return all(
            record.recorded_s >= target_s
            or record.state is SourceState.ENDED
            # a second device that is silent must not hold the recording
            or min(record.quiet_s, waited_s) > 2 * self._settings.margin_s + 1.0
            for record in running[1:]
        )

    def _stop(self, reason: StopReason) -> None:
        self._reason = self._reason or reason
        self._stopped_ns = self._monotonic_ns()
        for reader in self._readers:
            reader.stop()

    def _leave_hanging_readers(self) -> None:
        for number, record in enumerate(self._records):
            if not record.is_finished:
                self._queue.close()
                message = f"source {record.info.url}: its driver does not return; left behind"
                self._failed(number, message)
                with self._lock:
                    self._finish(number, message)
