"""A small page with every kind of figure that can be touched; names in it are as hostile as file names may be."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.contents import (
    Channel,
    Histories,
    Line,
    Quantity,
    Run,
    Touchable,
    Window,
    WindowMap,
)
from pipelines.report.interactive.curves import Chart, Charts, Curve
from pipelines.report.interactive.misfit_map import MisfitMap, MissedChannel, MissedRun
from pipelines.report.page import Page, write_page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.style import new_figure, png_bytes

HOSTILE = "</script><script>document.title='taken'</script><!--\u2028'\"&"
RATE_HZ, FREQUENCY_HZ = 500.0, 4.0


def channel(name: str, amplitude: float) -> Channel:
    time = np.arange(1000) / RATE_HZ
    shape = np.sin(2 * np.pi * FREQUENCY_HZ * time)
    frequency = np.linspace(1.0, 20.0, 50)
    lines = (
        Line("recorded", "recorded", amplitude * shape),
        Line("as believed", "believed", 1.5 * amplitude * shape, begins_hidden=True),
        Line("before", "before", 1.25 * amplitude * shape),
        Line("after", "after", amplitude * shape + 0.01),
    )
    spectra = tuple(Line(line.label, line.role, 1 / (1 + (frequency - 4.0) ** 2)) for line in lines)
    return Channel(name, "mm", time, lines, "recorded", frequency, spectra, "density [mm²/Hz]", (0.5, 1.0))


def histories() -> Histories:
    lost = tuple(
        Line(label, "before", np.array([value])) for label, value in (("recorded", np.nan), ("x", np.inf))
    )
    runs = (
        Run("run_2", "held out", (channel("displacement", 3.0), channel("acceleration", 40.0))),
        Run(HOSTILE, "held out", (channel("displacement", 5.0),)),
        Run("run_1", "fitted", (channel("displacement", 7.0),)),
        Run("lost", "fitted", (Channel("displacement", "mm", np.zeros(1), lost, "recorded"),)),
    )
    return Histories("Recorded and simulated", runs, "Everything that was recorded.")


def window_map() -> WindowMap:
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.1, 0.9, 5), np.linspace(1.0, 3.0, 4)))
    windows = []
    for at in range(x.size):
        time = np.arange(600) / 600.0
        angle = 2 * np.pi * 12.0 * time
        force = (1.0 + at) * np.sin(angle - 0.3)
        order = np.arange(1, 60) / 12.0
        amplitude = np.where(np.isclose(order, 1.0), 1.0 + at, 1e-4)
        windows.append(Window(HOSTILE, f"12 Hz, {at} g", time, force, np.sin(angle), order, amplitude))
    colours = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
    image = np.arange(20.0).reshape(4, 5)
    image[3, 4] = np.nan
    quantities = (Quantity("W̄", x * y, image, colours, 0.0, 3.0), Quantity("β", -x, None, colours, -1.0, 0.0))
    extent, others = (0.0, 1.0, 0.8, 3.2), (x[:2] + 0.05, y[:2])
    return WindowMap(
        "Work", "Points.", "ū", "ω̄", x, y, *others, extent, quantities, tuple(windows), "F", "u", "|F|", first=3
    )  # fmt: skip


def charts() -> Charts:
    """ζ of two runs, the second three times as large: points at 1, 2, 3 g on a straight line."""
    found = []
    for name, factor in (("run_2", 1.0), (HOSTILE, 3.0)):
        at = np.array([1.0, 2.0, 3.0])
        curves = (
            Curve("measured", "before", at, factor * at, is_points=True),
            Curve("fitted", "after", np.array([0.0, np.nan, 4.0]), factor * np.array([0.0, np.nan, 4.0])),
        )
        found.append(Chart(name, "decays", "a [g]", f"ζ [%], {factor:g}", curves))
    return Charts("Damping", "Run", tuple(found), "Curves.")


def misfit_map() -> MisfitMap:
    """Four blocks of half a second and three bands; what is missed grows with time, and tenfold less after."""
    time, frequency = np.array([0.25, 0.75, 1.25, 1.75]), np.array([0.5, 1.5, 2.5])
    misfit = np.outer([1.0, 2.0, 8.0, 4.0], [10.0, 1.0, 0.0])
    runs = [
        MissedRun(
            name,
            group,
            tuple(MissedChannel(channel, time, frequency, (misfit, 0.1 * misfit)) for channel in names),
        )
        for name, group, names in (
            ("run_2", "held out", ("displacement", "acceleration")),
            (HOSTILE, "held out", ("displacement",)),
            ("elsewhere", "fitted", ("displacement",)),
        )
    ]
    colours = ("#440154", "#21918c", "#fde725")
    return MisfitMap("Misfit", "log", ("before", "after"), tuple(runs), colours, "histories", "Cells.")


def figure(name: str, touch: Touchable | None) -> ReportFigure:
    drawn = new_figure(1.5)
    drawn.subplots().plot([0, 1], [0, 1])
    return ReportFigure(name, f"An image. {HOSTILE}", "", png_bytes(drawn), touch)


def written_page(folder: Path, contents: dict[str, Touchable | None], title: str = HOSTILE) -> Path:
    plans = tuple(
        FigurePlan(name, lambda drawn, touch=touch: figure(drawn, touch))  # type: ignore[misc]
        for name, touch in contents.items()
    )
    page = Page(title, "subtitle", (), ("A sentence.",), (SectionPlan("Section", plans),), ())
    return write_page(page, folder)
