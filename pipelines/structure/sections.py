"""Which figures and tables the report has, in which order, and writing it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Final

from pipelines.report.citations import SCIPY, SOURCE, XARRAY, Citation
from pipelines.report.outputs import RESULT_ID
from pipelines.report.page import Page, write_page
from pipelines.report.progress import progress
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import Table, channel_table, consistency_tables, provenance_table, remark_table
from pipelines.structure import (
    figures_decay,
    figures_oscillator,
    figures_signals,
    figures_spectra,
    figures_twin,
    tables,
    touchable_histories,
    twin_damping,
)
from pipelines.structure.results import BeamExperiment
from pipelines.structure.summary import sentences
from pipelines.structure.uncertain_damping import uncertainty_table
from sloshlab import __version__
from sloshlab.experiments import EXPERIMENTS

_THESIS: Final = Citation(
    "beam, guided tank, modal filter and damping (2.13, 2.25, 2.31; Tables 2.1, 2.4, 2.5)",
    "Experimental data-driven reduced-order modeling of nonlinear vertical sloshing for aeroelastic analyses.",
)
_VECTOR_FITTING: Final = (
    Citation(
        "rational fit of frequency responses (vector fitting)",
        "B. Gustavsen, A. Semlyen: Rational approximation of frequency domain responses by vector fitting. IEEE "
        "Transactions on Power Delivery 14, 1052–1061 (1999).",
        "10.1109/61.772353",
    ),
    Citation(
        "relaxed pole relocation",
        "B. Gustavsen: Improving the pole relocating properties of vector fitting. IEEE Transactions on Power "
        "Delivery 21, 1587–1592 (2006).",
        "10.1109/TPWRD.2005.860281",
    ),
)
_WELCH: Final = Citation(
    "power spectral densities",
    "P. Welch: The use of fast Fourier transform for the estimation of power spectra: a method based on time "
    "averaging over short, modified periodograms. IEEE Transactions on Audio and Electroacoustics 15, 70–73 "
    "(1967).",
    "10.1109/TAU.1967.1161901",
)
_PAPERS: Final = (_THESIS, SOURCE, *_VECTOR_FITTING, _WELCH, SCIPY, XARRAY)


def write_beam_report(experiment: BeamExperiment, folder: Path) -> Path:
    """Write `figures/*.png` and the self-contained `report.html`; the same experiment gives the same bytes."""
    plans = planned_sections(experiment)
    page = Page(
        title=experiment.title,
        subtitle=f"{experiment.rig_name} · {len(experiment.runs)} runs · sloshlab {__version__}",
        flags=experiment.flags,
        summary=sentences(experiment),
        plans=plans,
        papers=_PAPERS,
    )
    result_id = str(experiment.provenance.get(RESULT_ID, ""))
    with progress("figures", sum(len(plan.figures) for plan in plans)) as advance:
        return write_page(page, folder, result_id=result_id, progress=lambda _done, _total, name: advance(name))


def planned_sections(experiment: BeamExperiment) -> tuple[SectionPlan, ...]:
    """The sections of the report; what has no data is left out or says so."""
    analysed = [run for run in experiment.runs if run.decays or run.random is not None]
    filled = {name for run in analysed for name in EXPERIMENTS[run.attributes.experiment].report_sections}
    sections = [section(experiment) for name, section in _SECTIONS.items() if name in filled]
    if any(run.is_simulated for run in experiment.runs):
        sections.append(_twin_section(experiment))
    quality = _present(
        tables.filter_table(experiment),
        channel_table(experiment.runs),
        tables.run_table(experiment.runs),
        tables.reason_table(experiment),
        remark_table(experiment.runs),
        *consistency_tables([run.examination for run in experiment.runs if not run.is_simulated]),
    )
    return (
        *sections,
        SectionPlan("Modes", tables=(tables.mode_table(experiment),)),
        SectionPlan("Quality", tables=quality),
        SectionPlan("Parameters", tables=(tables.settings_table(experiment),)),
        SectionPlan("Provenance", tables=(provenance_table(experiment.provenance),)),
    )


def _decay_section(experiment: BeamExperiment) -> SectionPlan:
    plans = {
        "sensor_signals": partial(figures_signals.sensor_signals, experiment=experiment),
        "modal_accelerations": partial(touchable_histories.modal_accelerations, experiment=experiment),
        "release_transient": partial(figures_signals.release_transient, experiment=experiment),
        "damping_over_amplitude": partial(figures_decay.over_amplitude, experiment=experiment, quantity="damping"),
        "frequency_over_amplitude": partial(
            figures_decay.over_amplitude, experiment=experiment, quantity="frequency"
        ),
        "damping_of_repeats": partial(figures_decay.repeats, experiment=experiment, quantity="damping"),
        "frequency_of_repeats": partial(figures_decay.repeats, experiment=experiment, quantity="frequency"),
    }
    if len(experiment.modes.names) > 1:
        plans["damping_of_higher_modes"] = partial(figures_decay.higher_modes, experiment=experiment)
    shown = _present(tables.decay_table(experiment), tables.pooled_table(experiment))
    return SectionPlan("Free decays", tuple(FigurePlan(name, draw) for name, draw in plans.items()), shown)


def _twin_section(experiment: BeamExperiment) -> SectionPlan:
    plans = {}
    if any(run.is_simulated for run in experiment.free_runs):
        plans["decay_against_twins"] = figures_twin.decay_against_twins
    if any(run.is_simulated for run in experiment.random_runs):
        plans["random_against_twins"] = figures_twin.random_against_twins
    drawn = tuple(FigurePlan(name, partial(draw, experiment=experiment)) for name, draw in plans.items())
    shown = _present(
        tables.twin_table(experiment),
        twin_damping.decay_table(experiment),
        twin_damping.random_table(experiment),
        uncertainty_table(experiment.network_uncertainty) if experiment.network_uncertainty else None,
    )
    return SectionPlan("Twins", drawn, shown)


def _random_section(experiment: BeamExperiment) -> SectionPlan:
    plans = {
        "random_signals": touchable_histories.random_signals,
        "excitation": figures_spectra.excitation,
        "densities": figures_spectra.densities,
        "frequency_responses": figures_spectra.frequency_responses,
        "damping_over_rms": figures_spectra.damping_over_rms,
        "amplitude_and_phase": figures_oscillator.amplitude_and_phase,
        "work_of_cycle": figures_oscillator.work_of_cycle,
    }
    drawn = tuple(FigurePlan(name, partial(draw, experiment=experiment)) for name, draw in plans.items())
    return SectionPlan("Random motion", drawn, _present(tables.random_table(experiment)))


_SECTIONS: Final = {"decays": _decay_section, "spectra": _random_section}
"""By the names that the registry of experiments has for them, in their order."""


def _present(*shown: Table | None) -> tuple[Table, ...]:
    return tuple(table for table in shown if table is not None)
