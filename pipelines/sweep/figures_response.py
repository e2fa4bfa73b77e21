"""Response of a structure without a tank: amplitude and phase of ü/F, resonance per level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import legend_columns, new_figure, ordered_colours, plain, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.sweep.results import RunResult

FloatArray = npt.NDArray[np.float64]

_ZOOM = 0.09
_NEIGHBOURHOOD = 0.1
"""Part of the frequency around the largest acceleration that is taken for the same mode."""


@dataclass(frozen=True)
class Response:
    """Frequency response of one run from its windows.

    Attributes
    ----------
    label : str
        The run.
    frequency_hz, acceleration_g : ndarray, shape (n,)
        Of the windows, in order of time.
    accelerance_per_kg : ndarray of complex, shape (n,)
        ü/F at the excitation frequency [m s-2 N-1 = kg-1].
    work_j : ndarray, shape (n,)
        Dissipated work per cycle.
    loudest_hz, loudest_g : float
        Where the acceleration is largest, and that value.
    peak_hz, peak_per_kg : float
        Where |ü/F| is largest in the neighbourhood of the largest acceleration, and that value.
    work_peak_hz, work_peak_j : float
        Where the work is largest in the same neighbourhood, and that value.
    """

    label: str
    frequency_hz: FloatArray
    acceleration_g: FloatArray
    accelerance_per_kg: npt.NDArray[np.complex128]
    work_j: FloatArray
    loudest_hz: float
    loudest_g: float
    peak_hz: float
    peak_per_kg: float
    work_peak_hz: float
    work_peak_j: float


def responses(runs: Sequence[RunResult]) -> tuple[Response, ...]:
    """Compute ü/F = 1/(m − jγ/Ω) of every run: F = m ü + γ u̇ and u̇ = ü/(jΩ)."""
    found = []
    for run in runs:
        windows = run.windows.sortby("time_s")
        frequency = windows["frequency_hz"].values
        apparent = windows["apparent_mass_kg"].values - 1j * windows["gamma_kg_per_s"].values / (
            2 * np.pi * frequency
        )
        usable = np.isfinite(apparent) & (np.abs(apparent) > 0)
        if not usable.any():
            continue
        label = plain(run.attributes.run_id, 28)
        found.append(_response(label, windows.isel(window=usable), 1 / apparent[usable]))
    if not found:
        raise NothingToDrawError("no run has a window")
    return tuple(found)


def _response(label: str, windows: xr.Dataset, accelerance_per_kg: npt.NDArray[np.complex128]) -> Response:
    frequency, acceleration, work = (windows[name].values for name in ("frequency_hz", "acceleration_g", "work_j"))
    loudest, level = vertex(frequency, acceleration)
    near = np.abs(np.log(frequency / loudest)) < _NEIGHBOURHOOD
    peaks = [vertex(frequency, np.where(near, values, -np.inf)) for values in (np.abs(accelerance_per_kg), work)]
    return Response(label, frequency, acceleration, accelerance_per_kg, work, loudest, level, *peaks[0], *peaks[1])


def vertex(abscissa: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Place and height of the largest value, by the parabola through it and its two neighbours.

    Examples
    --------
    >>> x = np.array([0.0, 1.0, 2.0, 3.0])
    >>> [round(float(part), 6) for part in vertex(x, 5 - (x - 1.3) ** 2)]
    [1.3, 5.0]
    """
    at = int(np.nanargmax(values))
    if not 0 < at < values.size - 1:
        return float(abscissa[at]), float(values[at])
    x, y = abscissa[at - 1 : at + 2], values[at - 1 : at + 2]
    if not (np.isfinite(y).all() and (x[1] - x[0]) * (x[2] - x[1]) > 0):
        return float(abscissa[at]), float(values[at])
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if curvature >= 0:
        return float(x[1]), float(y[1])
    place = float(np.clip(0.5 * (x[0] + x[1]) - left / (2 * curvature), x.min(), x.max()))
    height = y[0] + left * (place - x[0]) + curvature * (place - x[0]) * (place - x[1])
    return place, float(height)


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
        label = f"{response.label}: {response.loudest_hz:.2f} Hz, {response.work_peak_hz:.2f} Hz"
        style: dict[str, Any] = {"color": colour, "marker": ".", "ms": 2.5, "lw": 1.0}
        mark: dict[str, Any] = {"color": colour, "marker": "v", "ms": 7, "mec": "white", "mew": 0.6, "ls": "none"}
        upper.plot(response.frequency_hz, response.acceleration_g / response.loudest_g, label=label, **style)
        lower.plot(response.frequency_hz, response.work_j / abs(response.work_peak_j), **style)
        upper.plot(response.loudest_hz, 1.0, **mark)
        lower.plot(response.work_peak_hz, np.sign(response.work_peak_j), **mark)
    centres = [centre for response in found for centre in (response.loudest_hz, response.work_peak_hz)]
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
