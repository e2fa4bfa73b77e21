"""The report on a ball: which figures and tables, in which order."""

from __future__ import annotations

from functools import partial

from pipelines.ball import figures_decay, figures_line, figures_map, tables, touchable_decays, touchable_lines
from pipelines.ball.results import BallExperiment, DecayResult, LineResult
from pipelines.report.citations import Citation, citation
from pipelines.report.numbers import text
from pipelines.report.page import Page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import Table, provenance_table
from sloshlab import __version__
from sloshlab.bouncing_ball.frequency_error import summary

BALL = Citation(
    "bouncing ball (2.1–2.21)",
    "M. Pizzoli, F. Saltari, F. Mastroddi, J. Martínez-Carrascal, L. González-Gutiérrez: Nonlinear reduced-order "
    "model for vertical sloshing by employing neural networks. Nonlinear Dynamics (2021).",
)
_EVOLUTION = Citation(
    "global search",
    "R. Storn, K. Price: Differential evolution – a simple and efficient heuristic for global optimization over "
    "continuous spaces. Journal of Global Optimization 11, 341–359 (1997).",
    "10.1023/A:1008202821328",
)


def page_of(experiment: BallExperiment) -> Page:
    """The page of the report."""
    result = experiment.result
    plans = (
        _decay_plans(experiment, result) if isinstance(result, DecayResult) else _line_plans(experiment, result)
    )
    about_ball: tuple[Table, ...] = (tables.ball_parameter_table(experiment), tables.search_table(experiment))
    if isinstance(result, DecayResult) and result.frozen is not None:
        about_ball = (*about_ball, tables.guide_table(result.frozen))
    found = SectionPlan("The ball", (), about_ball)
    provenance = SectionPlan("Provenance", (), (provenance_table(experiment.provenance),))
    return Page(
        title="Bouncing ball",
        subtitle=f"{experiment.rig_name} · sloshlab {__version__}",
        flags=experiment.flags,
        summary=_sentences(experiment),
        plans=(found, *plans, provenance),
        papers=(BALL, _EVOLUTION, *citation("work")),
    )


def _decay_plans(experiment: BallExperiment, result: DecayResult) -> tuple[SectionPlan, ...]:
    decay = {
        "decay": touchable_decays.motion,
        "sloshing_force": figures_decay.sloshing_force,
        "damping_shares": touchable_decays.damping,
        "loss_factors": figures_decay.loss_factors,
    }
    if result.frozen is not None:
        decay["guide"] = figures_decay.guide
    steady = {"hysteresis": figures_map.hysteresis, "maps": figures_map.maps, "lines": figures_map.lines}
    return tuple(
        SectionPlan(
            title,
            tuple(
                FigurePlan(name, partial(draw, experiment=experiment, result=result))
                for name, draw in them.items()
            ),
        )
        for title, them in (("Free decay", decay), ("Steady harmonic motion", steady))
    )


def _line_plans(experiment: BallExperiment, result: LineResult) -> tuple[SectionPlan, ...]:
    tuned = {"tuned_line": touchable_lines.tuned_line}
    away = {
        "map_of_ball": figures_line.map_of_ball,
        "other_frequencies": figures_line.other_frequencies,
        "errors": figures_line.errors,
    }
    plans = [
        tuple(FigurePlan(name, partial(draw, experiment=experiment, result=result)) for name, draw in them.items())
        for them in (tuned, away)
    ]
    return (
        SectionPlan("At the tuned frequency", plans[0]),
        SectionPlan("Away from it", plans[1], (tables.band_table(result),)),
    )


def _sentences(experiment: BallExperiment) -> tuple[str, ...]:
    found, result = experiment.identified, experiment.result
    known = sum(interval.is_determined for interval in found.intervals)
    lines = [f"Five parameters were fitted to {found.residuals.size} values; the data hold {known} of them."]
    if isinstance(result, LineResult):
        tuned, others = summary(result.bands)
        lines.append(
            f"At ω̄ = {experiment.omega_bar:g} the ball misses W̄ by {100 * tuned:.0f} % of its RMS, "
            f"elsewhere by "
            f"{100 * others:.0f} %: a ball tuned at one frequency holds there only."
        )
        return tuple(lines)
    ratio = result.simulated.at(result.measured.acceleration_m_per_s2) / result.measured.damping_ratio - 1
    lines.append(
        f"ζ(a) of the ball differs from the measured one by {text(float(found.rms), 2)} % of critical "
        f"damping (RMS), "
        f"{100 * float((ratio**2).mean() ** 0.5):.0f} % of its value."
    )
    return tuple(lines)
