"""A small laboratory for all end-to-end tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from quick_figures import figures_not_drawn
from short_runs import make_laboratory


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with ``rig.toml``, ``sweep_1.5g.nc``, ``sweep_3g.nc`` and ``empty.nc``; tests do not change it."""
    folder = tmp_path_factory.mktemp("laboratory")
    make_laboratory(folder)
    return folder


@pytest.fixture(scope="module", autouse=True)
def _figures_are_not_drawn() -> Iterator[None]:
    with figures_not_drawn():
        yield
