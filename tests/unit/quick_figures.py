"""Figures without the search for room for labels, where `make test` wants a quick answer."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import pytest


@contextlib.contextmanager
def figures_not_laid_out() -> Iterator[None]:
    """Within the block figures have every mark and word, but wherever they fall: half the time of a report.

    Layout is tested in tests/unit/pipelines/report, and by `make test-all` everywhere.
    """
    with pytest.MonkeyPatch.context() as patches:
        if os.environ.get("SLOSHLAB_FEWER_EXAMPLES"):
            patches.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", _no_layout)
        yield


def _no_layout(*_: object) -> None:
    """In place of the search."""
