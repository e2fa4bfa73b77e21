"""Samples as a block of the journal holds them: consecutive ones of a group, and the times that belong to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from acquisition.recorder.journal_format import ENTRY, LARGEST_PAYLOAD_BYTES, NO_CLOCK, SAMPLES_HEAD
from acquisition.samples.delivery import Block, CountArray

# the clock fit needs the earliest arrivals of a run, not every one; each entry costs 32 bytes
SHORTEST_ENTRY_NS: Final = 40_000_000
"""Blocks that were read closer together than this share their times."""

# well below the largest payload, whatever the entries of the block add
_LARGEST_COUNTS_BYTES: Final = 4 << 20
# the number of entries is stored in 16 bits, and one block becomes one entry at most
_MOST_BLOCKS_JOINED: Final = 20_000


def in_parts(blocks: Sequence[Block]) -> list[list[Block]]:
    """`blocks` in runs small enough for one journal block each."""
    parts: list[list[Block]] = []
    n_bytes = 0
    for whole in blocks:
        for block in _split(whole):
            is_full = n_bytes + block.counts.nbytes > _LARGEST_COUNTS_BYTES
            # a plug-in may deliver blocks of any size
            if not parts or is_full or len(parts[-1]) == _MOST_BLOCKS_JOINED:
                parts.append([])
                n_bytes = 0
            parts[-1].append(block)
            n_bytes += block.counts.nbytes
    return parts


def _split(block: Block) -> list[Block]:
    n_each = max(1, _LARGEST_COUNTS_BYTES // (4 * max(1, block.counts.shape[1])))
    if len(block.counts) <= n_each:
        return [block] if len(block.counts) else []
    # later pieces have no clock of their own: the device gave one for the first sample only
    return [
        Block(
            block.group,
            block.stream,
            block.counter + start,
            block.counts[start : start + n_each],
            block.clock_ticks if start == 0 else None,
            block.host_monotonic_ns,
            block.host_utc_ns,
        )
        for start in range(0, len(block.counts), n_each)
    ]


def samples_payload(blocks: Sequence[Block]) -> bytes:
    """Payload of one journal block that holds consecutive blocks of a group, as `in_parts` makes them."""
    first = blocks[0]
    counts = first.counts if len(blocks) == 1 else np.concatenate([block.counts for block in blocks])
    stored = _narrowed(counts)
    entries = _entries(blocks)
    n_channels = counts.shape[1]
    head = SAMPLES_HEAD.pack(
        first.group, stored.itemsize, 0, n_channels, len(entries), first.stream, first.counter
    )
    payload = head + entries.tobytes() + stored.tobytes()
    if len(payload) > LARGEST_PAYLOAD_BYTES:
        raise ValueError(f"{len(payload)} bytes in one journal block")
    return payload


def _narrowed(counts: CountArray) -> np.ndarray[Any, Any]:
    """16-bit counts where all of them fit, whatever the channels declare."""
    # by the counts of each block and not by the channel's bits: 24-bit channels are mostly small, too
    narrow = counts.astype("<i2")
    return narrow if np.array_equal(narrow, counts) else counts.astype("<i4", copy=False)


def _entries(blocks: Sequence[Block]) -> np.ndarray[Any, Any]:
    rows: list[list[int]] = []
    began_ns = 0
    for block in blocks:
        ticks = NO_CLOCK if block.clock_ticks is None else block.clock_ticks
        # a device has 64 bits without a sign, the file has them with one
        if not 0 <= ticks < 2**63:
            ticks = NO_CLOCK
        # an entry has one clock, at its first sample: one that comes later needs an entry of its own
        brings_clock = bool(rows) and rows[-1][2] == NO_CLOCK != ticks
        if rows and not brings_clock and block.host_monotonic_ns - began_ns < SHORTEST_ENTRY_NS:
            rows[-1][0] += len(block.counts)
            rows[-1][3:] = block.host_monotonic_ns, block.host_utc_ns
        else:
            rows.append([len(block.counts), 0, ticks, block.host_monotonic_ns, block.host_utc_ns])
            began_ns = block.host_monotonic_ns
    return np.array([tuple(row) for row in rows], ENTRY)
