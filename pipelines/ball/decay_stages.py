"""A ball from free decays of a guided tank, by ζ(a)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.ball.results import BallExperiment, DecayResult, ForceTrace
from pipelines.ball.settings import BallSettings
from pipelines.report.progress import amounts
from pipelines.sweep.stages import naming, require_usable
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import (
    DampingCurve,
    damping_shares,
    measured_curve,
    natural_frequency_hz,
    pooled_curve,
    simulated_curve,
    simulated_decay,
    steady_loss_factor,
)
from sloshlab.bouncing_ball.from_free_decay import identify_from_decay
from sloshlab.bouncing_ball.guide import FrozenDecay, Guide, guide_from_decay
from sloshlab.bouncing_ball.harmonic_response import hysteresis, response_map
from sloshlab.errors import AnalysisError
from sloshlab.recording import RunAttributes, channels, read_recording
from sloshlab.rig import Rig
from sloshlab.twin.twin import Simulation

FloatArray = npt.NDArray[np.float64]

MAP_AMPLITUDE_M = (0.0025, 0.1)
MAP_FREQUENCY_RAD_PER_S = (1.57, 62.83)
"""Ranges of the source's maps (2.1.2)."""
_SAME_RELEASE, _GUIDE_AGREES = 0.05, 0.05
"""Relative differences: of releases that count as one, and of a guide from what the rig states of it."""


def ball_from_decays(
    described: Sequence[tuple[Path, RunAttributes]], rig_as_believed: Rig, rig_path: Path, settings: BallSettings
) -> BallExperiment:
    """The ball whose ζ(a) is that of the sloshing decays, on the guide that the frozen ones show.

    Raises
    ------
    InputError
        If there is no sloshing decay, releases differ, or a decay cannot be read.
    """
    sloshing = [(path, run) for path, run in described if run.configuration == "sloshing"]
    if not sloshing:
        raise AnalysisError(
            "runs for a ball", got="no sloshing decay", allowed="at least one", remedy="record one"
        )
    release = _release_m(sloshing)
    frozen = _frozen([(path, run) for path, run in described if run.configuration == "frozen"], rig_as_believed,
                     settings)  # fmt: skip
    rig = frozen.guide.on(rig_as_believed) if frozen else rig_as_believed
    recordings, curves = [], []
    for path, _ in sloshing:
        with naming(path):
            recordings.append(_recording(path))
            curves.append(_curve(recordings[-1], settings))
    measured, rate = pooled_curve(curves), float(recordings[0].attrs["sampling_rate_hz"])
    duration = recordings[0].sizes["time"] / rate
    with amounts("search of the ball") as advance:
        found = identify_from_decay(
            measured, rig, initial_displacement_m=release, duration_s=duration, sampling_rate_hz=rate,
            damping_in_flight=settings.damping_in_flight, settings=settings.search, progress=advance,
        )  # fmt: skip
    # at the rate of the recordings, because the reading of the decrement depends on it
    decay = simulated_decay(found.ball, rig, release, duration, sampling_rate_hz=rate)
    steady = np.geomspace(measured.acceleration_m_per_s2.min(), measured.acceleration_m_per_s2.max(), 30)
    traces = [_measured_trace(recording, rig) for recording in recordings]
    response = _response(found.ball, rig, settings.n_map)
    result = DecayResult(
        measured=measured,
        simulated=simulated_curve(decay, measured.frequency_hz),
        initial_displacement_m=release,
        trace=traces[0],
        simulated_trace=_simulated_trace(decay, rig),
        traces=tuple((run.run_id, trace) for (_, run), trace in zip(sloshing, traces, strict=True)),
        shares=damping_shares(found.ball, rig, release, 2 * duration),
        frozen=frozen,
        steady_acceleration_m_per_s2=steady,
        steady_loss_factor=steady_loss_factor(found.ball, rig, steady),
        response=response,
        loop=_loop(found.ball, rig, response),
    )
    omega_bar = 2 * np.pi * measured.frequency_hz / rig.frequency_scale_rad_per_s
    inputs = (*(path for path, _ in described), rig_path)
    flags = (*found.flags, *_guide_flags(frozen, rig_as_believed))
    return BallExperiment(rig, rig_path.name, inputs, found, float(omega_bar), result, settings, flags)


def _frozen(runs: Sequence[tuple[Path, RunAttributes]], rig: Rig, settings: BallSettings) -> FrozenDecay | None:
    """The first frozen decay, read; None without one."""
    for path, run in runs[:1]:
        with naming(path):
            acceleration, rate = _acceleration(_recording(path))
            return guide_from_decay(
                acceleration, rate, rig, initial_displacement_m=_release_m([(path, run)]),
                lowest_acceleration_g=settings.lowest_acceleration_g,
            )  # fmt: skip
    return None


def _guide_flags(frozen: FrozenDecay | None, rig: Rig) -> tuple[str, ...]:
    """Numbers of the guide that the rig file states otherwise."""
    if frozen is None:
        return ()
    stated, seen = dataclasses.asdict(Guide.of_rig(rig)), dataclasses.asdict(frozen.guide)
    return tuple(
        f"rig: structure.{name} is stated as {stated[name]:.4g}; frozen decay: {seen[name]:.4g}, used here"
        for name in stated
        if abs(seen[name] - stated[name]) > _GUIDE_AGREES * max(abs(stated[name]), 1e-9)
    )


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


def _response(ball: BouncingBall, rig: Rig, n_map: int) -> xr.Dataset:
    """The map over the source's ranges."""
    amplitudes = np.geomspace(*MAP_AMPLITUDE_M, n_map)
    frequencies = np.linspace(*MAP_FREQUENCY_RAD_PER_S, n_map) / (2 * np.pi)
    with amounts("maps of the ball") as advance:
        return response_map(ball, rig, amplitudes, frequencies, progress=advance)


def _loop(ball: BouncingBall, rig: Rig, response: xr.Dataset) -> tuple[float, float, FloatArray, FloatArray]:
    """Amplitude, frequency and hysteresis cycle where η at f₀ is largest."""
    frequency = natural_frequency_hz(rig)
    line = response["loss_factor"].interp(frequency_hz=frequency).values
    amplitude = float(response["amplitude_m"].values[int(np.nanargmax(line))])
    return (amplitude, frequency, *hysteresis(ball, rig, amplitude, frequency))
