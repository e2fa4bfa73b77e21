"""A reader is stopped: what has arrived, and what its source still holds, is read first."""

import threading

from fake_source import FakeSource, block

from acquisition.recorder.delivery_queue import DeliveryQueue, Finished
from acquisition.recorder.reader_thread import ReaderThread
from acquisition.samples.delivery import Block

PATIENCE_S = 60.0


def test_what_had_arrived_when_the_stop_came_is_read() -> None:
    queue = DeliveryQueue(1)

    def stop_in_the_middle() -> list[Block]:
        reader.stop()
        return [block(0)]

    source = FakeSource([stop_in_the_middle, [block(10)], [block(20)]])
    reader = ReaderThread(0, source, queue, threading.Barrier(1), lambda number, error: None)
    reader.start()
    assert reader.join(PATIENCE_S)
    first, last, finished = queue.take(0.0)
    assert [item.deliveries[0].counter for item in (first, last)] == [0, 10]
    assert finished == Finished(0, None)


def test_what_a_source_still_holds_is_asked_for_once_before_it_is_closed() -> None:
    class Holding(FakeSource):
        def finish(self) -> list[Block]:
            assert not self.closed.is_set()
            return [block(20)]

    queue = DeliveryQueue(1)
    source = Holding([[block(0)], lambda: reader.stop() or [block(10)]])
    reader = ReaderThread(0, source, queue, threading.Barrier(1), lambda number, error: None)
    reader.start()
    assert reader.join(PATIENCE_S)
    *delivered, finished = queue.take(0.0)
    assert [delivery.counter for item in delivered for delivery in item.deliveries] == [0, 10, 20]
    assert finished == Finished(0, None)
