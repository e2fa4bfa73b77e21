"""A small laboratory for all end-to-end tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from short_runs import make_laboratory


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with ``rig.toml``, ``sweep_1.5g.nc``, ``sweep_3g.nc`` and ``empty.nc``; tests do not change it."""
    folder = tmp_path_factory.mktemp("laboratory")
    make_laboratory(folder)
    return folder


def _no_layout(*_: object) -> None:
    """In place of the search for room for labels."""


@pytest.fixture(scope="session", autouse=True)
def _figures_are_not_laid_out() -> Iterator[None]:
    """Where `make test` wants a quick answer, reports draw every mark and word, but lay nothing out.

    To find room for labels takes half the time of a report. Layout is tested in tests/unit/pipelines/report, and
    by `make test-all` in these reports, too.
    """
    with pytest.MonkeyPatch.context() as patches:
        if os.environ.get("SLOSHLAB_FEWER_EXAMPLES"):
            patches.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", _no_layout)
        yield
