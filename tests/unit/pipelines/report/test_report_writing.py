"""The page and its files: complete, self-contained, safe, the same every time."""

from __future__ import annotations

import base64
import dataclasses
import io
import re
from collections.abc import Callable, Mapping
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from slow_cases import slow_but
from synthetic_experiment import shaker_experiment

from pipelines.report.page import drawn_sections
from pipelines.report.sections import SectionPlan
from pipelines.report.style import DOTS_PER_INCH, WIDTH_INCH
from pipelines.sweep.report import report_html, write_report
from pipelines.sweep.results import SweepExperiment
from pipelines.sweep.sections import planned_sections, rig_prefixes

Drawn = Callable[[str], tuple[SweepExperiment, Path]]
Makers = Mapping[str, Callable[[], SweepExperiment]]

OF_A_RIG = {
    "w_bar_map", "beta_map", "displacement_paths", "acceleration_paths", "time_histories", "hysteresis",
    "work_bars", "surface", "work_map", "over_velocity", "uncertainty", "viscous_map", "regimes", "harmonics",
}  # fmt: skip
OF_QUALITY = {"energy_identity", "phase_error", "sensor_agreement", "lost_data"}
OF_WORK = {
    "frequency_response", "largest_response", "work_over_frequency", "dissipated_mass", "apparent_mass",
    "viscous_coefficient", "displacement_paths", "acceleration_paths", "hysteresis", "time_histories", "harmonics",
    "work_map", "uncertainty",
}  # fmt: skip
EXPECTED = {
    "two fills": {f"rig_{fill}_{name}" for fill in ("0.50", "0.25") for name in OF_A_RIG}
    | OF_QUALITY
    | {"work_over_fill_level", "isolines"},
    "one run": {f"rig_0.50_{name}" for name in OF_A_RIG} | OF_QUALITY,
    "work": OF_WORK | OF_QUALITY,
}
VOID = {"meta", "img", "br", "link", "hr", "input"}


class Page(HTMLParser):
    """Start tags, a check that all are closed in order, and the text outside of styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.problems: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.problems.append(f"</{tag}> at line {self.getpos()[0]}")

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data


def page_of(folder: Path) -> Page:
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def test_two_fills_have_the_figures_of_both_and_those_of_several_fills(makers: Makers) -> None:
    planned = planned_sections(makers["two fills"]())
    assert {figure.name for section in planned for figure in section.figures} == EXPECTED["two fills"]


@pytest.mark.parametrize("name", slow_but(["one run", "work"], sorted(EXPECTED)))
def test_exactly_the_expected_figures_are_written(drawn: Drawn, name: str) -> None:
    _, folder = drawn(name)
    assert {path.stem for path in (folder / "figures").iterdir()} == EXPECTED[name]
    assert {path.name for path in folder.iterdir()} == {"figures", "report.html"}


@pytest.mark.parametrize("name", slow_but(["one run", "work"], sorted(EXPECTED)))
def test_every_figure_is_a_png_as_wide_as_the_page_with_something_drawn(drawn: Drawn, name: str) -> None:
    _, folder = drawn(name)
    for path in (folder / "figures").iterdir():
        with Image.open(path) as image:
            assert image.format == "PNG"
            assert len(image.getcolors(256)) > 20, path.name
            pixels = np.asarray(image.convert("RGB"))
        assert pixels.shape[1] == round(WIDTH_INCH * DOTS_PER_INCH)
        assert 300 < pixels.shape[0] < 1400
        not_white = (pixels < 250).any(axis=2)
        assert 0.01 < not_white.mean() < 0.95, path.name
        assert not not_white[:, -1].any(), f"{path.name} is cut at its right edge"


@pytest.mark.parametrize("name", slow_but(["one run", "work"], sorted(EXPECTED)))
def test_the_page_is_well_formed_and_fetches_nothing(drawn: Drawn, name: str) -> None:
    page = page_of(drawn(name)[1])
    assert page.problems == []
    assert page.open == []
    assert not {tag for tag, _ in page.tags} & {"script", "link", "iframe", "object", "form", "base", "embed"}
    for tag, attributes in page.tags:
        assert not [key for key in attributes if key.startswith("on")]
        if tag == "img":
            assert attributes["src"].startswith("data:image/png;base64,")
            assert len(attributes["alt"]) > 40
        if "href" in attributes:
            assert attributes["href"].startswith(("#", "https://doi.org/10."))
    style = (drawn(name)[1] / "report.html").read_text(encoding="utf-8").split("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style


def test_embedded_images_are_the_files(drawn: Drawn) -> None:
    _, folder = drawn("one run")
    sources = [attributes["src"] for tag, attributes in page_of(folder).tags if tag == "img"]
    embedded = {base64.b64decode(source.split(",", 1)[1]) for source in sources}
    assert embedded == {path.read_bytes() for path in (folder / "figures").iterdir()}
    assert len(sources) == len(embedded)


def test_links_lead_to_sections_that_are_there(drawn: Drawn) -> None:
    page = page_of(drawn("hostile names")[1])
    identifiers = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))
    links = {attributes["href"] for _, attributes in page.tags if attributes.get("href", "").startswith("#")}
    assert len(links) >= 7
    assert links <= {f"#{identifier}" for identifier in identifiers}


@pytest.mark.parametrize("name", slow_but(["one run", "work"], sorted(EXPECTED)))
def test_what_stands_after_the_number_of_a_figure_is_explained_once(drawn: Drawn, name: str) -> None:
    _, folder = drawn(name)
    text = " ".join(page_of(folder).text.split())
    assert re.search(r"Figure \d+ \(thesis: (like )?Fig\. 1\.\d+", text)
    assert not re.search(r"Figure \d+ \((?!thesis: )", text)
    before_the_figures = text[: text.index("(thesis: ")]
    assert before_the_figures.count("After the number of a figure stands its counterpart in the thesis") == 1
    assert "Experimental data-driven reduced-order modeling of nonlinear vertical sloshing" in before_the_figures


def test_hostile_names_are_text_and_not_markup(drawn: Drawn) -> None:
    experiment, folder = drawn("hostile names")
    assert experiment.runs[0].attributes.run_id.startswith("<script>")
    raw = (folder / "report.html").read_text(encoding="utf-8")
    assert "<script" not in raw
    assert "<b>look" not in raw
    page = page_of(folder)
    assert "<script>alert(1)</script> $x_{$ 0.5 1.5 g" in page.text
    assert "<b>look</b> at run 2" in page.text
    assert "$x_{$ <i>level 3" in page_of(drawn("work")[1]).text  # and half a formula is drawn as it stands


def test_flags_stand_before_the_summary(drawn: Drawn) -> None:
    text = page_of(drawn("hostile names")[1]).text
    assert 0 < text.index("Read this before") < text.index("at run 2") < text.index("Summary")
    assert "No run and no result is flagged" in page_of(drawn("one run")[1]).text


def test_what_is_not_drawn_says_why(drawn: Drawn) -> None:
    text = page_of(drawn("one run")[1]).text
    assert "isolines: there is one fill level only" in text
    assert "work_over_fill_level: there is one fill level only" in text
    assert "free-surface modes need it" in text  # no surface tension in the rig


def test_cross_validated_error_and_quality_are_stated(drawn: Drawn) -> None:
    text = page_of(drawn("hostile names")[1]).text
    for words in ("0.034", "0.6123 ± 0.00030", "1.0100 ± 0.00050", "acceleration_roof_2", "force_cell_1: cut"):
        assert words in text


def test_provenance_names_command_versions_and_hashes(drawn: Drawn) -> None:
    experiment, folder = drawn("one run")
    text = page_of(folder).text
    assert "sloshlab shaker fill" in text
    assert "versions: python" in text
    assert experiment.runs[0].sha256 in text


def test_papers_have_resolvable_identifiers(drawn: Drawn) -> None:
    text = page_of(drawn("work")[1]).text
    assert "103478 (2022)" in text
    assert len(re.findall(r"doi:10\.\d{4,5}/\S+", text)) == 5


@pytest.mark.parametrize("n_figures", slow_but([1], [1, 100]))
def test_the_same_experiment_gives_the_same_bytes(
    makers: Makers, n_figures: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def some_figures(experiment: SweepExperiment) -> list[SectionPlan]:
        """The first ones of each section."""
        return [
            dataclasses.replace(plan, figures=plan.figures[:n_figures]) for plan in planned_sections(experiment)
        ]

    monkeypatch.setattr("pipelines.sweep.report.planned_sections", some_figures)
    first, second = (write_report(makers["work"](), tmp_path / name) for name in ("first", "second"))
    assert second == tmp_path / "second" / "report.html"
    assert second.read_bytes() == first.read_bytes()
    assert len(list((tmp_path / "first" / "figures").iterdir())) >= 1


def test_png_files_hold_no_date_and_no_software(drawn: Drawn) -> None:
    for path in (drawn("work")[1] / "figures").iterdir():
        with Image.open(io.BytesIO(path.read_bytes())) as image:
            assert set(image.info) <= {"dpi"}


def test_nothing_is_written_when_drawing_is_interrupted(tmp_path: Path) -> None:
    def interrupt(done: int, total: int, name: str) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_report(shaker_experiment((0.5,), (2.0,)), tmp_path / "out", progress=interrupt)
    assert not (tmp_path / "out").exists()


def test_the_callers_drawing_settings_neither_matter_nor_change(drawn: Drawn) -> None:
    import matplotlib

    experiment, _ = drawn("one run")
    plan = planned_sections(experiment)[0]
    plan = dataclasses.replace(plan, figures=plan.figures[:1])
    [usual] = drawn_sections([plan])
    with matplotlib.rc_context({"font.size": 30.0, "xtick.color": "red"}):
        [strange] = drawn_sections([plan])
        assert matplotlib.rcParams["font.size"] == 30.0
    assert usual.figures[0].png == strange.figures[0].png


def test_rigs_with_names_alike_get_different_files() -> None:
    rigs = shaker_experiment((0.5, 0.25), (2.0,)).rigs
    alike = [dataclasses.replace(rig, name="../a b.toml") for rig in rigs]
    assert rig_prefixes(alike) == ("a_b", "a_b_2")


def test_text_that_is_no_unicode_does_not_stop_the_report() -> None:
    experiment = dataclasses.replace(shaker_experiment((0.5,), (2.0,)), title="broken \udcff name")
    html = report_html(experiment, ())
    assert "broken ? name" in html.encode("utf-8", errors="replace").decode("utf-8")
