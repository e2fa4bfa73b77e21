"""How many examples a property is tried with: all of them, or a part where a quick answer is wanted."""

from __future__ import annotations

import os

_LEAST = 20


def examples(n: int) -> int:
    """`n`; where `make test` sets ``SLOSHLAB_FEWER_EXAMPLES`` a tenth, but no fewer than 20 unless `n` is."""
    return max(n // 10, min(n, _LEAST)) if os.environ.get("SLOSHLAB_FEWER_EXAMPLES") else n
