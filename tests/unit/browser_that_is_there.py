"""A browser of this machine for tests that look at pages; none is downloaded."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

_COMMANDS = ("chromium", "chromium-browser", "google-chrome")


@contextlib.contextmanager
def opened_browser() -> Iterator[Any]:
    """The one that SLOSHLAB_BROWSER names, or Chromium or Chrome on the path, by Playwright; else a test skips."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="looks at pages by the package playwright")
    browser = os.environ.get("SLOSHLAB_BROWSER") or next(filter(None, map(shutil.which, _COMMANDS)), None)
    if browser is None:
        pytest.skip("no browser: install Chromium, or name one by SLOSHLAB_BROWSER")
    with sync_api.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        try:
            yield opened
        finally:
            opened.close()
