"""Deliveries on their way to the page: bounded, and lossy rather than slow."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final

from acquisition.samples.delivery import Block, Delivery

MOST_BYTES: Final = 16 << 20
"""At 8 × 51.2 kHz, 1.6 MB/s of counts, the page may be ten seconds late before it skips samples."""

_BYTES_PER_DELIVERY: Final = 200


class SideBuffer:
    """A queue for one thread that puts and one that takes; who puts never waits, not even for a lock.

    Parameters
    ----------
    most_bytes : int
        What does not fit is skipped and counted; the recording has it nevertheless.
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._waiting: deque[tuple[int, Delivery, int]] = deque()
        self._limit = most_bytes
        # each counter is written by one of the two threads only, so that none is ever counted wrongly
        self._n_put_bytes = self._n_taken_bytes = 0
        self.n_skipped = 0

    def put(self, source: int, deliveries: Sequence[Delivery]) -> None:
        """Hand deliveries over, or skip the samples among them where there is no room."""
        for delivery in deliveries:
            n_bytes = _BYTES_PER_DELIVERY + (delivery.counts.nbytes if isinstance(delivery, Block) else 0)
            if self._n_put_bytes - self._n_taken_bytes + n_bytes > self._limit:
                self.n_skipped += len(delivery.counts) if isinstance(delivery, Block) else 0
                continue
            self._n_put_bytes += n_bytes
            self._waiting.append((source, delivery, n_bytes))

    def take(self) -> list[tuple[int, Delivery]]:
        """Everything that waits, with the numbers of the sources, in order."""
        taken = []
        for _ in range(len(self._waiting)):
            source, delivery, n_bytes = self._waiting.popleft()
            self._n_taken_bytes += n_bytes
            taken.append((source, delivery))
        return taken
