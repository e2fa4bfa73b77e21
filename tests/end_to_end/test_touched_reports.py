"""Reports in a real browser: nothing is fetched, nothing is reported as an error, and what is touched changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from browser_that_is_there import opened_browser
from touchable_page import HOSTILE, charts, histories, misfit_map, window_map, written_page

try:
    metadata.version("bokeh")
except metadata.PackageNotFoundError:
    pytest.skip("needs the package bokeh (extra interactive)", allow_module_level=True)

CONTENTS = {"histories": histories(), "map": window_map(), "charts": charts(), "misfit": misfit_map()}
WIDE, NARROW = {"width": 1400, "height": 900}, {"width": 400, "height": 800}
LINES = """name => {
  const lines = [];
  for (const panel of document.querySelectorAll(`#${name} .panel`)) {
    const view = [...Bokeh.index].find((view) => panel.contains(view.el));
    for (const renderer of view.model.renderers.filter((each) => each.visible && each.glyph.type !== "Rect"))
      lines.push(JSON.stringify(Object.values(renderer.data_source.data).map((part) => [...part])));
  }
  return lines;
}"""
PLACE = """([name, point]) => {
  const panel = document.querySelector(`#${name} .panel`);
  const view = [...Bokeh.index].find((view) => panel.contains(view.el));
  const tap = view.model.toolbar.tools.find((tool) => tool.type === "TapTool");
  const scatter = tap.renderers[0].data_source.data;
  const box = view.canvas_view.el.getBoundingClientRect(), { x_scale, y_scale } = view.frame;
  return [box.x + x_scale.compute(scatter.x[point]), box.y + y_scale.compute(scatter.y[point])];
}"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written_page(tmp_path_factory.mktemp("page"), CONTENTS)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with opened_browser() as launched:
        yield launched


@pytest.fixture
def opened(browser: Any, report: Path) -> Iterator[Callable[..., Any]]:
    """The report in a new window, its figures drawn; errors and requests are gathered and must not be there."""
    contexts, wrong = [], []

    def open_it(viewport: dict[str, int] = WIDE, **how: Any) -> Any:
        context = browser.new_context(viewport=viewport, **how)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: None if request.url == report.as_uri() else wrong.append(request.url))
        page.goto(report.as_uri())
        if how.get("java_script_enabled", True):
            for figure in page.query_selector_all("figure.touchable"):
                figure.scroll_into_view_if_needed()
                page.wait_for_function("it => it.querySelector('.touch').dataset.state", arg=figure)
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert wrong == []


def states(page: Any) -> list[str]:
    return page.eval_on_selector_all(".touch", "all => all.map((each) => each.dataset.state)")


@pytest.mark.parametrize("viewport", [WIDE, NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_figure_is_drawn_and_nothing_runs_over_the_edge(
    opened: Callable[..., Any], viewport: dict[str, int], scheme: str
) -> None:
    page = opened(viewport, color_scheme=scheme)
    assert states(page) == ["ready"] * len(CONTENTS)
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    assert page.title() != "taken"
    for panel in page.query_selector_all(".panel"):
        box = panel.bounding_box()
        assert box["width"] > 0.5 * viewport["width"] - 320
        assert box["x"] + box["width"] <= viewport["width"]
        assert panel.query_selector("canvas") is not None
    assert not page.is_visible("#histories > img")


def test_another_run_has_other_lines(opened: Callable[..., Any]) -> None:
    page = opened()
    before = page.evaluate(LINES, "histories")
    page.select_option("#histories select >> nth=0", index=2)
    after = page.evaluate(LINES, "histories")
    assert len(after) == len(before)
    assert after[0] != before[0]
    # run_1 swings by 7
    assert page.evaluate("lines => Math.max(...JSON.parse(lines[0])[1])", after) == pytest.approx(7.0, rel=1e-3)
    assert "all 1000 samples" in page.inner_text("#histories .touch-words")


def test_a_run_of_which_nothing_was_recorded_is_empty_and_no_error(opened: Callable[..., Any]) -> None:
    page = opened()
    page.select_option("#histories select >> nth=0", index=3)
    assert "all 1 samples" in page.inner_text("#histories .touch-words")
    page.select_option("#histories select >> nth=0", index=0)
    assert "all 1000 samples" in page.inner_text("#histories .touch-words")


def test_another_channel_has_other_lines(opened: Callable[..., Any]) -> None:
    page = opened()
    before = page.evaluate(LINES, "histories")
    page.select_option("#histories select >> nth=1", label="acceleration")
    assert page.evaluate(LINES, "histories")[0] != before[0]


def test_before_and_after_are_switched(opened: Callable[..., Any]) -> None:
    page = opened()
    shown = page.evaluate(LINES, "histories")
    page.get_by_label("before").uncheck()
    without = page.evaluate(LINES, "histories")
    # out of every panel: over time, its difference, its spectrum
    assert len(without) == len(shown) - 3
    assert set(without) < set(shown)
    page.get_by_label("before").check()
    assert page.evaluate(LINES, "histories") == shown
    page.get_by_label("as believed").check()
    assert len(page.evaluate(LINES, "histories")) == len(shown) + 3


def test_panels_over_time_are_zoomed_together_by_keys_and_buttons(opened: Callable[..., Any]) -> None:
    page = opened()
    span = """() => [...document.querySelectorAll("#histories .panel")].slice(0, 2).map((panel) => {
      const { start, end } = [...Bokeh.index].find((view) => panel.contains(view.el)).model.x_range;
      return [start, end];
    })"""
    assert page.evaluate(span) == [[0.5, 1.0], [0.5, 1.0]]
    page.focus("#histories .panel >> nth=0")
    page.keyboard.press("+")
    zoomed = page.evaluate(span)
    assert zoomed[0] == zoomed[1] == pytest.approx([0.575, 0.925])
    page.keyboard.press("ArrowRight")
    assert page.evaluate(span)[1] == pytest.approx([0.645, 0.995])
    page.get_by_role("button", name="whole run").click()
    assert page.evaluate(span)[1] == pytest.approx([0.0, 999 / 500.0], abs=1e-9)


def test_a_point_of_the_map_shows_its_loop_its_window_and_its_spectrum(opened: Callable[..., Any]) -> None:
    page = opened()
    first = page.evaluate(LINES, "map")
    page.locator("#map .panel >> nth=0").scroll_into_view_if_needed()
    page.mouse.click(*page.evaluate(PLACE, ["map", 12]))
    page.wait_for_function("document.querySelector('#map .touch-words').textContent.includes('12 Hz, 12 g')")
    then = page.evaluate(LINES, "map")
    # all points stay; ring, loop, window and spectrum are those of the point
    assert [one == other for one, other in zip(first, then, strict=True)] == [True, True, *[False] * 4]
    window = page.evaluate("lines => JSON.parse(lines[4])[1]", then)
    assert max(window) == pytest.approx(13.0, rel=1e-3)
    assert page.input_value("#map select >> nth=1") == "12"


def test_points_can_be_reached_without_a_mouse(opened: Callable[..., Any]) -> None:
    page = opened()
    page.get_by_role("button", name="next").press("Enter")
    assert "12 Hz, 4 g" in page.inner_text("#map .touch-words")
    page.select_option("#map select >> nth=1", index=19)
    assert "12 Hz, 19 g" in page.inner_text("#map .touch-words")


def test_colours_are_those_of_the_chosen_quantity(opened: Callable[..., Any]) -> None:
    page = opened()
    before = page.evaluate(LINES, "map")[1]
    page.select_option("#map select >> nth=0", label="β")
    assert page.evaluate(LINES, "map")[1] != before


SHOWN = """() => {
  const choices = [...document.querySelectorAll("#histories select")];
  const panel = document.querySelector("#histories .panel");
  const { start, end } = [...Bokeh.index].find((view) => panel.contains(view.el)).model.x_range;
  return [...choices.map((it) => it.selectedOptions[0].textContent), start, end];
}"""


def test_a_cell_of_the_misfit_shows_run_channel_and_stretch_in_the_time_histories(
    opened: Callable[..., Any],
) -> None:
    page = opened()
    page.select_option("#misfit select >> nth=1", label="acceleration")
    page.locator("#misfit .panel").scroll_into_view_if_needed()
    # four blocks a row: the third, of the second band
    page.mouse.click(*page.evaluate(PLACE, ["misfit", 6]))
    page.wait_for_selector("#misfit .touch-words:has-text('shown in')")
    # 1.0 … 1.5 s, and half as much on either side
    assert page.evaluate(SHOWN) == ["run_2", "acceleration", 0.75, 1.75]
    assert page.get_attribute("#misfit .touch-words a", "href") == "#histories"
    page.select_option("#misfit select >> nth=0", index=1)
    page.select_option("#misfit select >> nth=3", index=2)
    page.wait_for_selector("#misfit .touch-words:has-text('1.50 … 2.00')")
    # the second of the list has the second largest misfit, 4 × 11 in the last block
    assert page.evaluate(SHOWN) == [HOSTILE, "displacement", 1.25, 2.25]


def test_a_cell_of_what_has_no_time_history_says_so(opened: Callable[..., Any]) -> None:
    page = opened()
    before = page.evaluate(SHOWN)
    page.select_option("#misfit select >> nth=0", index=2)
    page.select_option("#misfit select >> nth=3", index=1)
    page.wait_for_selector("#misfit .touch-words:has-text('no time history')")
    assert page.evaluate(SHOWN) == before


def test_colours_of_the_misfit_are_those_of_the_chosen_model(opened: Callable[..., Any]) -> None:
    page = opened()
    values = """() => {
      const panel = document.querySelector("#misfit .panel");
      const view = [...Bokeh.index].find((view) => panel.contains(view.el));
      return [...view.model.toolbar.tools.find((it) => it.type === "TapTool").renderers[0].data_source.data.value];
    }"""
    # log₁₀(1 + 8 × 10) of the third block in the lowest band, a tenth of the misfit after
    assert page.evaluate(values)[2] == pytest.approx(1.90849, abs=1e-4)
    page.select_option("#misfit select >> nth=2", label="after")
    assert page.evaluate(values)[2] == pytest.approx(0.95424, abs=1e-4)


def test_a_chart_is_chosen_and_its_curves_are_switched_by_keys(opened: Callable[..., Any]) -> None:
    page = opened()
    first = page.evaluate(LINES, "charts")
    page.select_option("#charts select", index=1)
    then = page.evaluate(LINES, "charts")
    assert len(first) == len(then) == 2
    assert page.evaluate("lines => JSON.parse(lines[0])[1]", then) == pytest.approx([3.0, 6.0, 9.0], rel=1e-4)
    box = page.locator("#charts").get_by_label("measured")
    box.focus()
    page.keyboard.press("Space")
    assert page.evaluate(LINES, "charts") == then[1:]
    # the box keeps the keys, and what is off stays so for another run
    page.keyboard.press("Space")
    page.keyboard.press("Space")
    page.select_option("#charts select", index=0)
    assert page.evaluate(LINES, "charts") == first[1:]


def test_paper_shows_the_images(opened: Callable[..., Any]) -> None:
    page = opened()
    page.emulate_media(media="print")
    assert page.is_visible("#histories > img")
    assert not page.is_visible("#histories .panel >> nth=0")
    assert page.is_visible("#histories .of-image")


def test_without_scripts_the_images_are_shown(opened: Callable[..., Any]) -> None:
    page = opened(java_script_enabled=False)
    assert page.is_visible("#histories > img")
    assert page.is_visible("#map > img")
    assert not page.is_visible("#map .touch")
