"""Tests of the residual: its correlation with its own past, the input, and powers of the input."""

from __future__ import annotations

from pipelines.liquid_model.results import ValidatedModel
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, REFERENCE_COLOUR, new_figure, plain, png_bytes


def correlations(name: str, validated: ValidatedModel) -> ReportFigure:
    """Four panels of the first validation run, with 95 % bands."""
    if not validated.tests:
        raise NothingToDrawError(validated.skipped.get("residual", "no validation run"))
    run, tests = next(iter(validated.tests.items()))
    rate = validated.model.sampling_rate_hz
    figure = new_figure(4.4)
    panels = figure.subplots(2, 2, sharex=True)
    for axes, test in zip(panels.flat, tests, strict=True):
        lag_ms = 1e3 * test.lags / rate
        axes.fill_between(lag_ms, -test.band, test.band, color=NEUTRAL_COLOUR, alpha=0.25, lw=0, label="95 % band")
        axes.plot(lag_ms, test.correlation, color=REFERENCE_COLOUR, lw=1.0, label="correlation")
        axes.axhline(0.0, color="#777777", lw=0.7)
        outside = f"{test.n_outside} of {test.lags.size} outside"
        axes.set_title(f"{'its own past' if test.against == 'residual' else test.against}: {outside}")
        axes.set_xlim(0, lag_ms[-1])
    for axes in panels[-1]:
        axes.set_xlabel("lag [ms]")
    for axes in panels[:, 0]:
        axes.set_ylabel("correlation")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        f"Correlation of the residual of {plain(run, 60)} with its own past and with the velocity, its square and "
        "its cube at earlier times. The bands hold 95 % if there is nothing in common; their width comes from the "
        "scatter between blocks of the run, so they hold for signals that are not white and change in size."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))
