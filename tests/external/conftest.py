"""Fixtures of tests on recordings of other laboratories."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def load_example(repository: Path) -> Callable[[str], ModuleType]:
    """(name) → the module of that name in ``docs/examples``, loaded as a user runs it."""

    def load(name: str) -> ModuleType:
        specification = importlib.util.spec_from_file_location(name, repository / f"docs/examples/{name}.py")
        assert specification is not None
        assert specification.loader is not None
        module = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(module)
        return module

    return load
