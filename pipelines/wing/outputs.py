"""Writing the results and the report of a wing."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

import xarray as xr

from pipelines.flutter import figures as stability_figures
from pipelines.flutter.outputs import DOUBLET_LATTICE, P_K_METHOD
from pipelines.report.numbers import signed, text
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.page import Page
from pipelines.report.result_folder import result_folder
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import provenance_table
from pipelines.wing import datasets, figures, tables
from pipelines.wing.results import BETA_HAT, SLOSHING, GustCase, WingExperiment, WingResult
from sloshlab import __version__

_COUNTERPARTS = ("Fig. 3.7", "Fig. 3.8", "Fig. 3.9", "Fig. 3.10", "Fig. 3.10")


def files_of(*, report: bool, maps: bool, matched: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    names = ("stability", "response", "bifurcation", *(("energy",) if maps else ()))
    endings = ("", *(("_matched",) if matched else ()))
    return (
        *(f"{name}{ending}.nc" for ending in endings for name in names),
        *(["report.html"] if report else []),
    )


def write_wing(experiment: WingExperiment, folder: Path, *, command: str, report: bool = True) -> dict[str, Any]:
    """Write data and report; return the summary of the command."""
    provenance = provenance_of(command, experiment.inputs, settings=experiment.settings)
    with result_folder(folder, provenance) as complete:
        for (name, result), ending in zip(experiment.wings, ("", "_matched"), strict=False):
            for stem, dataset in _datasets(result).items():
                stamped = dataset.assign_attrs(title=f"{stem.capitalize()} of a {name}", **stamp_of(provenance))
                write_dataset(stamped, complete / f"{stem}{ending}.nc")
        if report:
            from pipelines.report.page import write_page

            page = _page(dataclasses.replace(experiment, provenance=provenance))
            write_page(page, complete, result_id=provenance[RESULT_ID])
    return {
        "wings": {name: _summary(result) for name, result in experiment.wings},
        "matched_share_of_liquid": experiment.matched_share,
        "flags": list(experiment.flags),
        "lines": [*_sentences(experiment), *report_lines(folder, written=report)],
    }


def _datasets(result: WingResult) -> dict[str, xr.Dataset]:
    found = {
        "stability": datasets.stability(result),
        "response": datasets.responses(result),
        "bifurcation": datasets.bifurcation(result.bifurcation),
    }
    if result.energy is not None:
        found["energy"] = datasets.energy(result.energy)
    if result.landing is not None:
        found["landing"] = datasets.landing(result.landing)
    return found


def _summary(result: WingResult) -> dict[str, Any]:
    flutter, wing = result.state.flutter, result.state.described.wing
    return {
        "flutter_speed_m_per_s": None if flutter is None else flutter.speed_m_per_s,
        "flutter_frequency_rad_per_s": None if flutter is None else flutter.frequency_rad_per_s,
        "frequency_ratio": result.state.frequency_ratio,
        "root_bending_stiffness_n_m2": wing.root_bending_stiffness_n_m2,
        "torsion_over_bending": wing.torsion_over_bending,
        "effective_mass_flutter_m_per_s": {
            f"{beta:.4g}": None if one is None else one.speed_m_per_s
            for beta, one in result.effective_mass.items()
        },
        "onset_m_per_s": result.bifurcation.onset_m_per_s,
        "fold_m_per_s": result.bifurcation.fold_m_per_s,
        "fold_by_map_m_per_s": None if result.energy is None else result.energy.effective.fold_m_per_s(),
        "damping_ratio": {
            case.case.name: {model: reading.first_damping_ratio for model, reading in case.readings.items()}
            for case in result.cases
        },
        "end_amplitude_m": {case.case.name: case.readings[SLOSHING].end.amplitude for case in result.gusts},
    }


def _sentences(experiment: WingExperiment) -> tuple[str, ...]:
    lines = []
    for name, result in experiment.wings:
        flutter = result.state.flutter
        if flutter is None:
            lines.append(f"{name}: no flutter with frozen liquids")
            continue
        lines.append(
            f"{name}: flutter with frozen liquids at {flutter.speed_m_per_s:.2f} m/s, ω_F/ω₁ = "
            f"{result.state.frequency_ratio:.3f}; both are inputs of its stiffness"
        )
        shifted = result.effective_mass.get(BETA_HAT)
        if shifted is not None:
            lines.append(
                f"{name}: an effective mass with β̂ = −0.154 moves it by "
                f"{signed(shifted.speed_m_per_s - flutter.speed_m_per_s, 2)} m/s"
            )
        lines.append(_cycles(name, result))
    if experiment.matched is not None:
        lines.append(f"matched wing: {100 * experiment.matched_share:.1f} % of the liquid of the wing")
    return tuple(lines)


def _cycles(name: str, result: WingResult) -> str:
    alive = [point for point in result.bifurcation.up if point.is_alive and point.cycle.is_converged]
    if not alive:
        return f"{name}: no limit cycle from {_speeds(result)}"
    first, last = alive[0], alive[-1]
    fold = result.bifurcation.fold_m_per_s
    ending = f"; beyond {fold:.2f} m/s the motion diverges" if fold == fold else "; it does not end there"
    return (
        f"{name}: limit cycles from {first.speed_m_per_s:.2f} m/s "
        f"({1e3 * first.cycle.amplitude:.3g} mm at the tip) to "
        f"{last.speed_m_per_s:.2f} m/s ({1e3 * last.cycle.amplitude:.3g} mm){ending}"
    )


def _speeds(result: WingResult) -> str:
    speeds = [point.speed_m_per_s for point in result.bifurcation.up]
    return f"{text(min(speeds), 4)} to {text(max(speeds), 4)} m/s"


def _page(experiment: WingExperiment) -> Page:
    sections: list[SectionPlan] = []
    for (name, result), ending in zip(experiment.wings, ("", "_matched"), strict=False):
        sections += _sections(experiment, result, name, ending)
    sections.append(SectionPlan("Provenance", (), (provenance_table(experiment.provenance),)))
    return Page(
        title="Wing with sloshing tanks",
        subtitle=f"{experiment.wing.state.described.wing.name} · sloshlab {__version__}",
        flags=experiment.flags,
        summary=_sentences(experiment),
        plans=tuple(sections),
        papers=(DOUBLET_LATTICE, P_K_METHOD),
    )


def _sections(experiment: WingExperiment, result: WingResult, name: str, ending: str) -> list[SectionPlan]:
    def plan(stem: str, draw: Any, **more: Any) -> FigurePlan:
        return FigurePlan(f"{stem}{ending}", partial(draw, **more))

    title = name.capitalize()
    first = (
        plan("layout", figures.layout, result=result),
        plan("modes", figures.modes, result=result),
    )
    stability = (
        plan("root_locus", stability_figures.root_locus, result=result.stability),
        plan("damping_and_frequency", stability_figures.damping_and_frequency, result=result.stability),
        plan("fill_level", figures.fill_level, result=result),
    )
    cycles = [plan("bifurcation", figures.bifurcation, found=result.bifurcation, balance=result.energy)]
    if result.energy is not None:
        cycles.append(plan("energy", figures.energy, balance=result.energy, found=result.bifurcation))
    sections = [
        SectionPlan(
            f"{title}: asked and reached", (),
            (tables.bars(experiment, result, is_matched=bool(ending)), tables.printed_and_reached(result)),
        ),
        SectionPlan(f"{title}: structure and tanks", first, (tables.stiffness(result), tables.tanks(result))),
        SectionPlan(f"{title}: stability", stability),
        SectionPlan(f"{title}: gusts", _gust_plans(result, plan)),
        SectionPlan(f"{title}: limit cycles and energy", tuple(cycles)),
    ]  # fmt: skip
    if result.dampers is not None and experiment.w_bar is not None:
        dampers = (
            plan("damping_maps", figures.damping_maps, result=result, w_bar=experiment.w_bar),
            plan("damper_gust", figures.damper_gust, case=result.dampers),
            plan("damper_damping", figures.damper_damping, case=result.dampers),
        )
        sections.append(SectionPlan(f"{title}: dampers in place of the liquid", dampers))
    if result.landing is not None:
        landing = (plan("landing", figures.gust, case=result.landing, counterpart="Fig. 3.13"),)
        sections.append(SectionPlan(f"{title}: landing", landing))
    sections.append(SectionPlan(f"{title}: outside the training", (), (tables.departures(result),)))
    return sections


def _gust_plans(result: WingResult, plan: Any) -> tuple[FigurePlan, ...]:
    drawn = [
        plan(f"gust_{number + 1}", figures.gust, case=case, counterpart=counterpart)
        for number, (case, counterpart) in enumerate(zip(result.gusts, _COUNTERPARTS, strict=True))
    ]
    fastest = max(case.case.speed_m_per_s for case in result.gusts)
    same: tuple[GustCase, ...] = tuple(case for case in result.gusts if case.case.speed_m_per_s == fastest)
    return (*drawn, plan("two_gusts", figures.two_gusts, cases=same))
