"""A ball from runs on the shaker: by W̄ at one frequency, and what it dissipates elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.ball.results import BallExperiment, LineResult
from pipelines.ball.settings import BallSettings
from pipelines.report.progress import amounts
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.frequency_error import error_by_frequency
from sloshlab.bouncing_ball.from_work_line import WorkLine, identify_from_line, line_of, work_line
from sloshlab.bouncing_ball.harmonic_response import w_bar_at
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

_N_OTHER_LINES = 4


def ball_from_shaker(paths: Sequence[Path], rig: Rig, rig_path: Path, settings: BallSettings) -> BallExperiment:
    """The ball that dissipates the measured W̄ at one frequency, and how wrong it is elsewhere.

    Raises
    ------
    InputError
        If a run is bad, or the map does not reach the frequency.
    """
    sweeps = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=True)
    experiment = analyse_shaker(paths, [rig_path], sweeps)
    maps = experiment.maps
    line = work_line(maps, settings.omega_bar)
    with amounts("search of the ball") as advance:
        found = identify_from_line(
            line, rig, damping_in_flight=settings.damping_in_flight, settings=settings.search, progress=advance
        )
    result = _compared(found.ball, rig, line, maps=maps, windows=experiment.windows, settings=settings)
    flags = (*found.flags, *_outside_flags(result), *experiment.flags)
    return BallExperiment(rig, rig_path.name, experiment.inputs, found, line.omega_bar, result, settings, flags)


def _outside_flags(result: LineResult) -> tuple[str, ...]:
    """Windows at which the ball leaves its tank."""
    n = sum(band.n_outside for band in result.bands)
    if not n:
        return ()
    return (
        f"bouncing ball: leaves its tank in {n} of {result.w_bar_of_ball.size} windows, which are not compared",
    )


def _compared(
    ball: BouncingBall,
    rig: Rig,
    line: WorkLine,
    *,
    maps: xr.Dataset,
    windows: xr.Dataset,
    settings: BallSettings,
) -> LineResult:
    step = -(-windows.sizes["window"] // settings.n_windows)
    used = windows.isel(window=slice(None, None, step))
    with amounts("windows of the ball") as advance:
        bands, w_bar = error_by_frequency(
            ball, rig, omega_bar=used["omega_bar"].values, u_bar=used["u_bar"].values,
            w_bar=used["w_bar"].values, tuned_omega_bar=line.omega_bar, progress=advance,
        )  # fmt: skip
    return LineResult(
        line=line,
        line_of_ball=line_of(ball, rig, line),
        steady_w_bar=w_bar_at(ball, rig, np.full(line.u_bar.shape, line.omega_bar), line.u_bar),
        maps=maps,
        map_of_ball=_map_of_ball(ball, rig, maps, settings.n_map),
        windows=used,
        w_bar_of_ball=w_bar,
        bands=bands,
        other_lines=_other_lines(ball, rig, maps, line.omega_bar),
    )


def _map_of_ball(ball: BouncingBall, rig: Rig, maps: xr.Dataset, n_map: int) -> xr.DataArray:
    """W̄ on a coarser grid, where the measured map has values."""
    omega_bar = np.linspace(float(maps["omega_bar"].min()), float(maps["omega_bar"].max()), n_map)
    u_bar = np.linspace(float(maps["u_bar"].max()) / n_map, float(maps["u_bar"].max()), n_map)
    measured = maps["w_bar"].interp(omega_bar=omega_bar, u_bar=u_bar).transpose("omega_bar", "u_bar")
    rows, columns = np.nonzero(np.isfinite(measured.values))
    values = np.full(measured.shape, np.nan)
    with amounts("map of the ball") as advance:
        values[rows, columns] = w_bar_at(ball, rig, omega_bar[rows], u_bar[columns], progress=advance)
    return measured.copy(data=values)


def _other_lines(
    ball: BouncingBall, rig: Rig, maps: xr.Dataset, omega_bar: float
) -> tuple[tuple[WorkLine, FloatArray], ...]:
    """Lines at frequencies spread over the map, the one nearest the tuned frequency left out."""
    low, high = float(maps["omega_bar"].min()), float(maps["omega_bar"].max())
    wanted = np.linspace(low, high, _N_OTHER_LINES + 3)[1:-1]
    wanted = np.sort(wanted[np.argsort(np.abs(wanted - omega_bar))[1:]])
    lines = []
    for omega_bar_of_line in wanted[:_N_OTHER_LINES]:
        try:
            line = work_line(maps, float(omega_bar_of_line), 15)
        except AnalysisError:
            continue
        lines.append((line, w_bar_at(ball, rig, np.full(line.u_bar.shape, line.omega_bar), line.u_bar)))
    return tuple(lines)
