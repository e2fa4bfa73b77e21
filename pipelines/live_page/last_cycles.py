"""Work and loop of the last cycles, by the functions that analyse the recording afterwards.

What is shown rests on what is known while it records: the rig as it is described, force cells as they are
calibrated, no empty or frozen run beside. `sloshlab shaker` knows more.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from acquisition.samples.channel import Channel, attributes_of
from pipelines.live_page.page_state import rounded
from pipelines.sweep.results import SweepSignals
from pipelines.sweep.stages import excerpt_of
from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    force_channels,
    mean_acceleration,
    total_force,
)
from sloshlab.errors import AnalysisError, UnitsError
from sloshlab.rig import Rig
from sloshlab.sweep.cycles import evaluate_cycles
from sloshlab.sweep.motion_phase import measured_phase
from sloshlab.sweep.windows import WindowSettings, evaluate_windows
from sloshlab.units import SI_UNITS, factor_to_si

WINDOWS: Final = WindowSettings(half_width_cycles=4, spacing_cycles=4)
_POINTS_PER_CYCLE: Final = 80
_MOST_CYCLES_SHOWN: Final = 8

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Roles:
    """Which channels of a source are force and motion of the tank; or why there is nothing to compute.

    Attributes
    ----------
    forces, accelerations : tuple of int
        Numbers of the channels.
    reason : str
        Empty if there are both.
    """

    forces: tuple[int, ...] = ()
    accelerations: tuple[int, ...] = ()
    reason: str = ""


def roles_of(channels: Sequence[Channel]) -> Roles:
    """Force and motion by the names that have a meaning to the analysis."""
    empty = recording_of(channels, range(len(channels)), np.zeros((2, len(channels))), 1.0)
    names = [channel.name for channel in channels]
    try:
        forces = tuple(names.index(name) for name in force_channels(empty))
    except AnalysisError:
        return Roles(reason="no force channel")
    try:
        return Roles(forces, tuple(names.index(name) for name in acceleration_channels(empty)))
    except AnalysisError:
        return Roles(reason="no acceleration channel of the tank")


def recording_of(
    channels: Sequence[Channel], numbers: Sequence[int], values: FloatArray, sampling_rate_hz: float
) -> xr.Dataset:
    """Some channels of a source in SI units, as a recording has them."""
    variables = {}
    for column, number in enumerate(numbers):
        channel = channels[number]
        attributes = attributes_of(channel) | {"units": SI_UNITS.get(channel.quantity, channel.units)}
        try:
            factor = factor_to_si(channel.units, channel.quantity)
        # a channel of no known quantity is none of those that are asked for
        except UnitsError:
            continue
        variables[channel.name] = ("time", values[:, column] * factor, attributes)
    time_s = np.arange(len(values)) / sampling_rate_hz
    return xr.Dataset(variables, coords={"time": time_s}, attrs={"sampling_rate_hz": sampling_rate_hz})


def last_cycles(recording: xr.Dataset, rig: Rig, start_time_s: float) -> dict[str, Any]:
    """Work and loop of the last window of cycles, for the page.

    Parameters
    ----------
    recording : xarray.Dataset
        Force and acceleration of the last seconds in SI units, NaN where lost.
    rig : Rig
    start_time_s : float
        Time of the first sample [s].

    Returns
    -------
    dict
        ``time_s``, ``frequency_hz``, ``acceleration_g``, ``work_j``, ``w_bar`` and ``w_bar_std`` of the last
        window, and `loop`; a `reason` alone where there is nothing to compute.
    """
    rate_hz = float(recording.attrs["sampling_rate_hz"])
    force = total_force(recording).values.astype(np.float64)
    motion = mean_acceleration(recording).values.astype(np.float64)
    inertia_kg = rig.tank.dry_mass_kg + rig.liquid_mass_kg
    try:
        phase = measured_phase(motion, None, rate_hz)
        boundaries = phase.cycle_boundaries_s()
    except AnalysisError as error:
        return {"reason": f"{error.what} since the last lost sample: {error.got}"}
    cycles = evaluate_cycles(force, motion, boundaries, sampling_rate_hz=rate_hz, inertia_kg=inertia_kg)
    windows = evaluate_windows(
        cycles, run_id="live", law=None, start_time_s=start_time_s, rig=rig, settings=WINDOWS
    )
    if not windows.sizes["window"]:
        return {"reason": _why_no_window(windows, cycles.usable.size)}
    last = windows.isel(window=-1)
    signals = SweepSignals(force_n=force, motion=motion, inertia_kg=inertia_kg)
    names = ("time_s", "frequency_hz", "acceleration_g", "work_j", "w_bar", "w_bar_std", "n_cycles")
    return {name: float(last[name]) for name in names} | {"loop": _loop(last, signals, rig, rate_hz, start_time_s)}


def _why_no_window(windows: xr.Dataset, n_cycles: int) -> str:
    if windows.attrs["n_unsteady_windows"]:
        return "the level changes too quickly"
    needed = 2 * WINDOWS.half_width_cycles + 8
    return f"{n_cycles} cycles without a lost sample, of {needed} that are needed"


def _loop(
    window: xr.Dataset, signals: SweepSignals, rig: Rig, rate_hz: float, start_time_s: float
) -> dict[str, Any]:
    """Force of the liquid over displacement, cycle by cycle, thinned."""
    excerpt = excerpt_of(window, signals, rig, rate_hz, start_time_s)
    n_cycle = max(4, round(rate_hz / excerpt.frequency_hz))
    n_cycles = min(_MOST_CYCLES_SHOWN, excerpt.force_n.size // n_cycle)
    begin = excerpt.force_n.size - n_cycles * n_cycle
    places = np.linspace(0, n_cycle, min(_POINTS_PER_CYCLE, n_cycle) + 1).round().astype(int)
    cycles = []
    for number in range(n_cycles):
        at = np.minimum(begin + number * n_cycle + places, excerpt.force_n.size - 1)
        rows = zip((1e3 * excerpt.displacement_m[at]).tolist(), excerpt.force_n[at].tolist(), strict=True)
        cycles.append([[rounded(x), rounded(y)] for x, y in rows])
    return {
        "cycles": cycles,
        "x_label": "displacement of the tank u [mm]",
        "y_label": "sloshing force F_S [N]",
        "note": f"the last {n_cycles} cycles, the newest strongest; upward positive, means removed",
    }


@functools.lru_cache(maxsize=4)
def rig_at(path: str) -> Rig:
    """The rig of the run, read once."""
    return Rig.from_toml(path)
