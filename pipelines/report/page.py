"""Drawing all figures and writing the report: everything complete or nothing."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from pipelines.report.citations import THESIS_REMARK, Citation
from pipelines.report.figure import NothingToDrawError, ReportFigure, SkippedFigure
from pipelines.report.interactive.embedding import embedded
from pipelines.report.interactive.policy import content_security_policy
from pipelines.report.outputs import RESULT_ID
from pipelines.report.sections import SectionPlan
from pipelines.report.style import drawing_style, file_stem
from sloshlab import atomic_file
from sloshlab.constants import GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from pipelines.report.tables import Table

Progress = Callable[[int, int, str], None]

_PNG_HEADER_BYTES: Final = 33
"""Signature and header chunk."""

GRAVITY_REMARK: Final = f"Accelerations in g are multiples of {GRAVITY_M_PER_S2} m/s²."


@dataclass(frozen=True)
class Banner:
    """What kind of answer a report gives, at a glance.

    Attributes
    ----------
    tone : {"clear", "found", "open", "unknown"}
        Its colour: nothing is wrong; an answer; several answers; none.
    label : str
        The kind in words, as a colour alone says nothing to many.
    words : str
        How good it is.
    """

    tone: Literal["clear", "found", "open", "unknown"]
    label: str
    words: str


@dataclass(frozen=True)
class Page:
    """What a report says beside its figures; `plans` are drawn in their order.

    Attributes
    ----------
    title, subtitle : str
        Head of the page.
    flags, summary : tuple of str
        What must be read first; the result in sentences.
    plans : tuple of SectionPlan
        Sections with their figures and tables.
    papers : tuple of Citation
        What the methods rest on.
    lead : str
        The result in one sentence, before everything else, if one says it.
    banner : Banner, optional
        What kind of answer it is.
    """

    title: str
    subtitle: str
    flags: tuple[str, ...]
    summary: tuple[str, ...]
    plans: tuple[SectionPlan, ...]
    papers: tuple[Citation, ...]
    lead: str = ""
    banner: Banner | None = None


@dataclass(frozen=True)
class Section:
    """A section with its figures drawn."""

    title: str
    figures: tuple[ReportFigure, ...]
    skipped: tuple[SkippedFigure, ...]
    tables: tuple[Table, ...]


def write_page(page: Page, folder: Path, *, result_id: str = "", progress: Progress | None = None) -> Path:
    """Write `figures/*.png` and `report.html`; nothing is written before every figure is drawn.

    Both say which result they belong to, if `result_id` does.
    """
    sections = drawn_sections(page.plans, progress)
    # a file name need not be Unicode; it must not stop the report
    html = page_html(page, sections, result_id=result_id).encode("utf-8", errors="replace")
    for figure in _figures(sections):
        png = with_png_text(figure.png, RESULT_ID, result_id) if result_id else figure.png
        atomic_file.write_bytes(folder / "figures" / f"{figure.name}.png", png)
    report = folder / "report.html"
    atomic_file.write_bytes(report, html)
    return report


def drawn_sections(plans: Sequence[SectionPlan], progress: Progress | None = None) -> tuple[Section, ...]:
    """Draw the figures of all sections; those without data become a reason."""
    total, done, sections = sum(len(plan.figures) for plan in plans), 0, []
    with drawing_style():
        for plan in plans:
            figures, skipped = [], []
            for figure in plan.figures:
                try:
                    figures.append(figure.draw(figure.name))
                except NothingToDrawError as reason:
                    skipped.append(SkippedFigure(figure.name, str(reason)))
                done += 1
                if progress is not None:
                    progress(done, total, figure.name)
            sections.append(Section(plan.title, tuple(figures), tuple(skipped), plan.tables))
    return tuple(sections)


def with_png_text(png: bytes, keyword: str, text: str) -> bytes:
    """A PNG with one more textual chunk behind its header (PNG specification, 11.3.3.2 tEXt)."""
    content = b"tEXt" + keyword.encode("latin-1") + b"\0" + text.encode("latin-1")
    chunk = struct.pack(">I", len(content) - 4) + content + struct.pack(">I", zlib.crc32(content))
    return png[:_PNG_HEADER_BYTES] + chunk + png[_PNG_HEADER_BYTES:]


def page_html(page: Page, sections: Sequence[Section], *, result_id: str = "") -> str:
    """The page as text: styles and images inside, nothing fetched from elsewhere."""
    from jinja2 import Environment, StrictUndefined

    files = resources.files("pipelines.report")
    css = files.joinpath("page.css").read_text(encoding="utf-8")
    touch = embedded(list(_figures(sections)))
    # names of runs and rigs come from files: they are text, never markup
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files.joinpath("page.html.j2").read_text(encoding="utf-8"))
    return template.render(
        title=page.title,
        result_id=result_id,
        subtitle=page.subtitle,
        lead=page.lead,
        banner=page.banner,
        css=_own(css),
        policy=content_security_policy(touch.script.elements, css),
        starter=_own(touch.script.starter),
        carried=touch.script.carried,
        touch_remark=touch.remark,
        flags=page.flags,
        summary=page.summary,
        remark=GRAVITY_REMARK,
        has_counterparts=any(figure.counterpart for figure in _figures(sections)),
        thesis=THESIS_REMARK,
        sections=_numbered(sections, touch.contents),
        papers=page.papers,
    )


def _own(text: str) -> Any:
    """Text that goes into the page as it is: a file of ours or of the library, or JSON that was escaped."""
    from markupsafe import Markup

    return Markup(text)


def _numbered(sections: Sequence[Section], touch: Mapping[str, str]) -> list[dict[str, Any]]:
    """Sections as the template takes them, figures numbered through the report."""
    shown, number = [], 0
    for index, section in enumerate(sections, start=1):
        figures = []
        for figure in section.figures:
            number += 1
            figures.append(
                {
                    "number": number,
                    "name": figure.name,
                    "caption": figure.caption,
                    "counterpart": figure.counterpart,
                    "data": base64.b64encode(figure.png).decode("ascii"),
                    "touch": _own(touch[figure.name]) if figure.name in touch else "",
                    "touch_caption": "" if figure.touch is None else figure.touch.caption,
                }
            )
        anchor = f"section-{index}-{file_stem(section.title).lower()}"
        shown.append({"title": section.title, "anchor": anchor, "figures": figures, "skipped": section.skipped,
                      "tables": section.tables})  # fmt: skip
    return shown


def _figures(sections: Sequence[Section]) -> Iterator[ReportFigure]:
    for section in sections:
        yield from section.figures
