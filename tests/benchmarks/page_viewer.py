"""Somebody who looks at the live page: a browser where there is one, else a program that takes every message.

``python -m tests.benchmarks.page_viewer URL`` looks until its standard input ends, then prints one JSON object:
what looked, how many messages it was sent, and how many samples the page has not shown.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import sys
from typing import Any
from urllib.parse import urlsplit

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_COUNTING = """
  window.counted = 0; window.skipped = 0;
  const Plain = window.WebSocket;
  window.WebSocket = class extends Plain {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", (event) => {
        window.counted += 1;
        window.skipped = JSON.parse(event.data).status.n_skipped || 0;
      });
    }
  };
"""


def main() -> None:
    """Look, and say what was seen."""
    url = sys.argv[1]
    browser = os.environ.get("SLOSHLAB_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        browser = None
    print(json.dumps(_by_browser(url, browser) if browser else _by_program(url)))


def _is_over(timeout_s: float) -> bool:
    return bool(select.select([sys.stdin], [], [], timeout_s)[0])


def _by_browser(url: str, browser: str) -> dict[str, Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = opened.new_page(viewport={"width": 1400, "height": 900})
        page.add_init_script(_COUNTING)
        page.goto(url)
        seen = [0, 0]
        while not _is_over(0):
            page.wait_for_timeout(250)
            seen = page.evaluate("[window.counted, window.skipped]")
        opened.close()
    return {"viewer": "browser", "n_messages": seen[0], "n_skipped": seen[1]}


def _by_program(url: str) -> dict[str, Any]:
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    parts = urlsplit(url)
    n_messages = n_skipped = 0
    with connect(f"ws://{parts.netloc}{parts.path}live", origin=f"http://{parts.netloc}", max_size=None) as page:
        try:
            while not _is_over(0):
                n_skipped = json.loads(page.recv())["status"].get("n_skipped", 0)
                n_messages += 1
        except ConnectionClosed:
            _is_over(60)
    return {"viewer": "program", "n_messages": n_messages, "n_skipped": n_skipped}


if __name__ == "__main__":
    main()
