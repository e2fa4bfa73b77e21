"""What goes through the pipe from the recorder to the process that serves the page.

A frame is a header, then its bytes: JSON for everything that is said, counts as they are for samples.
All numbers are little-endian.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, BinaryIO, Final

import numpy as np

from acquisition.samples.delivery import Block

_SAID, _SAMPLES = 1, 2
_HEADER: Final = struct.Struct("<BxHI")
"""kind, source, bytes that follow."""
_SAMPLES_HEAD: Final = struct.Struct("<HHIqqq")
"""group, channels, samples, stream, counter, host_monotonic_ns; then int32 counts, sample by sample."""


def packed_message(about: str, content: Mapping[str, Any]) -> bytes:
    """A frame that says something."""
    text = json.dumps({"about": about, **content}, ensure_ascii=False).encode("utf-8", "replace")
    return _HEADER.pack(_SAID, 0, len(text)) + text


def packed_blocks(source: int, blocks: Sequence[Block]) -> bytes:
    """A frame of consecutive blocks of one group and stream."""
    first, last = blocks[0], blocks[-1]
    counts = first.counts if len(blocks) == 1 else np.concatenate([block.counts for block in blocks])
    n_samples, n_channels = counts.shape
    head = _SAMPLES_HEAD.pack(
        first.group, n_channels, n_samples, first.stream, first.counter, last.host_monotonic_ns
    )
    data = counts.astype("<i4", copy=False).tobytes()
    return _HEADER.pack(_SAMPLES, source, len(head) + len(data)) + head + data


def read_frames(pipe: BinaryIO) -> Iterator[dict[str, Any] | tuple[int, Block]]:
    """Frames until the pipe ends: what was said, or the number of a source and samples of it."""
    while len(header := pipe.read(_HEADER.size)) == _HEADER.size:
        kind, source, n_bytes = _HEADER.unpack(header)
        data = pipe.read(n_bytes)
        # the recorder has ended within a frame
        if len(data) < n_bytes:
            return
        yield json.loads(data) if kind == _SAID else (source, _block(data))


def _block(data: bytes) -> Block:
    group, n_channels, n_samples, stream, counter, host_ns = _SAMPLES_HEAD.unpack_from(data)
    counts = np.frombuffer(data, "<i4", offset=_SAMPLES_HEAD.size).reshape(n_samples, n_channels)
    return Block(group, stream, counter, counts, None, host_ns, 0)


def joined(deliveries: Sequence[tuple[int, Block]]) -> Iterator[tuple[int, list[Block]]]:
    """Blocks with the numbers of their sources, consecutive ones of a group and stream together."""
    waiting: dict[tuple[int, int], list[Block]] = {}
    for source, block in deliveries:
        own = waiting.setdefault((source, block.group), [])
        follows = own and (own[-1].stream, own[-1].counter + len(own[-1].counts)) == (block.stream, block.counter)
        if own and not follows:
            yield source, own
            own = waiting[source, block.group] = []
        own.append(block)
    yield from ((source, own) for (source, _), own in waiting.items())
