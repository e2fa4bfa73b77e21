"""Many small deliveries become few journal blocks, none older than a quarter of a second."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind

# what kill -9 costs at most
LONGEST_WAIT_NS: Final = 250_000_000
# memory is bounded by bytes and by blocks: many blocks of one sample weigh more than their counts
_MOST_BYTES_WAITING: Final = 1 << 20
_MOST_BLOCKS_WAITING: Final = 4096


class Sink(Protocol):
    """Where joined blocks go: the journal."""

    def append_blocks(self, source: int, blocks: list[Block], /) -> None:
        """Take consecutive blocks of one group."""

    def append(self, source: int, delivery: Delivery, /) -> None:
        """Take anything else."""


@dataclass
class _Waiting:
    since_ns: int
    next_counter: int
    stream: int
    blocks: list[Block] = field(default_factory=list)
    n_bytes: int = 0


class BlockJoiner:
    """Joins consecutive blocks of a group, and troubles of a kind, before they are written.

    Parameters
    ----------
    sink : Sink
    monotonic_ns : callable
    written : callable
        Called with source number and blocks after they were written.
    """

    def __init__(
        self, sink: Sink, monotonic_ns: Callable[[], int], written: Callable[[int, list[Block]], None]
    ) -> None:
        self._sink, self._monotonic_ns, self._written = sink, monotonic_ns, written
        self._samples: dict[tuple[int, int], _Waiting] = {}
        self._troubles: dict[tuple[int, TroubleKind], tuple[int, Trouble]] = {}

    def add(self, source: int, delivery: Delivery) -> None:
        """Take one delivery; it is written now or later, in order within its group."""
        if isinstance(delivery, Block):
            self._add_block(source, delivery)
        elif isinstance(delivery, Trouble):
            self._add_trouble(source, delivery)
        else:
            self._add_end(source, delivery)

    def write_due(self) -> None:
        """Write what has waited long enough."""
        now_ns = self._monotonic_ns()
        for place, waiting in list(self._samples.items()):
            if now_ns - waiting.since_ns >= LONGEST_WAIT_NS:
                self._write_samples(place)
        for place_of_trouble, (since_ns, _) in list(self._troubles.items()):
            if now_ns - since_ns >= LONGEST_WAIT_NS:
                self._write_trouble(place_of_trouble)

    def write_all(self) -> None:
        """Write everything."""
        for place in list(self._samples):
            self._write_samples(place)
        for place_of_trouble in list(self._troubles):
            self._write_trouble(place_of_trouble)

    def _add_block(self, source: int, block: Block) -> None:
        if not len(block.counts):
            return
        place = source, block.group
        waiting = self._samples.get(place)
        # a gap, a late block or a restart: the journal keeps the order of arrival and joins nothing across it
        if waiting and (waiting.stream, waiting.next_counter) != (block.stream, block.counter):
            self._write_samples(place)
            waiting = None
        if waiting is None:
            waiting = self._samples[place] = _Waiting(self._monotonic_ns(), block.counter, block.stream)
        waiting.blocks.append(block)
        waiting.next_counter += len(block.counts)
        waiting.n_bytes += block.counts.nbytes
        if waiting.n_bytes >= _MOST_BYTES_WAITING or len(waiting.blocks) >= _MOST_BLOCKS_WAITING:
            self._write_samples(place)

    def _add_trouble(self, source: int, trouble: Trouble) -> None:
        since_ns, before = self._troubles.get((source, trouble.kind), (self._monotonic_ns(), None))
        joined = trouble if before is None else replace(before, count=before.count + trouble.count)
        self._troubles[source, trouble.kind] = since_ns, joined

    def _add_end(self, source: int, end: End) -> None:
        # in the journal, too, an end stands behind the last samples of its stream
        for place in [place for place in self._samples if place[0] == source]:
            self._write_samples(place)
        self._sink.append(source, end)

    def _write_samples(self, place: tuple[int, int]) -> None:
        blocks = self._samples[place].blocks
        self._sink.append_blocks(place[0], blocks)
        # after the write: if that fails the samples are still known as not written
        del self._samples[place]
        self._written(place[0], blocks)

    def _write_trouble(self, place: tuple[int, TroubleKind]) -> None:
        _, trouble = self._troubles[place]
        self._sink.append(place[0], trouble)
        del self._troubles[place]
