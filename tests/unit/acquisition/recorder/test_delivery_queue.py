"""The queue between readers and the journal: bounded per source, and it lets everybody go."""

import threading

from fake_source import block

from acquisition.recorder.delivery_queue import Delivered, DeliveryQueue, Finished

PATIENCE_S = 60.0


def test_a_full_queue_makes_only_its_own_source_wait() -> None:
    queue = DeliveryQueue(2, bytes_per_source=10_000)
    assert queue.put(0, [block(0, 2000)])
    assert queue.fill(0) == 1.0
    passed = threading.Event()

    def put_more() -> None:
        assert queue.put(0, [block(2000, 2000)])
        passed.set()

    helper = threading.Thread(target=put_more)
    helper.start()
    assert queue.put(1, [block(0)])
    assert not passed.wait(0.1)
    first = queue.take(1.0)
    assert [item.source for item in first] == [0, 1]
    assert passed.wait(PATIENCE_S)
    helper.join()
    (item,) = queue.take(1.0)
    assert isinstance(item, Delivered)
    assert item.source == 0
    queue.finish(1, "broken")
    assert queue.take(1.0) == [Finished(1, "broken")]
    assert queue.take(0.0) == []


def test_a_closed_queue_lets_waiting_readers_go() -> None:
    queue = DeliveryQueue(1, bytes_per_source=100)
    queue.put(0, [block(0)])
    answers = []
    helper = threading.Thread(target=lambda: answers.append(queue.put(0, [block(10)])))
    helper.start()
    queue.close()
    helper.join(PATIENCE_S)
    assert answers == [False]
