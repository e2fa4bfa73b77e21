"""Which figures and tables the report on sweeps has, in which order."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import PurePath
from typing import TYPE_CHECKING

from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.style import file_stem
from pipelines.report.tables import channel_table, consistency_tables, provenance_table, remark_table
from pipelines.sweep import (
    figures_maps,
    figures_quality,
    figures_regimes,
    figures_response,
    figures_runs,
    figures_signals,
    figures_viscous,
    figures_work,
    tables,
    touchable_maps,
)
from pipelines.sweep.selection import by_level, rig_text, runs_of
from sloshlab.experiments import EXPERIMENTS

if TYPE_CHECKING:
    from pipelines.sweep.results import RigResult, SweepExperiment

_THESIS_FIGURES = {
    0.50: {"bars": "Fig. 1.9", "work": "Fig. 1.11", "w_bar": "Fig. 1.12"},
    0.25: {"bars": "Fig. 1.13", "work": "Fig. 1.14", "w_bar": "Fig. 1.15"},
    0.75: {"bars": "Fig. 1.16", "work": "Fig. 1.17", "w_bar": "Fig. 1.18"},
}
_OTHER_FIGURES = {"bars": "like Fig. 1.9", "work": "like Fig. 1.11", "w_bar": "like Fig. 1.12"}


def planned_sections(experiment: SweepExperiment) -> tuple[SectionPlan, ...]:
    """The sections of the report of an experiment."""
    if experiment.kind == "work":
        return (_work_section(experiment), _quality_section(experiment), *_last_sections(experiment))
    prefixes = rig_prefixes(experiment.rigs)
    fills = [_rig_section(experiment, rig, prefix) for rig, prefix in zip(experiment.rigs, prefixes, strict=True)]
    sections = {"fill_levels": fills, "sensitivity": _fill_section(experiment)}
    filled = {name for run in experiment.runs for name in EXPERIMENTS[run.attributes.experiment].report_sections}
    own = [plan for name, plans in sections.items() if name in filled for plan in plans]
    return (*own, _quality_section(experiment), *_last_sections(experiment))


def rig_prefixes(rigs: Sequence[RigResult]) -> tuple[str, ...]:
    """Prefixes for file names, one per rig, all different whatever the rigs are called."""
    prefixes: list[str] = []
    for rig in rigs:
        stem = file_stem(PurePath(rig.name).stem)
        candidate, number = stem, 2
        while candidate in prefixes:
            candidate, number = f"{stem}_{number}", number + 1
        prefixes.append(candidate)
    return tuple(prefixes)


def _rig_section(experiment: SweepExperiment, rig: RigResult, prefix: str) -> SectionPlan:
    runs, liquid_mass_kg = runs_of(experiment, rig), rig.rig.liquid_mass_kg
    source = _THESIS_FIGURES.get(round(rig.rig.liquid.fill_level, 3), _OTHER_FIGURES)
    scaled = partial(figures_maps.scaled_map, rig=rig, runs=runs)
    plans = {
        "w_bar_map": partial(
            touchable_maps.w_bar_map, rig=rig, runs=runs, counterpart=source["w_bar"], n_maps=len(experiment.rigs)
        ),
        "beta_map": partial(scaled, quantity="beta", counterpart="Fig. 1.21"),
        "displacement_paths": partial(figures_runs.displacement_paths, runs=runs),
        "acceleration_paths": partial(figures_runs.acceleration_paths, runs=runs),
        "time_histories": partial(figures_signals.time_histories, runs=runs, liquid_mass_kg=liquid_mass_kg),
        "hysteresis": partial(figures_signals.hysteresis_loops, runs=runs, liquid_mass_kg=liquid_mass_kg),
        "work_bars": partial(figures_work.work_over_frequency, runs=runs, counterpart=source["bars"]),
        "surface": partial(figures_maps.surface, maps=rig.maps, windows=rig.windows),
        "work_map": partial(figures_maps.work_map, maps=rig.maps, runs=runs, counterpart=source["work"]),
        "over_velocity": partial(figures_maps.over_velocity, rig=rig, runs=runs),
        "uncertainty": partial(figures_maps.uncertainty_maps, maps=rig.maps, rig=rig),
        "viscous_map": partial(figures_viscous.viscous_map, rig=rig, runs=runs),
        "regimes": partial(figures_regimes.regime_map, rig=rig, runs=runs),
        "harmonics": partial(figures_regimes.harmonics, runs=runs, with_liquid=True),
    }
    return SectionPlan(
        f"Fill level {rig_text(rig)}",
        tuple(FigurePlan(f"{prefix}_{name}", draw) for name, draw in plans.items()),
        (tables.regime_table(rig.windows), tables.viscous_table(rig)),
    )


def _fill_section(experiment: SweepExperiment) -> tuple[SectionPlan, ...]:
    plans = (
        FigurePlan("work_over_fill_level", partial(figures_work.work_over_fill_level, experiment=experiment)),
        FigurePlan("isolines", partial(figures_maps.isolines, rigs=experiment.rigs)),
    )
    these = (tables.beta_table(experiment), tables.free_surface_table(experiment.rigs))
    return (SectionPlan("Sensitivity to the fill level", plans, these),)


def _work_section(experiment: SweepExperiment) -> SectionPlan:
    runs = by_level(experiment.runs)
    lines = partial(figures_work.level_curves, runs=runs, by_name=True)
    mass = (
        "Dissipated work per cycle over (u₀Ω)², which takes the amplitude out: a constant line is a linear damper \
with damping proportional to frequency; lines that differ between levels mean that the damping is not linear."
    )
    stiffness = (
        "In-phase force over acceleration. It is the moving mass where inertia rules, falls where stiffness \
does, and passes through zero at resonance."
    )
    loss = "Quadrature force over velocity γ: the damper that would dissipate the same work per cycle."
    maps = experiment.work_maps
    plans = {
        "frequency_response": partial(figures_response.frequency_response, runs=runs),
        "largest_response": partial(figures_response.loudest_response, runs=runs),
        "work_over_frequency": partial(
            lines, quantity="work_j", label="work per cycle W [J]", logarithmic=True, counterpart="like Fig. 1.9",
            caption="Dissipated work per cycle over frequency, one line per run; windows that give energy back "
            "within their scatter cannot be shown on the logarithmic axis.",
        ),
        "dissipated_mass": partial(
            lines, quantity="dissipated_mass_kg", label="W/(u₀Ω)² [kg]", caption=mass, logarithmic=True
        ),
        "apparent_mass": partial(lines, quantity="apparent_mass_kg", label="Re F/ü [kg]", caption=stiffness),
        "viscous_coefficient": partial(
            lines, quantity="gamma_kg_per_s", label="γ [kg/s]", caption=loss, logarithmic=True
        ),
        "displacement_paths": partial(figures_runs.displacement_paths, runs=runs, by_level=False),
        "acceleration_paths": partial(figures_runs.acceleration_paths, runs=runs, by_level=False),
        "hysteresis": partial(figures_signals.hysteresis_loops, runs=runs, liquid_mass_kg=None),
        "time_histories": partial(figures_signals.time_histories, runs=runs, liquid_mass_kg=None),
        "harmonics": partial(figures_regimes.harmonics, runs=runs, with_liquid=False),
    }  # fmt: skip
    if maps is not None:
        plans["work_map"] = partial(touchable_maps.work_map, maps=maps, runs=runs, counterpart="like Fig. 1.11")
        plans["uncertainty"] = partial(figures_maps.uncertainty_maps, maps=maps, rig=None)
    return SectionPlan(
        "Work and response",
        tuple(FigurePlan(name, draw) for name, draw in plans.items()),
        (tables.resonance_table(runs), tables.work_level_table(runs)) if runs else (),
    )


def _quality_section(experiment: SweepExperiment) -> SectionPlan:
    runs, by_name = experiment.runs, experiment.kind == "work"
    plans = {
        "energy_identity": partial(figures_quality.identity, windows=experiment.windows),
        "phase_error": partial(figures_quality.phase_error, runs=runs, by_name=by_name),
        "sensor_agreement": partial(figures_quality.sensor_agreement, runs=runs),
        "lost_data": partial(figures_quality.lost_data, runs=runs),
    }
    agreement = tables.agreement_table(runs)
    shown = [tables.dry_mass_table(experiment.rigs)] if experiment.rigs else []
    shown += [tables.identity_table(experiment), tables.validation_table(experiment), channel_table(runs)]
    shown += [agreement] if agreement is not None else []
    shown += [tables.run_table(runs), remark_table(runs), *consistency_tables(experiment.examinations)]
    return SectionPlan("Quality", tuple(FigurePlan(name, draw) for name, draw in plans.items()), tuple(shown))


def _last_sections(experiment: SweepExperiment) -> tuple[SectionPlan, SectionPlan]:
    return (
        SectionPlan("Parameters", tables=(tables.settings_table(experiment),)),
        SectionPlan("Provenance", tables=(provenance_table(experiment.provenance),)),
    )
