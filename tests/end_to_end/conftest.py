"""A small laboratory for all end-to-end tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from short_runs import make_laboratory


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with ``rig.toml``, ``sweep_1.5g.nc``, ``sweep_3g.nc`` and ``empty.nc``; tests do not change it."""
    folder = tmp_path_factory.mktemp("laboratory")
    make_laboratory(folder)
    return folder
