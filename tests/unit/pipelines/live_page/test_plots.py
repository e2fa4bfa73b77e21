"""What the live page draws, looked at pixel by pixel."""

from __future__ import annotations

from importlib import resources
from typing import Any

from browser_that_is_there import opened_browser

PAGE = "<!doctype html><meta charset=utf-8><canvas style='width:400px;height:120px'></canvas>"
INKED_ROWS = """async (label) => {
  const plots = await import("/plots.js");
  const canvas = document.querySelector("canvas");
  plots.trend(canvas, [{ x: 0, y: 0.3, error: 0 }, { x: 1, y: 0.4, error: 0 }], "time [s]", label);
  const { data } = canvas.getContext("2d").getImageData(0, 0, 13, 21);
  const inked = (row, column) => data[4 * (13 * row + column) + 3] > 90;
  const columns = [...Array(13).keys()];
  return Array.from({ length: 21 }, (_, row) => columns.filter((column) => inked(row, column)).length);
}"""


def served(route: Any) -> None:
    """The script of the page, and an empty page for everything else."""
    if route.request.url.endswith("/plots.js"):
        script = resources.files("pipelines.live_page").joinpath("assets", "plots.js").read_text(encoding="utf-8")
        route.fulfill(body=script, content_type="text/javascript")
    else:
        route.fulfill(body=PAGE, content_type="text/html")


def test_a_bar_over_a_letter_is_as_wide_as_the_letter() -> None:
    with opened_browser() as browser:
        page = browser.new_page()
        page.route("**/*", served)
        page.goto("http://live.invalid/")
        plain, barred = (page.evaluate(INKED_ROWS, label) for label in ("W [1]", "W̄ [1]"))
    added = [row for row in range(21) if barred[row] > plain[row]]
    top = next(row for row in range(21) if plain[row])
    # a W of 11 pixels is 11 wide; the bar leaves out one at either side, and stands clear of the letter
    assert [row < top for row in added] == [True] * len(added) != []
    assert max(barred[row] for row in added) >= 8
    # the letters are the same
    assert barred[top:] == plain[top:]
