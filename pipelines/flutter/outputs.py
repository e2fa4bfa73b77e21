"""Writing `stability.nc` and the report of a wing or an aircraft."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from pipelines.flutter import figures, mode_figures
from pipelines.flutter.analysis import FlutterExperiment, Stability
from pipelines.flutter.problem import FlutterProblem
from pipelines.report.citations import Citation
from pipelines.report.numbers import text
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.page import Page
from pipelines.report.result_folder import result_folder
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import Table, provenance_table
from sloshlab import __version__
from sloshlab.quantities import described

DOUBLET_LATTICE: Final = Citation(
    "doublet lattice",
    "E. Albano, W. P. Rodden: A doublet-lattice method for calculating lift distributions on oscillating "
    "surfaces in subsonic flows. AIAA Journal 7, 279–285 (1969).",
    "10.2514/3.5086",
)
P_K_METHOD: Final = Citation(
    "p-k method",
    "H. J. Hassig: An approximate true damping solution of the flutter equation by determinant iteration. "
    "Journal of Aircraft 8, 885–889 (1971).",
    "10.2514/3.44311",
)
PAPERS: Final = (
    Citation(
        "strip theory",
        "T. Theodorsen: General theory of aerodynamic instability and the mechanism of flutter. NACA Report 496 "
        "(1935).",
    ),
    DOUBLET_LATTICE,
    P_K_METHOD,
    Citation(
        "minimum state",
        "M. Karpel: Design for active flutter suppression and gust alleviation using state-space aeroelastic "
        "modeling. Journal of Aircraft 19, 221–227 (1982).",
        "10.2514/3.57379",
    ),
)
"""What flutter rests on."""


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("stability.nc", *(["report.html"] if report else []))


def write_flutter(
    experiment: FlutterExperiment, folder: Path, *, command: str, report: bool = True
) -> dict[str, Any]:
    """Write `stability.nc` and the report; return the summary of the command."""
    provenance = provenance_of(command, experiment.inputs, settings=experiment.settings)
    name = experiment.problem.name
    with result_folder(folder, provenance) as complete:
        dataset = stability_dataset(experiment.results).assign_attrs(
            title="Stability over the speed", name=name, **stamp_of(provenance)
        )
        write_dataset(dataset, complete / "stability.nc")
        if report:
            from pipelines.report.page import write_page

            page = _page(dataclasses.replace(experiment, provenance=provenance))
            write_page(page, complete, result_id=provenance[RESULT_ID])
    return {
        "name": name,
        "models": {result.name: _summary(result) for result in experiment.results},
        "checks": [
            {"what": check.what, "asked": check.largest, "reached": check.reached} for check in experiment.checks
        ],
        "flags": list(experiment.flags),
        "lines": [*stability_sentences(experiment), *report_lines(folder, written=report)],
    }


def _summary(result: Stability) -> dict[str, Any]:
    flutter = result.locus.flutter
    return {
        "flutter_speed_m_per_s": None if flutter is None else flutter.speed_m_per_s,
        "flutter_frequency_rad_per_s": None if flutter is None else flutter.frequency_rad_per_s,
        "p_k_flutter_m_per_s": _known(result.p_k_flutter_m_per_s),
        "crossings": [
            {
                "kind": crossing.kind,
                "speed_m_per_s": crossing.speed_m_per_s,
                "frequency_rad_per_s": crossing.frequency_rad_per_s,
                "origin": crossing.origin,
            }
            for crossing in result.locus.crossings
        ],
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def stability_dataset(results: Sequence[Stability]) -> xr.Dataset:
    """Roots of models side by side; one with fewer branches has NaN for the rest.

    Parameters
    ----------
    results : sequence of Stability
        At the same speeds.

    Returns
    -------
    xarray.Dataset
        As ``stability.nc`` keeps it.
    """
    loci = [result.locus for result in results]
    n_branches = max(len(locus.origin) for locus in loci)
    pole = np.full((len(loci), loci[0].speed_m_per_s.size, n_branches), np.nan, dtype=complex)
    origin = np.full((len(loci), n_branches), "", dtype=object)
    for number, locus in enumerate(loci):
        pole[number, :, : len(locus.origin)] = locus.pole_rad_per_s
        origin[number, : len(locus.origin)] = locus.origin
    size = np.abs(pole)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(size > 0, -pole.real / size, np.nan)
    along = ("model", "speed", "branch")
    found = [(result.name, crossing) for result in results for crossing in result.locus.crossings]
    flutter = [locus.flutter for locus in loci]
    variables: dict[str, Any] = {
        "pole_real": (along, pole.real),
        "pole_imag": (along, pole.imag),
        "damping_ratio": (along, ratio),
        "origin": (("model", "branch"), origin),
        "flutter_speed": ("model", [np.nan if one is None else one.speed_m_per_s for one in flutter]),
        "flutter_frequency": ("model", [np.nan if one is None else one.frequency_rad_per_s for one in flutter]),
        "p_k_flutter_speed": ("model", [result.p_k_flutter_m_per_s for result in results]),
        "crossing_model": ("crossing", np.array([name for name, _ in found], dtype=object)),
        "crossing_kind": ("crossing", np.array([crossing.kind for _, crossing in found], dtype=object)),
        "crossing_origin": ("crossing", np.array([crossing.origin for _, crossing in found], dtype=object)),
        "crossing_speed": ("crossing", np.array([crossing.speed_m_per_s for _, crossing in found])),
        "crossing_frequency": ("crossing", np.array([crossing.frequency_rad_per_s for _, crossing in found])),
    }
    coordinates = {
        "model": np.array([result.name for result in results], dtype=object),
        "speed": loci[0].speed_m_per_s,
    }
    return described(xr.Dataset(variables, coords=coordinates))


def _page(experiment: FlutterExperiment) -> Page:
    sections = [*stability_sections(experiment), *model_sections(experiment)]
    provenance = SectionPlan("Provenance", (), (provenance_table(experiment.provenance),))
    return Page(
        title="Flutter",
        subtitle=f"{experiment.problem.name} · sloshlab {__version__}",
        flags=experiment.flags,
        summary=stability_sentences(experiment),
        plans=(*sections, provenance),
        papers=PAPERS,
    )


def _plan(name: str, draw: Any, **more: Any) -> FigurePlan:
    return FigurePlan(name, partial(draw, **more))


def stability_sections(experiment: FlutterExperiment) -> list[SectionPlan]:
    """Sections on the stability of each model, and of several together first.

    Parameters
    ----------
    experiment : FlutterExperiment
    """
    several = len(experiment.results) > 1
    sections = []
    for result in experiment.results:
        ending = f"_{result.name}" if several else ""
        sections.append(
            SectionPlan(
                f"Stability, {result.name}" if several else "Stability",
                (
                    _plan(f"root_locus{ending}", figures.root_locus, result=result),
                    _plan(f"damping_and_frequency{ending}", figures.damping_and_frequency, result=result),
                ),
                (_crossing_table(result),),
            )
        )
    if several:
        compared = _plan("models", figures.models_compared, results=experiment.results)
        sections.insert(0, SectionPlan("Frozen and sloshing", (compared,), (_model_table(experiment),)))
    return sections


def model_sections(experiment: FlutterExperiment) -> list[SectionPlan]:
    """Sections on modes without flow, forces of the air, and checks of the model.

    Parameters
    ----------
    experiment : FlutterExperiment
    """
    shapes = _plan("mode_shapes", mode_figures.mode_shapes, shapes=experiment.problem.shapes)
    forces = _plan("fit_of_forces", figures.fit_of_forces, problem=experiment.problem)
    return [
        SectionPlan("Modes without flow", (shapes,)),
        SectionPlan("Forces of the air", (forces,), (_fit_table(experiment.problem),)),
        *([SectionPlan("Checks", (), (_check_table(experiment),))] if experiment.checks else []),
    ]


def stability_sentences(experiment: FlutterExperiment) -> tuple[str, ...]:
    """What grows from where on, model by model, and what sideways sloshing changes.

    Parameters
    ----------
    experiment : FlutterExperiment
    """
    first, last = experiment.settings.first_m_per_s, experiment.settings.last_m_per_s
    several = len(experiment.results) > 1
    found = []
    for result in experiment.results:
        before = f"{result.name}: " if several else ""
        lines = [
            f"{before}{crossing.kind} at {crossing.speed_m_per_s:.2f} m/s"
            + (f", {crossing.frequency_rad_per_s:.2f} rad/s" if crossing.frequency_rad_per_s else "")
            + f", from {crossing.origin}"
            for crossing in result.locus.crossings
            if crossing.kind != "flight"
        ]
        found += lines or [f"{before}no root grows from {first:g} to {last:g} m/s"]
    return (*found, *_difference(experiment))


def _difference(experiment: FlutterExperiment) -> tuple[str, ...]:
    """What sloshing does to the first flutter."""
    flutter = {result.name: result.locus.flutter for result in experiment.results}
    frozen, lateral = flutter.get("frozen"), flutter.get("lateral")
    if frozen is None or lateral is None:
        return ()
    speed = _percent(lateral.speed_m_per_s, frozen.speed_m_per_s)
    frequency = _percent(lateral.frequency_rad_per_s, frozen.frequency_rad_per_s)
    return (f"sideways sloshing changes the first flutter by {speed} in speed and {frequency} in frequency",)


def _percent(value: float, reference: float) -> str:
    return f"{100 * (value / reference - 1):+.2f} %".replace("-", "−")


def _model_table(experiment: FlutterExperiment) -> Table:
    rows = []
    for result in experiment.results:
        flutter = result.locus.flutter
        speed, frequency = (
            (float("nan"),) * 2 if flutter is None else (flutter.speed_m_per_s, flutter.frequency_rad_per_s)
        )
        rows.append((result.name, text(speed, 5), text(frequency, 5), text(result.p_k_flutter_m_per_s, 5)))
    return Table(
        "First flutter",
        ("liquids", "speed [m/s]", "frequency [rad/s]", "speed by p-k [m/s]"),
        tuple(rows),
        "Frozen liquids have the inertia of solids; lateral ones slosh sideways as equivalent masses. p-k is in "
        "inertial axes, without weight.",
    )


def _crossing_table(result: Stability) -> Table:
    rows = tuple(
        (
            crossing.kind,
            crossing.origin,
            f"{crossing.speed_m_per_s:.3f}",
            text(crossing.frequency_rad_per_s, 5),
            text(crossing.frequency_rad_per_s * result.semi_chord_m / crossing.speed_m_per_s, 3),
        )
        for crossing in result.locus.crossings
    )
    note = (
        "By bisection of the root locus to 1 mm/s. First flutter by p-k, between computed speeds: "
        f"{text(result.p_k_flutter_m_per_s, 6)} m/s."
    )
    if any(crossing.kind == "flight" for crossing in result.locus.crossings):
        note += " Flight: the body moves as a whole, as in a phugoid or spiral; without drag that is not decided."
    return Table(
        "Where a root begins to grow",
        ("kind", "branch", "speed [m/s]", "frequency [rad/s]", "reduced frequency"),
        rows,
        note,
    )


def _check_table(experiment: FlutterExperiment) -> Table:
    rows = tuple(
        (check.what, f"≤ {check.largest:.0e}", f"{check.reached:.1e}", "reached" if check.is_met else "missed")
        for check in experiment.checks
    )
    return Table(
        "Checks of this model",
        ("difference that should be none", "asked", "reached", ""),
        rows,
        "Relative differences; poles at the middle of the speeds, without weight, those that oscillate.",
    )


def _fit_table(problem: FlutterProblem) -> Table:
    quality = problem.rational.quality
    rms, largest = (quality.rms, float(quality.largest.max())) if quality else (float("nan"), float("nan"))
    chosen = problem.fit
    rows = (
        ("method", problem.method),
        ("table", problem.cache.value if problem.cache else "computed"),
        ("rational functions", chosen.rational.replace("_", " ")),
        ("lag states", str(problem.rational.lags.size)),
        ("error of all entries, RMS", f"{100 * rms:.3f} %"),
        ("largest error of an entry over its largest value", f"{100 * largest:.2f} %"),
        (
            "reduced frequencies",
            f"{problem.reduced_frequency.size}, up to {problem.reduced_frequency[-1]:g}",
        ),
    )
    return Table("Generalised forces", ("", ""), rows)
