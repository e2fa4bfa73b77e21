"""Which figures and tables the report of a model has, in which order, and its result in sentences."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from pipelines.liquid_model import (
    figures_domain,
    figures_maps,
    figures_signals,
    figures_training,
    tables,
    touchable_runs,
)
from pipelines.liquid_model.results import ValidatedModel
from pipelines.report.citations import SCIPY, SOURCE, XARRAY, Citation
from pipelines.report.figure import ReportFigure
from pipelines.report.page import Page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import consistency_tables, provenance_table
from sloshlab import __version__

PAPERS: Final = (
    Citation(
        "reduced-order model by neural networks (2.22–2.35, B.7, C)",
        "M. Pizzoli, F. Saltari, F. Mastroddi, J. Martínez-Carrascal, L. González-Gutiérrez: Nonlinear "
        "reduced-order "
        "model for vertical sloshing by employing neural networks. Nonlinear Dynamics (2021).",
    ),
    Citation(
        "least squares",
        "D. W. Marquardt: An algorithm for least-squares estimation of nonlinear parameters. Journal of "
        "the Society "
        "for Industrial and Applied Mathematics 11, 431–441 (1963).",
        "10.1137/0111030",
    ),
    Citation(
        "output weights solved for (variable projection)",
        "G. H. Golub, V. Pereyra: The differentiation of pseudo-inverses and nonlinear least squares "
        "problems whose "
        "variables separate. SIAM Journal on Numerical Analysis 10, 413–432 (1973).",
        "10.1137/0710036",
    ),
    Citation(
        "tests of the residual",
        "S. A. Billings, W. S. F. Voon: Correlation based model validity tests for non-linear models. "
        "International "
        "Journal of Control 44, 235–244 (1986).",
        "10.1080/00207178608933593",
    ),
    SOURCE,
    SCIPY,
    XARRAY,
)


def page_of(validated: ValidatedModel) -> Page:
    """The page of the report."""
    return Page(
        title="Reduced-order model of the liquid",
        subtitle=f"{validated.rig_name} · {len(validated.judged)} runs not trained on · sloshlab {__version__}",
        flags=validated.flags,
        summary=sentences(validated),
        plans=planned_sections(validated),
        papers=PAPERS,
    )


def planned_sections(validated: ValidatedModel) -> tuple[SectionPlan, ...]:
    """The sections; a part without data says why."""

    def plans(**figures: partial[ReportFigure]) -> tuple[FigurePlan, ...]:
        return tuple(FigurePlan(name, partial(draw, validated=validated)) for name, draw in figures.items())

    maps = {
        "w_bar_map": ("w_bar", "Fig. 2.29"),
        "beta_map": ("beta", "like Fig. 2.43(b)"),
        "w_bar_over_v_bar": ("w_bar_over_v_bar", "Fig. 2.43(a)"),
        "beta_over_v_bar": ("beta_over_v_bar", "Fig. 2.43(b)"),
    }
    of_maps = plans(
        **{
            name: partial(figures_maps.compared_maps, quantity=quantity, counterpart=counterpart)
            for name, (quantity, counterpart) in maps.items()
        },
        windows_compared=partial(touchable_runs.windows_compared),
    )
    return (
        SectionPlan(
            "Time histories",
            plans(
                whole_run=partial(touchable_runs.whole_run),
                time_histories=partial(figures_signals.time_histories),
            ),
            (tables.fit_table(validated), tables.amplitude_table(validated)),
        ),
        SectionPlan("Ceiling", plans(ceiling=partial(touchable_runs.ceiling)), (tables.ceiling_table(validated),)),
        SectionPlan("Maps", of_maps, (tables.map_table(validated),)),
        SectionPlan(
            "Residual",
            plans(residual=partial(touchable_runs.correlations)),
            (tables.residual_table(validated),),
        ),
        SectionPlan(
            "Domain of validity",
            plans(domain=partial(figures_domain.domain)),
            (tables.excursion_table(validated),),
        ),
        SectionPlan(
            "Training",
            plans(training_curve=partial(figures_training.training_curve)),
            (tables.model_table(validated),),
        ),
        SectionPlan("Recordings", (), consistency_tables(validated.examinations)),
        SectionPlan("Provenance", (), (provenance_table(validated.provenance),)),
    )


def sentences(validated: ValidatedModel) -> tuple[str, ...]:
    """What a reader should take away."""
    found = [*_fit_sentences(validated), *_map_sentences(validated)]
    for run, tests in validated.tests.items():
        failed = [test for test in tests if not test.is_passed]
        words = "; ".join(test.verdict for test in failed) or "white, and nothing in common with the input"
        found.append(f"Residual on {run}: {words}.")
    n_outside = sum(bool(run.excursions) for run in validated.judged)
    if n_outside:
        found.append(f"{n_outside} of {len(validated.judged)} runs leave what the training covered.")
    return tuple(found)


def _fit_sentences(validated: ValidatedModel) -> list[str]:
    found = [
        f"On {run.name}, which it was not trained on, the free run fits {run.fit().fit_percent:.1f} % (as "
        "printed in "
        f"the source {run.fit().fit_percent_as_printed:.1f} %), RMS error {run.fit().rms_error:.3g} N."
        for run in validated.of_role("validation")
    ]
    if validated.ceiling:
        repeat, ideal, model = (
            float(np.mean(values))
            for values in (
                [pair.repeats.fit().fit_percent for pair in validated.ceiling],
                [pair.repeats.fit_of_ideal_model().fit_percent for pair in validated.ceiling],
                [pair.model.fit_percent for pair in validated.ceiling],
            )
        )
        found.append(
            f"On the repeats, one run in place of another fits {repeat:.1f} % and an ideal model of the "
            "motion would "
            f"fit {ideal:.1f} %; this one fits {model:.1f} %."
        )
    return found


def _map_sentences(validated: ValidatedModel) -> list[str]:
    if validated.maps is None:
        return []
    work, beta = validated.maps.errors["w_bar"], validated.maps.errors["beta"]
    verdict = "within" if work.relative_rms <= tables.WANTED_MAP_ERROR else "beyond"
    return [
        f"The map of W̄ errs by {work.rms:.3f} RMS, {100 * work.relative_rms:.1f} % of the largest value measured, "
        f"{verdict} the {100 * tables.WANTED_MAP_ERROR:g} % aimed at; that of β by {beta.rms:.3f}, "
        f"{100 * beta.relative_rms:.1f} %."
    ]
