"""Response of a structure without a tank: amplitude and phase of ü/F, resonance per level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import legend_columns, new_figure, ordered_colours, plain, png_bytes
from sloshlab.sweep.frequency_response import FrequencyResponse, frequency_response_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.sweep.results import RunResult

FloatArray = npt.NDArray[np.float64]

_ZOOM = 0.09


@dataclass(frozen=True)
class Response(FrequencyResponse):
    """Frequency response of one run.

    Attributes
    ----------
    label : str
        The run.
    """

    label: str


def responses(runs: Sequence[RunResult]) -> tuple[Response, ...]:
    """ü/F of every run that has a window in which the structure moves."""
    found = []
    for run in runs:
        response = frequency_response_of(run.windows)
        if response is not None:
            found.append(Response(**vars(response), label=plain(run.attributes.run_id, 28)))
    if not found:
        raise NothingToDrawError("no run has a window")
    return tuple(found)


def frequency_response(name: str, runs: Sequence[RunResult]) -> ReportFigure:
    """Amplitude and phase of ü/F, whole range and around the resonance, peaks marked."""
    found = responses(runs)
    figure = new_figure(5.0)
    grid = figure.subplots(2, 2, sharex="col", width_ratios=[1.15, 1.0])
    for colour, response in zip(ordered_colours(len(found)), found, strict=True):
        for column in (0, 1):
            draw_response(grid[:, column], response, colour, marked=column == 1)
    for axes in grid[0]:
        axes.set_yscale("log")
        plain_log_ticks(axes.yaxis)
    low, high = (function(response.peak_hz for response in found) for function in (min, max))
    grid[1, 1].set_xlim(low * (1 - _ZOOM), high * (1 + _ZOOM))
    # limits from what is inside the zoom only
    near = [np.abs(r.accelerance_per_kg)[_near(r, low, high)] for r in found]
    grid[0, 1].set_ylim(
        0.7 * min(float(part.min()) for part in near), 1.5 * max(float(part.max()) for part in near)
    )
    grid[0, 0].set_ylabel("|ü/F| [m s⁻²/N]")
    grid[1, 0].set_ylabel("phase of ü/F [°]")
    grid[0, 0].set_title("whole sweep")
    grid[0, 1].set_title("around the largest response")
    for axes in grid[1]:
        axes.set(xlabel="frequency Ω/2π [Hz]", ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=legend_columns(labels, 4))
    caption = (
        "Acceleration over force at the excitation frequency, from in-phase and quadrature force of every window: "
        "amplitude above, phase below, the neighbourhood of the largest response on the right. Vertical "
        "lines mark "
        "where |ü/F| of each run is largest; where they move with the level, the structure is not linear."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def _near(response: Response, low: float, high: float) -> npt.NDArray[np.bool_]:
    frequency = response.frequency_hz
    near = (frequency > low * (1 - _ZOOM)) & (frequency < high * (1 + _ZOOM))
    return near if near.any() else np.ones(frequency.size, dtype=bool)


def draw_response(panels: Sequence[Axes], response: Response, colour: object, *, marked: bool) -> None:
    """Draw amplitude and phase of one run in two panels."""
    upper, lower = panels
    style: dict[str, Any] = {"color": colour, "lw": 1.0, "marker": ".", "ms": 2.5}
    upper.plot(response.frequency_hz, np.abs(response.accelerance_per_kg), label=response.label, **style)
    lower.plot(response.frequency_hz, np.degrees(np.angle(response.accelerance_per_kg)), **style)
    if marked:
        for axes in (upper, lower):
            axes.axvline(response.peak_hz, color=colour, lw=0.9, ls="--")


def loudest_response(name: str, runs: Sequence[RunResult]) -> ReportFigure:
    """Acceleration and work over frequency around the largest acceleration, largest values marked."""
    found = responses(runs)
    figure = new_figure(5.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for colour, response in zip(ordered_colours(len(found)), found, strict=True):
        label = f"{response.label}: {response.strongest_hz:.2f} Hz, {response.work_peak_hz:.2f} Hz"
        style: dict[str, Any] = {"color": colour, "marker": ".", "ms": 2.5, "lw": 1.0}
        mark: dict[str, Any] = {"color": colour, "marker": "v", "ms": 7, "mec": "white", "mew": 0.6, "ls": "none"}
        upper.plot(response.frequency_hz, response.acceleration_g / response.strongest_g, label=label, **style)
        lower.plot(response.frequency_hz, response.work_j / abs(response.work_peak_j), **style)
        upper.plot(response.strongest_hz, 1.0, **mark)
        lower.plot(response.work_peak_hz, np.sign(response.work_peak_j), **mark)
    centres = [centre for response in found for centre in (response.strongest_hz, response.work_peak_hz)]
    lower.set_xlim(min(centres) * (1 - 2 * _ZOOM), max(centres) * (1 + 2 * _ZOOM))
    upper.set(ylabel="acceleration over its largest", ylim=(0, 1.12))
    lower.set(ylabel="work per cycle over its largest", ylim=(-0.25, 1.12), xlabel="frequency Ω/2π [Hz]")
    figure.legend(loc="outside upper center", ncols=2, title="run: largest acceleration, largest work at",
                  title_fontsize=8.5)  # fmt: skip
    caption = (
        "Acceleration amplitude and dissipated work per cycle around the largest acceleration, each over its "
        "largest value, which a triangle marks. If its frequency falls as the level rises, the mode softens. "
        "While a sweep passes a resonance, energy that was stored comes back: the work may be negative."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))
