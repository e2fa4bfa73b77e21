"""Fixtures for all tests."""

from __future__ import annotations

import gc
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from forked_programs import programs_as_forks

from tests.compiled_once import compile_once
from tests.measured_times import sort_by_time

REPOSITORY = Path(__file__).resolve().parent.parent

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # started in the background of a shell, which ignores Ctrl-C; programs under test would inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    # started by nohup; programs under test would rightly outlive their terminal, too
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_configure(config: pytest.Config) -> None:
    """Workers compile each loop once for all of them."""
    if hasattr(config, "workerinput"):
        compile_once(Path(tempfile.gettempdir(), f"sloshlab-compiling-{config.workerinput['testrunuid']}"))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Workers take the longest files first."""
    if hasattr(config, "workerinput"):
        sort_by_time(items)


def pytest_collection_finish() -> None:
    """What collecting leaves stays to the end: nobody searches it for garbage, no fork copies it for that."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _no_figure_is_left() -> Iterator[None]:
    """Figures of pyplot are kept by the process: one test's are no other test's."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="module")
def programs_are_forks() -> Iterator[None]:
    """Programs of the project are forks, in `make test`: for tests of what they do, not of how they start."""
    with programs_as_forks():
        yield


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def external_data() -> Path:
    """Folder with the recordings of other laboratories; tests that need it skip without it."""
    folder = Path(os.environ.get("SLOSHLAB_EXTERNAL_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no recordings of other laboratories: set SLOSHLAB_EXTERNAL_DATA to their folder")
    return folder
