"""The report of a sensitivity study (Fig. 2.26): errors over neurons and delays, the pick, and why."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pipelines.liquid_model.sections import PAPERS
from pipelines.liquid_model.study_cases import CaseResult, Pick
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import text
from pipelines.report.page import Page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    REFERENCE_COLOUR,
    new_figure,
    ordered_colours,
    png_bytes,
)
from pipelines.report.tables import Table, provenance_table
from sloshlab import __version__
from sloshlab.reduced_order_model.early_stop import EPOCHS_PER_RISE
from sloshlab.reduced_order_model.training import TrainingSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_LARGEST_SHOWN: Final = 1.15
"""Over the smallest error; what is larger lies beyond the axis."""


@dataclass(frozen=True)
class StudiedModels:
    """What the report of a study is made of.

    Attributes
    ----------
    results : tuple of CaseResult
        The best first.
    pick : Pick
    settings : TrainingSettings
    rate_reason : str
    flags : tuple of str
    provenance : dict
    """

    results: tuple[CaseResult, ...]
    pick: Pick
    settings: TrainingSettings
    rate_reason: str
    flags: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def trained(self) -> list[CaseResult]:
        """Results with a model."""
        return [result for result in self.results if result.is_trained]


def page_of(found: StudiedModels) -> Page:
    """The page of the report."""
    n_failed = len(found.results) - len(found.trained)
    failed = f" {n_failed} could not be trained." if n_failed else ""
    seconds = sum(result.seconds for result in found.results)
    summary = (
        f"Picked: {found.pick.reason}.",
        f"{len(found.results)} models were trained in {seconds / 60:.0f} minutes of computation.{failed}",
    )
    figures = (FigurePlan("sensitivity", partial(sensitivity, found=found)),)
    return Page(
        title="Sensitivity study of reduced-order models",
        subtitle=f"{len(found.results)} models · sloshlab {__version__}",
        flags=found.flags,
        summary=summary,
        plans=(
            SectionPlan("Errors", figures, (case_table(found),)),
            SectionPlan("Provenance", (), (provenance_table(found.provenance),)),
        ),
        papers=PAPERS,
    )


def sensitivity(name: str, found: StudiedModels) -> ReportFigure:
    """Mean square error over neurons, as in the source, and validation error over parameters."""
    if not found.trained:
        raise NothingToDrawError("no case could be trained")
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    _as_in_the_source(left, found)
    _over_parameters(right, found)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    caption = (
        "Left, as in the source: mean of the mean square errors on training and validation runs over the "
        "number of "
        "neurons. Right: RMS error of a free run on the validation runs over the number of parameters; "
        "the circle is "
        f"the pick. Errors more than {100 * (_LARGEST_SHOWN - 1):.0f} % behind it are beyond the axis. Picked: "
        f"{found.pick.reason}."
    )
    return ReportFigure(name, caption, "Fig. 2.26", png_bytes(figure))


def _families(found: StudiedModels) -> dict[str, list[CaseResult]]:
    """Cases that differ in neurons only, those with many first."""
    families: dict[str, list[CaseResult]] = {}
    for result in sorted(
        found.trained, key=lambda result: (result.case.structure, result.case.delays, result.case.neurons)
    ):
        case = result.case
        kind = "" if case.network == "normalised_rbf" else f" {case.network}"
        delays = f"{case.delays}+{case.output_delays}" if case.output_delays else f"{case.delays}"
        families.setdefault(f"{case.structure.upper()}{kind}, {delays} delays", []).append(result)
    return families


def _looks(found: StudiedModels) -> dict[str, tuple[Any, str]]:
    """Colour and marker of every family; NFIR of the source in order of their delays."""
    families = _families(found)
    lines = [name for name, own in families.items() if len(own) > 1]
    singles = [name for name in families if name not in lines]
    looks: dict[str, tuple[Any, str]] = {
        name: (colour, "o") for name, colour in zip(lines, ordered_colours(len(lines)), strict=False)
    }
    for number, name in enumerate(singles):
        looks[name] = (
            DISTINCT_COLOURS[number % len(DISTINCT_COLOURS)],
            DISTINCT_MARKERS[1 + number % (len(DISTINCT_MARKERS) - 1)],
        )
    return looks


def _as_in_the_source(axes: Axes, found: StudiedModels) -> None:
    looks = _looks(found)
    for name, own in _families(found).items():
        colour, marker = looks[name]
        neurons = [result.case.neurons for result in own]
        axes.plot(neurons, [result.mean_mse for result in own], color=colour, marker=marker, label=name)
    axes.set(xlabel="neurons", ylabel="mean square error [N²]")


def _over_parameters(axes: Axes, found: StudiedModels) -> None:
    looks = _looks(found)
    for name, own in _families(found).items():
        colour, marker = looks[name]
        parameters = [result.n_parameters for result in own]
        errors = [result.validation_mse**0.5 for result in own]
        axes.plot(parameters, errors, color=colour, marker=marker)
    best = found.pick.best
    ring: dict[str, Any] = {"mfc": "none", "mec": REFERENCE_COLOUR, "ms": 11, "mew": 1.6, "zorder": 5}
    axes.plot(best.n_parameters, best.validation_mse**0.5, "o", **ring)
    low_n, high_n = axes.get_ylim()
    axes.set_ylim(low_n, min(high_n, _LARGEST_SHOWN * best.validation_mse**0.5))
    axes.set(xlabel="parameters", ylabel="RMS error, validation [N]", xscale="log")
    sizes = np.array([result.n_parameters for result in found.trained])
    low, high = sizes.min() / 2, 2 * sizes.max()
    ticks = [tick for tick in (10, 30, 100, 300, 1000, 3000, 10000) if low < tick < high]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()


def case_table(found: StudiedModels) -> Table:
    """All cases, the best first."""
    smallest = found.pick.best.validation_mse**0.5
    rows = []
    for result in found.results:
        error = math.sqrt(result.validation_mse)
        behind = f"{100 * (error / smallest - 1):+.1f}".replace("-", "−") if math.isfinite(error) else "–"
        rows.append(
            (
                result.case.name,
                text(error, 4),
                behind,
                text(math.sqrt(result.training_mse), 4),
                text(result.mean_mse, 4),
                str(result.n_parameters),
                str(result.n_epochs),
                text(result.seconds, 2),
                result.ended,
            )
        )
    return Table(
        "Cases",
        ("case", "validation, RMS [N]", "behind the best [%]", "training, RMS [N]", "mean of both, MSE [N²]",
         "parameters", "epochs", "time [s]", "ended"),
        tuple(rows),
        f"Structure, delays of the velocity (+ of the force), neurons. {found.rate_reason}. At most "
        f"{found.settings.n_epochs} epochs; training stops after {found.settings.patience} rises of the "
        f"validation error, or when {EPOCHS_PER_RISE * found.settings.patience} epochs lower its mean square by "
        f"less than {100 * found.settings.least_gain:g} %; "
        f"{found.settings.n_starts} start, seed {found.settings.seed}. NOE errors are those of free runs.",
    )  # fmt: skip
