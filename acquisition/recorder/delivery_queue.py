"""The queue between the readers and the writer: bounded per source, so that no source starves another."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from acquisition.samples.delivery import Block, Delivery

# at 8 × 51.2 kHz, 1.6 MB/s of counts, a disk may hang for some twenty seconds
BYTES_PER_SOURCE: Final = 32 << 20
# a flood of empty deliveries must fill the queue as well
_BYTES_PER_DELIVERY: Final = 200


@dataclass(frozen=True)
class Delivered:
    """What one read of a source brought."""

    source: int
    deliveries: Sequence[Delivery]


@dataclass(frozen=True)
class Finished:
    """A reader has ended; `error` says why if that was not asked for."""

    source: int
    error: str | None


class DeliveryQueue:
    """Deliveries on their way to the writer.

    Parameters
    ----------
    n_sources : int
    bytes_per_source : int
        A source with more than this under way has to wait.
    """

    def __init__(self, n_sources: int, bytes_per_source: int = BYTES_PER_SOURCE) -> None:
        self._waiting: deque[tuple[Delivered | Finished, int]] = deque()
        self._n_bytes = [0] * n_sources
        self._limit = bytes_per_source
        self._changed = threading.Condition()
        self._is_closed = False

    def put(self, source: int, deliveries: Sequence[Delivery]) -> bool:
        """Hand deliveries over, waiting for space; False if nobody takes them any more."""
        n_bytes = sum(_size(delivery) for delivery in deliveries)
        with self._changed:
            # A full queue makes its own source wait: the device or the system then loses data, and its counter
            # tells. One delivery may exceed the limit, or a large one could never pass.
            self._changed.wait_for(lambda: self._is_closed or self._n_bytes[source] < self._limit)
            if self._is_closed:
                return False
            self._n_bytes[source] += n_bytes
            self._waiting.append((Delivered(source, deliveries), n_bytes))
            self._changed.notify_all()
        return True

    def finish(self, source: int, error: str | None) -> None:
        """Say that nothing more comes from a source; never waits."""
        with self._changed:
            # without a limit: how a source ended must be known even where its samples wait
            self._waiting.append((Finished(source, error), 0))
            self._changed.notify_all()

    def take(self, timeout_s: float) -> list[Delivered | Finished]:
        """Everything under way, in order; after `timeout_s` maybe nothing."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._waiting), timeout_s)
            # everything at once, so that readers wait for a lock once per batch and not once per delivery
            taken = [item for item, _ in self._waiting]
            self._waiting.clear()
            self._n_bytes = [0] * len(self._n_bytes)
            self._changed.notify_all()
        return taken

    def fill(self, source: int) -> float:
        """How full the share of a source is, 0 … 1."""
        return min(1.0, self._n_bytes[source] / self._limit)

    def close(self) -> None:
        """Take nothing more; readers that wait give up."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()


def _size(delivery: Delivery) -> int:
    return _BYTES_PER_DELIVERY + (delivery.counts.nbytes if isinstance(delivery, Block) else 0)
