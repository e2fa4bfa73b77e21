"""Writing `stability.nc`, `response.nc`, `scan.nc` and the report of a flying aircraft."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from pathlib import Path
from typing import Any, Final

from pipelines.aircraft import flying_wing_figures, flying_wing_tables, offset_scan_figure
from pipelines.aircraft.flying_wing_comparison import comparisons, fate_of
from pipelines.aircraft.flying_wing_results import AircraftExperiment, GustResult
from pipelines.aircraft.gust_runs import recorded_case
from pipelines.aircraft.response_file import response_dataset
from pipelines.flutter.outputs import (
    PAPERS,
    model_sections,
    stability_dataset,
    stability_sections,
    stability_sentences,
)
from pipelines.report.citations import Citation
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.page import Page
from pipelines.report.result_folder import result_folder
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.style import file_stem
from pipelines.report.tables import provenance_table
from sloshlab import __version__

_LATERAL: Final = Citation(
    "sideways sloshing",
    "E. W. Graham, A. M. Rodriguez: The characteristics of fuel motion which affect airplane dynamics. Journal of "
    "Applied Mechanics 19, 381–388 (1952).",
)


def files_of(*, report: bool, scan: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("stability.nc", "response.nc", *(["scan.nc"] if scan else []), *(["report.html"] if report else []))


def write_aircraft(
    experiment: AircraftExperiment, folder: Path, *, command: str, report: bool = True
) -> dict[str, Any]:
    """Write data and report; return the summary of the command."""
    provenance = provenance_of(command, experiment.inputs, settings=experiment.settings)
    name, stamp = experiment.model.name, stamp_of(provenance)
    datasets = {
        "stability.nc": ("Stability over the speed", stability_dataset(experiment.flutter.results)),
        "response.nc": ("Gust responses", _responses(experiment)),
    }
    if experiment.scan is not None:
        datasets["scan.nc"] = ("Flutter over the place of the tanks", experiment.scan.to_dataset())
    with result_folder(folder, provenance) as complete:
        for file, (title, dataset) in datasets.items():
            write_dataset(dataset.assign_attrs(title=title, name=name, **stamp), complete / file)
        if report:
            from pipelines.report.page import write_page

            page = _page(dataclasses.replace(experiment, provenance=provenance))
            write_page(page, complete, result_id=provenance[RESULT_ID])
    return {
        "name": name,
        "flutter": {model: _point(experiment, model) for model in experiment.crossings},
        "gusts": [_gust_summary(result) for result in experiment.gusts],
        "comparison": [
            {"fact": row.fact, "printed": row.printed, "reached": row.reached, "holds": row.holds}
            for row in comparisons(experiment)
        ],
        "flags": list(experiment.flags),
        "lines": [*_sentences(experiment), *report_lines(folder, written=report)],
    }


def _responses(experiment: AircraftExperiment) -> Any:
    cases = [
        recorded_case(result.gust, [run.recorded for run in result.runs.values()]) for result in experiment.gusts
    ]
    return response_dataset(cases, experiment.node)


def _point(experiment: AircraftExperiment, model: str) -> dict[str, float] | None:
    crossing = experiment.flutter_of(model)
    if crossing is None:
        return None
    return {"speed_m_per_s": crossing.speed_m_per_s, "frequency_rad_per_s": crossing.frequency_rad_per_s}


def _gust_summary(result: GustResult) -> dict[str, Any]:
    def known(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    return {
        **dataclasses.asdict(result.gust),
        "models": {
            model: {
                "frequency_hz": known(run.first_mode.frequency_hz),
                "damping_ratio": known(run.first_mode.damping_ratio),
                "limit_cycle_rad": known(run.angle_of_attack.limit_cycle),
                "fate": fate_of(run),
                "ending": run.recorded.response.ending,
                "members_limit_cycle_rad": [known(member.limit_cycle) for member in result.members.get(model, ())],
                "members_damping_ratio": [known(member.damping_ratio) for member in result.members.get(model, ())],
            }
            for model, run in result.runs.items()
        },
    }


def _sentences(experiment: AircraftExperiment) -> tuple[str, ...]:
    lines = list(stability_sentences(experiment.flutter))
    if experiment.tanks is None and experiment.model.tanks:
        lines.append("no --rom: liquids are frozen or slosh sideways only; nothing sloshes vertically")
    for result in experiment.gusts:
        if result.gust.is_main:
            ends = ", ".join(f"{model} {fate_of(run)}" for model, run in result.runs.items())
            lines.append(f"gust {result.gust.name} at {result.gust.speed_m_per_s:.2f} m/s: {ends}")
    return (*lines, *flying_wing_tables.scan_sentence(experiment))


def _page(experiment: AircraftExperiment) -> Page:
    def plan(name: str, draw: Any, **more: Any) -> FigurePlan:
        return FigurePlan(name, partial(draw, experiment=experiment, **more))

    compared = comparisons(experiment)
    sections = [
        SectionPlan(
            "Beside the source",
            (plan("layout", flying_wing_figures.layout), plan("root_loci", flying_wing_figures.root_loci)),
            (
                *([flying_wing_tables.comparison_table(compared)] if compared else []),
                *([flying_wing_tables.damping_table(experiment)] if experiment.by_damping else []),
            ),
        )
    ]
    for result in experiment.gusts:
        stem = file_stem(result.gust.name).lower()
        drawn: tuple[FigurePlan, ...] = (plan(f"response_{stem}", flying_wing_figures.responses, result=result),)
        if result.gust.is_main:
            drawn += (
                plan(f"force_{stem}", flying_wing_figures.forces, result=result),
                plan(f"liquids_{stem}", flying_wing_figures.liquids, result=result),
            )
        sections.append(SectionPlan(f"Gust {result.gust.name}", drawn, (flying_wing_tables.gust_table(result),)))
    if experiment.scan is not None:
        sections.append(SectionPlan("Places of the tanks", (plan("offset_map", offset_scan_figure.offset_map),)))
    if experiment.tanks is not None:
        sections.append(SectionPlan("Domain of validity", (), (flying_wing_tables.departure_table(experiment),)))
    sections += [*stability_sections(experiment.flutter), *model_sections(experiment.flutter)]
    sections.append(SectionPlan("Provenance", (), (provenance_table(experiment.provenance),)))
    return Page(
        title="A flying aircraft with tanks",
        subtitle=f"{experiment.model.name} · sloshlab {__version__}",
        flags=experiment.flags,
        summary=_sentences(experiment),
        plans=tuple(sections),
        papers=(*PAPERS, _LATERAL),
    )
