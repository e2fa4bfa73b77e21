"""What several tests of sources are given."""

from pathlib import Path

import pytest
from can_by_hand import database


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    """Database of the CAN device whose frames are written by hand."""
    return database(tmp_path / "cells.dbc")
