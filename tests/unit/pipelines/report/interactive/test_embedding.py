"""What a page carries: the right numbers, scripts that its policy names, names that stay text, and no more."""

from __future__ import annotations

import base64
import hashlib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from page_contents import Scripts, numbers, samples
from touchable_page import HOSTILE, RATE_HZ, figure, histories, window_map, written_page

from pipelines.report.interactive.contents import Channel, Line
from pipelines.report.interactive.embedding import LARGEST_PAGE_BYTES, embedded

try:
    metadata.version("bokeh")
except metadata.PackageNotFoundError:
    pytest.skip("needs the package bokeh (extra interactive)", allow_module_level=True)


@pytest.fixture(scope="module")
def html(tmp_path_factory: pytest.TempPathFactory) -> str:
    contents = {"histories": histories(), "map": window_map(), "image": None}
    return written_page(tmp_path_factory.mktemp("page"), contents).read_text(encoding="utf-8")


def sha256(text: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() + "'"


def test_the_policy_allows_the_scripts_of_the_page_by_hash_and_nothing_else(html: str) -> None:
    page = Scripts(html)
    rules = {rule.split(" ")[0]: rule.split(" ")[1:] for rule in page.policy.split("; ")}
    assert len(page.scripts) == 1
    # the second is what the first unpacks and adds to the page
    assert rules["script-src"] == [sha256(page.scripts[0]), sha256(page.carried)]
    assert "Copyright (c) Anaconda" in page.carried
    assert rules["default-src"] == rules["connect-src"] == rules["base-uri"] == rules["form-action"] == ["'none'"]
    assert rules["img-src"] == ["data:"]
    assert "unsafe-eval" not in page.policy


def test_a_page_of_images_allows_no_script_and_only_its_own_style(tmp_path: Path) -> None:
    page = Scripts(written_page(tmp_path, {"image": None}).read_text(encoding="utf-8"))
    rules = {rule.split(" ")[0]: rule.split(" ")[1:] for rule in page.policy.split("; ")}
    assert page.scripts == page.data == []
    assert page.carried == ""
    assert rules["script-src"] == ["'none'"]
    assert rules["style-src"] == [sha256(style) for style in page.styles]


def test_names_are_text_wherever_they_stand(html: str) -> None:
    page = Scripts(html)
    # as many scripts as we wrote: no name opened or closed one
    assert len(page.scripts) == 1
    assert page.data[0]["runs"][1]["name"] == HOSTILE
    assert page.data[1]["windows"][0]["run"] == HOSTILE
    assert "<script>document.title" not in html


def test_histories_hold_what_was_recorded_and_simulated(html: str) -> None:
    content = Scripts(html).data[0]
    assert [run["group"] for run in content["runs"]] == ["held out", "held out", "fitted", "fitted"]
    carried = content["runs"][2]["channels"][0]
    time = carried["start"] + carried["interval"] * samples(carried["samples"])
    np.testing.assert_allclose(time, np.arange(1000) / RATE_HZ, atol=1e-12)
    # run_1 swings by 7, a quarter more before
    recorded, _, before, after = (numbers(line["values"]) for line in carried["lines"])
    np.testing.assert_allclose(recorded, 7 * np.sin(8 * np.pi * time), atol=7 * 2 / 65_000)
    np.testing.assert_allclose(before, 8.75 * np.sin(8 * np.pi * time), atol=8.75 * 2 / 65_000)
    np.testing.assert_allclose(after - recorded, 0.01, atol=5e-4)
    density = 10 ** numbers(carried["spectra"][0]["values"])
    at = numbers(carried["frequency"])
    np.testing.assert_allclose(density, 1 / (1 + (at - 4.0) ** 2), rtol=1e-3)


def test_a_close_up_of_a_long_run_has_all_its_samples() -> None:
    n = 50_000
    values = np.random.default_rng(5).normal(size=n)
    line = Line("recorded", "recorded", values)
    long = Channel("displacement", "mm", np.arange(n) / RATE_HZ, (line,), view_s=(10.0, 12.0))
    carried = long.plain(most_samples=400)
    at = samples(carried["samples"])
    assert set(range(5000, 6001)) <= set(at.tolist())
    assert at.size < 1001 + 410
    np.testing.assert_allclose(numbers(carried["lines"][0]["values"]), values[at], atol=2e-4)


def test_a_map_holds_its_points_and_what_is_seen_of_each(html: str) -> None:
    content = Scripts(html).data[1]
    x, y = numbers(content["x"]), numbers(content["y"])
    np.testing.assert_allclose(numbers(content["quantities"][0]["values"]), x * y, atol=1e-4)
    image = numbers(content["quantities"][0]["image"]["values"]).reshape(4, 5)
    np.testing.assert_allclose(image[0], np.arange(5), atol=1e-3)
    assert np.isnan(image[3, 4])
    assert content["quantities"][1]["image"] is None
    window = content["windows"][7]
    force, displacement = numbers(window["force"]), numbers(window["displacement"])
    np.testing.assert_allclose(np.abs(force).max(), 8.0, rtol=1e-3)
    # ∮F du of F₀ sin(φ − δ) over sin φ is −π F₀ sin δ a cycle; 600 samples are twelve cycles less one sample
    area = np.trapezoid(force, displacement) / 12
    assert area == pytest.approx(-np.pi * 8.0 * np.sin(0.3), rel=0.01)


def test_no_page_is_larger_than_a_mail_may_be(tmp_path: Path) -> None:
    file = written_page(tmp_path, {"histories": histories(), "map": window_map()})
    assert file.stat().st_size < LARGEST_PAGE_BYTES


def test_what_finds_no_room_stands_still_and_the_largest_goes_first() -> None:
    figures = [figure("histories", histories()), figure("map", window_map())]
    whole = embedded(figures)
    sizes = {name: len(content.encode()) for name, content in whole.contents.items()}
    scripts = whole.script.size
    images = sum(4 * -(-len(each.png) // 3) for each in figures)
    # room for the text of a page, the scripts, the images and the smaller content
    room = 150_000 + scripts + images + min(sizes.values())
    smaller = embedded(figures, room)
    assert set(smaller.contents) == {min(sizes, key=lambda name: sizes[name])}
    assert "1 of them stands still" in smaller.remark
    nothing = embedded(figures, room - 1 - min(sizes.values()))
    assert nothing.contents == {}
    assert nothing.script.elements == ()
    assert "stand still" in nothing.remark


def test_without_the_library_images_are_shown_and_the_page_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    html = written_page(tmp_path, {"histories": histories()}).read_text(encoding="utf-8")
    page = Scripts(html)
    assert page.scripts == page.data == []
    assert page.carried == ""
    assert "stand still: zooming into figures needs bokeh" in html
    assert "sloshlab[interactive]" in html
    assert "data:image/png;base64," in html
