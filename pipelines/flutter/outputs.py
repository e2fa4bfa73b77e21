"""Writing `stability.nc` and the report of a wing."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipelines.flutter import figures
from pipelines.flutter.analysis import FlutterExperiment
from pipelines.report.citations import Citation
from pipelines.report.numbers import text
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.page import Page
from pipelines.report.result_folder import result_folder
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import Table, provenance_table
from sloshlab import __version__
from sloshlab.quantities import described

_PAPERS = (
    Citation(
        "strip theory",
        "T. Theodorsen: General theory of aerodynamic instability and the mechanism of flutter. NACA Report 496 "
        "(1935).",
    ),
    Citation(
        "doublet lattice",
        "E. Albano, W. P. Rodden: A doublet-lattice method for calculating lift distributions on oscillating "
        "surfaces in subsonic flows. AIAA Journal 7, 279–285 (1969).",
        "10.2514/3.5086",
    ),
    Citation(
        "p-k method",
        "H. J. Hassig: An approximate true damping solution of the flutter equation by determinant iteration. "
        "Journal of Aircraft 8, 885–889 (1971).",
        "10.2514/3.44311",
    ),
    Citation(
        "minimum state",
        "M. Karpel: Design for active flutter suppression and gust alleviation using state-space aeroelastic "
        "modeling. Journal of Aircraft 19, 221–227 (1982).",
        "10.2514/3.57379",
    ),
)


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("stability.nc", *(["report.html"] if report else []))


def write_flutter(
    experiment: FlutterExperiment, folder: Path, *, command: str, report: bool = True
) -> dict[str, Any]:
    """Write `stability.nc` and the report; return the summary of the command."""
    provenance = provenance_of(command, experiment.inputs, settings=experiment.settings)
    with result_folder(folder, provenance) as complete:
        dataset = _dataset(experiment).assign_attrs(
            title="Stability over the speed", wing=experiment.model.name, **stamp_of(provenance)
        )
        write_dataset(dataset, complete / "stability.nc")
        if report:
            from pipelines.report.page import write_page

            page = _page(dataclasses.replace(experiment, provenance=provenance))
            write_page(page, complete, result_id=provenance[RESULT_ID])
    return {
        "wing": experiment.model.name,
        "crossings": [dataclasses.asdict(crossing) for crossing in experiment.locus.crossings],
        "p_k_flutter_m_per_s": _known(experiment.p_k_flutter_m_per_s),
        "flags": list(experiment.flags),
        "lines": [*_sentences(experiment), *report_lines(folder, written=report)],
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _dataset(experiment: FlutterExperiment) -> xr.Dataset:
    locus = experiment.locus
    pole = locus.pole_rad_per_s
    size = np.abs(pole)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(size > 0, -pole.real / size, np.nan)
    along = ("speed_m_per_s", "branch")
    variables: dict[str, Any] = {
        "pole_real_per_s": (along, pole.real),
        "pole_imag_rad_per_s": (along, pole.imag),
        "damping_ratio": (along, ratio),
        "origin": ("branch", np.array(locus.origin, dtype=object)),
        "crossing_speed_m_per_s": ("crossing", [found.speed_m_per_s for found in locus.crossings]),
        "crossing_frequency_rad_per_s": ("crossing", [found.frequency_rad_per_s for found in locus.crossings]),
        "crossing_origin": ("crossing", np.array([found.origin for found in locus.crossings], dtype=object)),
    }
    return described(xr.Dataset(variables, coords={"speed_m_per_s": locus.speed_m_per_s}))


def _page(experiment: FlutterExperiment) -> Page:
    def plan(name: str, draw: Any) -> FigurePlan:
        return FigurePlan(name, partial(draw, experiment=experiment))

    stability = SectionPlan(
        "Stability",
        (
            plan("root_locus", figures.root_locus),
            plan("damping_and_frequency", figures.damping_and_frequency),
        ),
        (_crossing_table(experiment),),
    )
    wing = SectionPlan("The wing without flow", (plan("mode_shapes", figures.mode_shapes),))
    forces = SectionPlan(
        "Forces of the air", (plan("fit_of_forces", figures.fit_of_forces),), (_fit_table(experiment),)
    )
    provenance = SectionPlan("Provenance", (), (provenance_table(experiment.provenance),))
    return Page(
        title="Flutter",
        subtitle=f"{experiment.model.name} · sloshlab {__version__}",
        flags=experiment.flags,
        summary=_sentences(experiment),
        plans=(stability, wing, forces, provenance),
        papers=_PAPERS,
    )


def _sentences(experiment: FlutterExperiment) -> tuple[str, ...]:
    found = [
        f"{crossing.kind} at {crossing.speed_m_per_s:.2f} m/s"
        + (f", {crossing.frequency_rad_per_s:.2f} rad/s" if crossing.kind == "flutter" else "")
        + f", from {crossing.origin}"
        for crossing in experiment.locus.crossings
    ]
    first, last = experiment.settings.first_m_per_s, experiment.settings.last_m_per_s
    return tuple(found) or (f"no root grows from {first:g} to {last:g} m/s",)


def _crossing_table(experiment: FlutterExperiment) -> Table:
    b = experiment.semi_chord_m
    rows = tuple(
        (
            crossing.kind,
            crossing.origin,
            f"{crossing.speed_m_per_s:.3f}",
            text(crossing.frequency_rad_per_s, 5),
            text(crossing.frequency_rad_per_s * b / crossing.speed_m_per_s, 3),
        )
        for crossing in experiment.locus.crossings
    )
    other = text(experiment.p_k_flutter_m_per_s, 6)
    return Table(
        "Where a root begins to grow",
        ("kind", "branch", "speed [m/s]", "frequency [rad/s]", "reduced frequency"),
        rows,
        f"By bisection of the root locus to 1 mm/s. First flutter by p-k, between computed speeds: {other} m/s.",
    )


def _fit_table(experiment: FlutterExperiment) -> Table:
    quality = experiment.rational.quality
    rms, largest = (quality.rms, float(quality.largest.max())) if quality else (float("nan"), float("nan"))
    chosen = experiment.model.aerodynamics
    rows = (
        ("method", chosen.method),
        ("table", experiment.cache.value if experiment.cache else "computed"),
        ("rational functions", chosen.rational.replace("_", " ")),
        ("lag states", str(experiment.rational.lags.size)),
        ("error of all entries, RMS", f"{100 * rms:.3f} %"),
        ("largest error of an entry over its largest value", f"{100 * largest:.2f} %"),
        (
            "reduced frequencies",
            f"{experiment.reduced_frequency.size}, up to {experiment.reduced_frequency[-1]:g}",
        ),
    )
    return Table("Generalised forces", ("", ""), rows)
