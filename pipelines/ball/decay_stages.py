"""A ball from free decays of a guided tank, by ζ(a)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.ball.decays import read_decays, simulated_trace
from pipelines.ball.results import BallExperiment, DecayResult
from pipelines.ball.settings import BallSettings
from pipelines.report.progress import amounts
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import (
    damping_shares,
    natural_frequency_hz,
    simulated_curve,
    simulated_decay,
    steady_loss_factor,
)
from sloshlab.bouncing_ball.from_free_decay import identify_from_decay
from sloshlab.bouncing_ball.harmonic_response import hysteresis, response_map
from sloshlab.recording import RunAttributes
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

MAP_AMPLITUDE_M = (0.0025, 0.1)
MAP_FREQUENCY_RAD_PER_S = (1.57, 62.83)
"""Ranges of the source's maps (2.1.2)."""


def ball_from_decays(
    described: Sequence[tuple[Path, RunAttributes]], rig_as_believed: Rig, rig_path: Path, settings: BallSettings
) -> BallExperiment:
    """The ball whose ζ(a) is that of the sloshing decays, on the guide that the frozen ones show.

    Raises
    ------
    InputError
        If there is no sloshing decay, releases differ, or a decay cannot be read.
    """
    decays = read_decays(described, rig_as_believed, settings.lowest_acceleration_g)
    rig, measured, release = decays.rig, decays.measured, decays.release_m
    duration, rate = decays.duration_s, decays.sampling_rate_hz
    with amounts("search of the ball") as advance:
        found = identify_from_decay(
            measured, rig, initial_displacement_m=release, duration_s=duration, sampling_rate_hz=rate,
            damping_in_flight=settings.damping_in_flight, settings=settings.search, progress=advance,
        )  # fmt: skip
    # at the rate of the recordings, because the reading of the decrement depends on it
    decay = simulated_decay(found.ball, rig, release, duration, sampling_rate_hz=rate)
    steady = np.geomspace(measured.acceleration_m_per_s2.min(), measured.acceleration_m_per_s2.max(), 30)
    response = _response(found.ball, rig, settings.n_map)
    result = DecayResult(
        measured=measured,
        simulated=simulated_curve(decay, measured.frequency_hz),
        initial_displacement_m=release,
        trace=decays.traces[0][1],
        simulated_trace=simulated_trace(decay, rig),
        traces=decays.traces,
        shares=damping_shares(found.ball, rig, release, 2 * duration),
        frozen=decays.frozen,
        steady_acceleration_m_per_s2=steady,
        steady_loss_factor=steady_loss_factor(found.ball, rig, steady),
        response=response,
        loop=_loop(found.ball, rig, response),
    )
    omega_bar = 2 * np.pi * measured.frequency_hz / rig.frequency_scale_rad_per_s
    inputs = (*(path for path, _ in described), rig_path)
    flags = (*found.flags, *decays.flags)
    return BallExperiment(rig, rig_path.name, inputs, found, float(omega_bar), result, settings, flags)


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
