"""Damages of a file's bytes, each the same for the same number."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

_NUMBER = re.compile(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?")
_WORDS = [b"0", b"-1", b"1", b"65536", b"2147483647", b"4294967295", b"99999999999999999999", b"1e308", b"1e-320"]
_WORDS += [b"nan", b"inf", b"", b"1.", b"'", b'"', b"[", b"{", b"\n", b"\0", b"\xff", b"0.1", b"1e400"]
_INTEGERS = [0, 1, 2, 7, 8, 16, 64, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1]
_LARGEST_BYTES = 1 << 20


def mutated(seeds: Sequence[bytes], rng: np.random.Generator) -> bytes:
    """One of the seeds, damaged up to five times."""
    content = bytearray(seeds[int(rng.integers(len(seeds)))])
    for _ in range(int(rng.integers(1, 6))):
        content = _damaged(content, seeds, rng)
        if not content:
            return b"\0"
    return bytes(content[:_LARGEST_BYTES])


def _damaged(content: bytearray, seeds: Sequence[bytes], rng: np.random.Generator) -> bytearray:
    # half of the damages in the head, where sizes are declared
    reach = min(len(content), 600) if rng.random() < 0.5 else len(content)
    at = int(rng.integers(max(1, reach)))
    n = int(rng.integers(1, 65))
    kind = int(rng.integers(10))
    if kind == 0:
        return content[:at]
    if kind == 1:
        content[at] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        content[at : at + n] = rng.bytes(n)
    elif kind == 3:
        width = int(rng.choice([1, 2, 4, 8]))
        # in binary formats numbers stand at multiples of their size
        at = at // width * width
        value = _INTEGERS[int(rng.integers(len(_INTEGERS)))] % (1 << 8 * width)
        content[at : at + width] = value.to_bytes(width, "little" if rng.random() < 0.8 else "big")
    elif kind == 4:
        del content[at : at + n]
    elif kind == 5:
        content[at:at] = content[at : at + n] * int(rng.integers(1, 50))
    elif kind == 6:
        other = seeds[int(rng.integers(len(seeds)))]
        start = int(rng.integers(len(other)))
        content[at : at + n] = other[start : start + n]
    elif kind == 7:
        content[at : at + n] = bytes([int(rng.choice([0, 255, 32, 10]))]) * n
    else:
        numbers = list(_NUMBER.finditer(content, 0, min(len(content), 20_000)))
        if numbers:
            chosen = numbers[int(rng.integers(len(numbers)))]
            content[chosen.start() : chosen.end()] = _WORDS[int(rng.integers(len(_WORDS)))]
    return content
