"""The report on sweeps: `report.html` and every figure as a PNG."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipelines.report.citations import citation
from pipelines.report.outputs import RESULT_ID
from pipelines.report.page import Page, Progress, Section, page_html, write_page
from pipelines.sweep.results import SweepExperiment
from pipelines.sweep.sections import planned_sections
from pipelines.sweep.summary import sentences
from sloshlab import __version__


def write_report(experiment: SweepExperiment, folder: Path, *, progress: Progress | None = None) -> Path:
    """Write `figures/*.png` and the self-contained `report.html` of an experiment.

    Parameters
    ----------
    experiment : SweepExperiment
        What was analysed.
    folder : Path
        Made if it is not there. Nothing is written before every figure is drawn.
    progress : callable, optional
        Called with (figures done, figures in all, name) after each figure.

    Returns
    -------
    Path
        The report. The same experiment gives the same bytes.
    """
    result_id = str(experiment.provenance.get(RESULT_ID, ""))
    return write_page(_page(experiment), folder, result_id=result_id, progress=progress)


def _page(experiment: SweepExperiment) -> Page:
    return Page(
        title=experiment.title,
        subtitle=_subtitle(experiment),
        flags=experiment.all_flags,
        summary=sentences(experiment),
        plans=planned_sections(experiment),
        papers=citation(experiment.kind),
    )


def report_html(experiment: SweepExperiment, sections: Sequence[Section]) -> str:
    """The page of a sweep experiment as text."""
    return page_html(_page(experiment), sections)


def _subtitle(experiment: SweepExperiment) -> str:
    rigs = f", {len(experiment.rigs)} fill levels" if len(experiment.rigs) > 1 else ""
    return f"{len(experiment.runs)} runs{rigs} · sloshlab {__version__}"
