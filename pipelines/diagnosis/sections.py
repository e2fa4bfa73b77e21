"""The report on a diagnosis: which figures and tables, in which order."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from pipelines.diagnosis import figures, figures_force, figures_where, tables, touchable_histories, touchable_where
from pipelines.diagnosis.banner import banner_of
from pipelines.diagnosis.next_experiment import next_experiment
from pipelines.diagnosis.results import Diagnosis
from pipelines.report.citations import Citation
from pipelines.report.figure import ReportFigure
from pipelines.report.page import Page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import Table, consistency_tables, provenance_table
from sloshlab import __version__
from sloshlab.missing_physics.units import in_words

_TRANSFORM = Citation(
    "short-time spectra",
    "J. P. Princen, A. B. Bradley: Analysis/synthesis filter bank design based on time domain "
    "aliasing cancellation. "
    "IEEE Transactions on Acoustics, Speech, and Signal Processing 34, 1153–1161 (1986).",
    "10.1109/TASSP.1986.1164954",
)
_ROBUST = Citation(
    "large residuals",
    "P. J. Huber: Robust estimation of a location parameter. Annals of Mathematical Statistics 35, 73–101 (1964).",
    "10.1214/aoms/1177703732",
)

Draw = Callable[..., ReportFigure]


def page_of(diagnosis: Diagnosis) -> Page:
    """The page of the report."""
    places = [place for place, character in diagnosis.examination.characters.items()]
    where_tables = (
        tables.cut_table(diagnosis),
        tables.sensor_table(diagnosis),
        tables.sensor_error_table(diagnosis),
    )
    of_force: dict[str, tuple[dict[str, Draw], tuple[Table | None, ...]]] = {
        "What kind of force": (
            {"missing_force": figures_force.missing_force},
            tuple(tables.answers_table(diagnosis, place) for place in places),
        )
    }
    before_and_after: dict[str, tuple[dict[str, Draw], tuple[Table | None, ...]]] = {
        "Before and after": (
            {
                touchable_where.HISTORIES: touchable_histories.time_histories,
                "held_out_errors": figures.held_out_errors,
            },
            (tables.effect_parameter_table(diagnosis),),
        )
    }
    # Who wrote the twin knows its blocks and asks for the force first.
    is_own = diagnosis.findings.case.rig is None
    drawn: dict[str, tuple[dict[str, Draw], tuple[Table | None, ...]]] = {
        **(of_force | before_and_after if is_own else before_and_after),
        "For and against": (
            {"evidence": figures.evidence},
            (tables.evidence_table(diagnosis), tables.left_out_table(diagnosis)),
        ),
        "Where": (
            {
                "block_shares": figures_where.block_shares,
                "where": touchable_where.where,
                "residual_profiles": figures_where.residual_profiles,
            },
            where_tables,
        ),
        **({} if is_own else of_force),
        "What remains": (
            {},
            (
                tables.remains_table(diagnosis),
                tables.limits_table(diagnosis),
                tables.baseline_table(diagnosis),
            ),
        ),
        "Recordings": ({}, consistency_tables(diagnosis.recordings)[:1]),
    }
    plans = tuple(
        SectionPlan(
            title,
            tuple(FigurePlan(name, partial(draw, diagnosis=diagnosis)) for name, draw in them.items()),
            tuple(table for table in shown if table is not None),
        )
        for title, (them, shown) in drawn.items()
    )
    return Page(
        title="What was left out",
        subtitle=f"{diagnosis.findings.case.name} · sloshlab {__version__}",
        flags=diagnosis.flags,
        lead=diagnosis.verdict.headline,
        banner=banner_of(diagnosis),
        summary=_sentences(diagnosis),
        plans=(*plans, SectionPlan("Provenance", (), (provenance_table(diagnosis.provenance),))),
        papers=(_TRANSFORM, _ROBUST),
    )


def _sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    verdict, found = diagnosis.verdict, diagnosis.findings
    lines = [verdict.statement, f"Which experiment next: {next_experiment(diagnosis)}."]
    names = [(name, p) for name, p in verdict.probabilities.items() if p >= 0.005][:4]
    lines.append("Probabilities: " + ", ".join(f"{in_words(name)} {100 * p:.0f} %" for name, p in names) + ".")
    lines.append(
        f"{len(found.case.runs)} runs, {len(found.split.fitting)} fitted and "
        f"{len(found.split.held_out)} held out; {found.n_candidates} effects at all places were tried, "
        f"{len(found.explanations)} models fitted to the end, {len(found.failed)} failed."
    )
    return tuple(lines)
