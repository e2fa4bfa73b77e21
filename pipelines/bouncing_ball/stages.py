"""From recordings to a ball: free decays by ζ(a), sweeps by W̄ at one frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.bouncing_ball.results import BallExperiment, DecayResult, ForceTrace, LineResult
from pipelines.progress import amounts
from pipelines.shaker import ShakerSettings, analyse_shaker
from pipelines.sweep_stages import naming, require_usable
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import (
    DampingCurve,
    damping_shares,
    measured_curve,
    natural_frequency_hz,
    simulated_curve,
    simulated_decay,
    steady_loss_factor,
)
from sloshlab.bouncing_ball.frequency_error import error_by_frequency
from sloshlab.bouncing_ball.from_free_decay import identify_from_decay
from sloshlab.bouncing_ball.from_work_line import WorkLine, identify_from_line, line_of, work_line
from sloshlab.bouncing_ball.harmonic_response import hysteresis, response_map, w_bar_at
from sloshlab.bouncing_ball.identification import SearchSettings
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError, InputError
from sloshlab.recording import RunAttributes, channels, read_attributes, read_recording
from sloshlab.rig import Rig
from sloshlab.twin.twin import Simulation

FloatArray = npt.NDArray[np.float64]

MAP_AMPLITUDE_M = (0.0025, 0.1)
MAP_FREQUENCY_RAD_PER_S = (1.57, 62.83)
"""Ranges of the source's maps (2.1.2)."""
_N_OTHER_LINES = 4
_SAME_RELEASE = 0.05


@dataclass(frozen=True)
class BallSettings:
    """Choices of the identification.

    Attributes
    ----------
    omega_bar : float
        Frequency at which W̄ is matched, for runs on the shaker.
    damping_in_flight : float
        0: the damper acts in contact only; 1: always.
    lowest_acceleration_g : float
        Of a decay.
    search : SearchSettings
    n_map : int
        Grid lines of the maps of the ball, each way.
    n_windows : int
        Most windows that are compared.
    """

    omega_bar: float = 4.0
    damping_in_flight: float = 0.0
    lowest_acceleration_g: float = 0.3
    search: SearchSettings = field(default_factory=SearchSettings)
    n_map: int = 20
    n_windows: int = 250

    def __post_init__(self) -> None:
        if not (np.isfinite(self.omega_bar) and self.omega_bar > 0):
            raise InputError("--omega-bar", got=str(self.omega_bar), allowed="> 0")
        if not (np.isfinite(self.lowest_acceleration_g) and self.lowest_acceleration_g > 0):
            raise InputError("--lowest-acceleration-g", got=str(self.lowest_acceleration_g), allowed="> 0")
        if not 4 <= self.n_map <= 200:
            raise InputError("map of the ball", got=f"{self.n_map} grid lines", allowed="4 … 200")


def analyse_ball(paths: Sequence[Path], rig_path: Path, settings: BallSettings) -> BallExperiment:
    """Identify a ball from the sloshing runs of one rig.

    Parameters
    ----------
    paths : sequence of Path
        Free decays of a guided tank (`sdof_free`), or runs on the shaker; frozen and empty ones are used where
        the experiment uses them.
    rig_path : Path
    settings : BallSettings

    Raises
    ------
    InputError
        If the runs are of different experiments, or one is bad.
    """
    rig = Rig.from_toml(rig_path)
    described = [(path, read_attributes(path)) for path in paths]
    kinds = {"decay" if run.experiment == "sdof_free" else run.experiment.split("_")[0] for _, run in described}
    if kinds not in ({"decay"}, {"shaker"}):
        raise AnalysisError(
            "runs for a ball",
            got=", ".join(sorted({run.experiment for _, run in described})),
            allowed="sdof_free alone, or shaker_sweep and shaker_vfa",
            remedy="give the runs of one experiment",
        )
    if kinds == {"decay"}:
        return _from_decays(described, rig, rig_path, settings)
    return _from_shaker(paths, rig, rig_path, settings)


def _from_decays(
    described: Sequence[tuple[Path, RunAttributes]],
    rig: Rig,
    rig_path: Path,
    settings: BallSettings,
) -> BallExperiment:
    sloshing = [(path, run) for path, run in described if run.configuration == "sloshing"]
    if not sloshing:
        raise AnalysisError(
            "runs for a ball", got="no sloshing decay", allowed="at least one", remedy="record one"
        )
    release = _release_m(sloshing)
    recordings, curves = [], []
    for path, _ in sloshing:
        with naming(path):
            recordings.append(_recording(path))
            curves.append(_curve(recordings[-1], settings))
    measured, rate = _pooled(curves), float(recordings[0].attrs["sampling_rate_hz"])
    duration = recordings[0].sizes["time"] / rate
    with amounts("ball") as advance:
        found = identify_from_decay(
            measured, rig, initial_displacement_m=release, duration_s=duration, sampling_rate_hz=rate,
            damping_in_flight=settings.damping_in_flight, settings=settings.search, progress=advance,
        )  # fmt: skip
    decay = simulated_decay(found.ball, rig, release, duration, sampling_rate_hz=rate)
    result = DecayResult(
        measured=measured,
        simulated=simulated_curve(decay, measured.frequency_hz),
        initial_displacement_m=release,
        trace=_measured_trace(recordings[0], rig),
        simulated_trace=_simulated_trace(decay, rig),
        shares=damping_shares(found.ball, rig, release, 2 * duration),
        **_steady(found.ball, rig, measured),
        **_response(found.ball, rig, settings.n_map),
    )
    omega_bar = 2 * np.pi * measured.frequency_hz / rig.frequency_scale_rad_per_s
    inputs = (*(path for path, _ in described), rig_path)
    return BallExperiment(rig, rig_path.name, inputs, found, float(omega_bar), result, found.flags)


def _curve(recording: xr.Dataset, settings: BallSettings) -> DampingCurve:
    acceleration, rate = _acceleration(recording)
    return measured_curve(acceleration, rate, lowest_acceleration_g=settings.lowest_acceleration_g)


def _release_m(runs: Sequence[tuple[Path, RunAttributes]]) -> float:
    """The release that all runs share."""
    stated = [run.initial_displacement_m for _, run in runs]
    given = [value for value in stated if value]
    if len(given) != len(stated) or np.ptp(given) > _SAME_RELEASE * abs(given[0]):
        raise AnalysisError(
            "initial_displacement_m of the decays",
            got=", ".join("nothing" if value is None else f"{value:g}" for value in stated),
            allowed="the same release, stated in every run",
            remedy="give decays of one release, or state it with the attribute initial_displacement_m",
        )
    return float(np.mean(given))


def _recording(path: Path) -> xr.Dataset:
    recording = read_recording(path)
    require_usable(recording, path)
    return recording


def _acceleration(recording: xr.Dataset) -> tuple[FloatArray, float]:
    """Acceleration of the tank, the mean of its channels, and the rate."""
    names = channels(recording, "acceleration")
    if not names:
        raise AnalysisError("channels", got="no acceleration", allowed="at least one on the tank")
    mean = np.mean([recording[name].values for name in names], axis=0)
    return np.asarray(mean, dtype=np.float64), float(recording.attrs["sampling_rate_hz"])


def _pooled(curves: Sequence[DampingCurve]) -> DampingCurve:
    """All decays in one, amplitudes falling."""
    amplitude = np.concatenate([curve.acceleration_m_per_s2 for curve in curves])
    order = np.argsort(-amplitude, kind="stable")
    damping = np.concatenate([curve.damping_ratio for curve in curves])
    frequency = float(np.mean([curve.frequency_hz for curve in curves]))
    return DampingCurve(amplitude[order], damping[order], frequency)


def _measured_trace(recording: xr.Dataset, rig: Rig) -> ForceTrace:
    """F_S = M_dry ü − F_ext (1.7); NaN without a force channel."""
    acceleration, rate = _acceleration(recording)
    names = channels(recording, "force")
    force = np.full(acceleration.shape, np.nan)
    if names:
        force = rig.tank.dry_mass_kg * acceleration - np.sum([recording[name].values for name in names], axis=0)
        force -= np.nanmean(force)
    return ForceTrace(np.arange(acceleration.size) / rate, acceleration, force)


def _simulated_trace(decay: Simulation, rig: Rig) -> ForceTrace:
    force = decay.tank_force_n - rig.liquid_mass_kg * decay.acceleration_m_per_s2
    return ForceTrace(decay.time_s, decay.acceleration_m_per_s2, force - force.mean())


def _steady(ball: BouncingBall, rig: Rig, measured: DampingCurve) -> dict[str, FloatArray]:
    ends = measured.acceleration_m_per_s2.min(), measured.acceleration_m_per_s2.max()
    acceleration = np.geomspace(*ends, 30)
    return {
        "steady_acceleration_m_per_s2": acceleration,
        "steady_loss_factor": steady_loss_factor(ball, rig, acceleration),
    }


def _response(ball: BouncingBall, rig: Rig, n_map: int) -> dict[str, object]:
    """The map over the source's ranges, and the loop where η at f₀ is largest."""
    amplitudes = np.geomspace(*MAP_AMPLITUDE_M, n_map)
    frequencies = np.linspace(*MAP_FREQUENCY_RAD_PER_S, n_map) / (2 * np.pi)
    response = response_map(ball, rig, amplitudes, frequencies)
    frequency = natural_frequency_hz(rig)
    line = response["loss_factor"].interp(frequency_hz=frequency).values
    amplitude = float(amplitudes[int(np.nanargmax(line))])
    return {"response": response, "loop": (amplitude, frequency, *hysteresis(ball, rig, amplitude, frequency))}


def _from_shaker(paths: Sequence[Path], rig: Rig, rig_path: Path, settings: BallSettings) -> BallExperiment:
    sweeps = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=True)
    experiment = analyse_shaker(paths, [rig_path], sweeps)
    maps = experiment.maps
    line = work_line(maps, settings.omega_bar)
    with amounts("ball") as advance:
        found = identify_from_line(
            line, rig, damping_in_flight=settings.damping_in_flight, settings=settings.search, progress=advance
        )
    result = _compared(found.ball, rig, line, maps, experiment.windows, settings)
    flags = (*found.flags, *experiment.flags)
    return BallExperiment(rig, rig_path.name, experiment.inputs, found, line.omega_bar, result, flags)


def _compared(
    ball: BouncingBall, rig: Rig, line: WorkLine, maps: xr.Dataset, windows: xr.Dataset, settings: BallSettings
) -> LineResult:
    step = -(-windows.sizes["window"] // settings.n_windows)
    used = windows.isel(window=slice(None, None, step))
    bands, w_bar = error_by_frequency(
        ball,
        rig,
        omega_bar=used["omega_bar"].values,
        u_bar=used["u_bar"].values,
        w_bar=used["w_bar"].values,
        tuned_omega_bar=line.omega_bar,
    )
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
    values[rows, columns] = w_bar_at(ball, rig, omega_bar[rows], u_bar[columns])
    return measured.copy(data=values)


def _other_lines(
    ball: BouncingBall, rig: Rig, maps: xr.Dataset, omega_bar: float
) -> tuple[tuple[WorkLine, FloatArray], ...]:
    """Lines at frequencies spread over the map, those nearest the tuned one left out."""
    low, high = float(maps["omega_bar"].min()), float(maps["omega_bar"].max())
    wanted = np.linspace(low, high, _N_OTHER_LINES + 3)[1:-1]
    wanted = np.sort(wanted[np.argsort(np.abs(wanted - omega_bar))[1:]])
    lines = []
    for one in wanted[:_N_OTHER_LINES]:
        try:
            line = work_line(maps, float(one), 15)
        except AnalysisError:
            continue
        lines.append((line, w_bar_at(ball, rig, np.full(line.u_bar.shape, line.omega_bar), line.u_bar)))
    return tuple(lines)


def in_g(acceleration_m_per_s2: FloatArray) -> FloatArray:
    """Multiples of 9.81 m/s²."""
    return np.asarray(acceleration_m_per_s2 / GRAVITY_M_PER_S2)
