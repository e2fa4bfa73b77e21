"""Free decays of a guided tank, read: what the guide does, and ζ(a), motion and force of the sloshing ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.ball.results import ForceTrace
from pipelines.sweep.stages import naming, require_usable
from sloshlab.bouncing_ball.free_decay import DampingCurve, measured_curve, pooled_curve
from sloshlab.bouncing_ball.guide import FrozenDecay, Guide, guide_from_decay
from sloshlab.conditioning.spring_inertia import at_the_tank
from sloshlab.errors import AnalysisError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.recording import RunAttributes, channels, read_recording
from sloshlab.rig import Rig
from sloshlab.twin.twin import Simulation

FloatArray = npt.NDArray[np.float64]

_SAME_RELEASE, _GUIDE_AGREES = 0.05, 0.05
"""Relative differences: of releases that count as one, and of a guide from what the rig states of it."""


@dataclass(frozen=True, eq=False)
class Decays:
    """Decays of one release.

    Attributes
    ----------
    rig : Rig
        On the guide that the frozen decay shows, if there is one.
    frozen : FrozenDecay or None
    release_m : float
    measured : DampingCurve
        ζ(a) of all sloshing decays together.
    sampling_rate_hz, duration_s : float
        Of the first sloshing decay.
    traces : tuple of (str, ForceTrace)
        Every sloshing decay with the name of its run.
    flags : tuple of str
        Numbers of the guide that the rig file states otherwise.
    """

    rig: Rig
    frozen: FrozenDecay | None
    release_m: float
    measured: DampingCurve
    sampling_rate_hz: float
    duration_s: float
    traces: tuple[tuple[str, ForceTrace], ...]
    flags: tuple[str, ...]


def are_decays(described: Sequence[tuple[Path, RunAttributes]]) -> bool:
    """Whether all runs are releases of a guided tank."""
    experiments = [EXPERIMENTS[run.experiment] for _, run in described]
    return all(known.moves == "release" and known.structure == "sdof" for known in experiments)


def read_decays(
    described: Sequence[tuple[Path, RunAttributes]], rig_as_believed: Rig, lowest_acceleration_g: float
) -> Decays:
    """Read the decays of a rig.

    Parameters
    ----------
    described : sequence of (Path, RunAttributes)
    rig_as_believed : Rig
        As its file states it.
    lowest_acceleration_g : float
        Below it ζ(a) is not read.

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
    still = [(path, run) for path, run in described if run.configuration == "frozen"]
    frozen = _frozen(still, rig_as_believed, lowest_acceleration_g)
    rig = frozen.guide.on(rig_as_believed) if frozen else rig_as_believed
    recordings, curves = [], []
    for path, _ in sloshing:
        with naming(path):
            recordings.append(at_the_tank(_recording(path), rig))
            acceleration, rate = _acceleration(recordings[-1])
            curves.append(measured_curve(acceleration, rate, lowest_acceleration_g=lowest_acceleration_g))
    rate = float(recordings[0].attrs["sampling_rate_hz"])
    names = [run.run_id for _, run in sloshing]
    traces = [_measured_trace(recording, rig) for recording in recordings]
    return Decays(
        rig,
        frozen,
        release,
        pooled_curve(curves),
        rate,
        recordings[0].sizes["time"] / rate,
        tuple(zip(names, traces, strict=True)),
        _guide_flags(frozen, rig_as_believed),
    )


def _frozen(
    runs: Sequence[tuple[Path, RunAttributes]], rig: Rig, lowest_acceleration_g: float
) -> FrozenDecay | None:
    """The first frozen decay, read; None without one."""
    for path, run in runs[:1]:
        with naming(path):
            acceleration, rate = _acceleration(_recording(path))
            return guide_from_decay(
                acceleration, rate, rig, initial_displacement_m=_release_m([(path, run)]),
                lowest_acceleration_g=lowest_acceleration_g,
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


def simulated_trace(decay: Simulation, rig: Rig) -> ForceTrace:
    """Motion and F_S = Δf − m_l ü of a simulated decay, without its mean."""
    force = decay.tank_force_n - rig.liquid_mass_kg * decay.acceleration_m_per_s2
    return ForceTrace(decay.time_s, decay.acceleration_m_per_s2, force - force.mean())
