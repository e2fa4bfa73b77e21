"""What of a recording drives a twin: the base's motion, the tank's motion, the force on the tank, or a release.

Lost samples of a driving channel are bridged where they are few, since a simulation cannot stop and go on; how
many they were is said. At a longer gap the simulation ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.interpolate import CubicSpline

from sloshlab.channel_names import ACCELERATION_ROOT, DISPLACEMENT_TANK
from sloshlab.conditioning.clipping import clipped_samples
from sloshlab.conditioning.combined_channels import (
    acceleration_channels,
    force_channels,
    mean_acceleration,
    total_force,
    weights_by_noise,
)
from sloshlab.conditioning.gaps import runs
from sloshlab.conditioning.integration import integrated
from sloshlab.errors import AnalysisError, InputError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.recording import run_attributes
from sloshlab.twin.excitation import Excitation, free, recorded
from sloshlab.twin.twin import Twin

FloatArray = npt.NDArray[np.float64]
Block = Literal["all", "tank", "structure"]

BLOCKS: Final = ("all", "tank", "structure")
LONGEST_BRIDGE: Final = 5
"""Lost samples in a row that are bridged."""

_FEWEST_SAMPLES = 12
# Nominal releases are off by little; a wrong sign or unit is off by much.
_DEFLECTIONS_AGREE = 0.3


@dataclass(frozen=True, eq=False)
class Drive:
    """How a recording drives a twin.

    Attributes
    ----------
    twin : Twin
        The blocks that run.
    excitation : Excitation
    initial_displacement_m : float
        Of the tank, released at the first sample.
    channels : tuple of str
        Those that drive.
    description : str
        For a person.
    flags : tuple of str
        What was wrong with them: lost and clipped samples.
    """

    twin: Twin
    excitation: Excitation
    initial_displacement_m: float
    channels: tuple[str, ...]
    description: str
    flags: tuple[str, ...]


def drive_of(recording: xr.Dataset, twin: Twin, *, block: Block = "all", by_noise: bool = False) -> Drive:
    """Drive of a twin, or of one block alone on its measured input.

    Parameters
    ----------
    recording : xarray.Dataset
        In SI units.
    twin : Twin
        Without a structure, the tank follows its measured motion.
    block : {'all', 'tank', 'structure'}
        The closed loop; the tank on the measured motion of the tank; the structure on the measured force of the
        liquid, Δf = (M_dry + m_l) ü − F_ext.
    by_noise : bool
        Whether the tank's accelerometers that drive together count by their noise (`weights_by_noise`), for those
        who find their gains themselves; alike by default, which makes errors of gains least.

    Raises
    ------
    InputError
        If the recording holds nothing that drives this twin, or a gap at its start.

    Notes
    -----
    Free runs are released from `initial_displacement_m` (the first sample of `displacement_tank` where that
    attribute is absent) with the base at rest; the base of every other run moves as `acceleration_root` says.
    The static mean of Δf is removed, and that of accelerations but for free runs. Velocity and displacement are
    integrated without drift.
    """
    if block not in BLOCKS:
        raise InputError("block", got=repr(block), allowed=", ".join(BLOCKS))
    if twin.structure is None and block == "structure":
        raise InputError("block structure", got="a rig without [structure]", allowed="all or tank")
    if twin.structure is None or block == "tank":
        return _driven_tank(recording, twin.tank_alone(), by_noise=by_noise)
    return _driven_structure(recording, twin.structure_alone() if block == "structure" else twin, block)


def _driven_tank(recording: xr.Dataset, twin: Twin, *, by_noise: bool) -> Drive:
    names = acceleration_channels(recording)
    rate = run_attributes(recording).sampling_rate_hz
    # by noise: a loud sensor would bring half of its noise into the drive; alike by default, which makes errors
    # of the gains least
    weights = weights_by_noise(recording, names) if by_noise else None
    mean = mean_acceleration(recording, names, weights).values
    acceleration, n_driven, flags = _usable(recording, names, mean)
    # the mean of a decay is part of its motion; of a run that goes on it is the sensor's offset
    if not _is_free(recording):
        acceleration -= acceleration.mean()
    motion = _integrated_twice(acceleration, rate)
    if DISPLACEMENT_TANK in recording.data_vars and _is_free(recording):
        # integration has to forget the constant, and at the ends more; a free run starts with all of it
        measured, _, _ = _usable(recording, [DISPLACEMENT_TANK], recording[DISPLACEMENT_TANK].values)
        motion = (motion[0], measured[:n_driven])
        names = [*names, DISPLACEMENT_TANK]
    excitation = recorded(rate, acceleration=acceleration, velocity=motion[0], displacement=motion[1])
    return Drive(twin, excitation, 0.0, tuple(names), f"the tank follows {', '.join(names)}", flags)


def _driven_structure(recording: xr.Dataset, twin: Twin, block: Block) -> Drive:
    attributes = run_attributes(recording)
    rate, n = attributes.sampling_rate_hz, recording.sizes["time"]
    names: list[str] = []
    driven: dict[str, FloatArray] = {}
    flags: tuple[str, ...] = ()
    parts: list[str] = []
    if ACCELERATION_ROOT in recording.data_vars and not _is_free(recording):
        names.append(ACCELERATION_ROOT)
        acceleration, n, flags = _usable(recording, names, recording[ACCELERATION_ROOT].values)
        acceleration -= acceleration.mean()
        velocity, displacement = _integrated_twice(acceleration, rate)
        driven = {"acceleration": acceleration, "velocity": velocity, "displacement": displacement}
        parts.append("the base moves as acceleration_root")
    start = _initial_displacement_m(recording)
    if start:
        parts.append(f"released from {1000 * start:g} mm")
        flags = (*flags, *_start_remarks(recording, start))
    if block == "structure":
        forces, motions = force_channels(recording), acceleration_channels(recording)
        # (1.19): what the liquid does beyond a frozen one
        acting = twin.carried_mass_kg * mean_acceleration(recording).values - total_force(recording).values
        force, n_force, more = _usable(recording, [*forces, *motions], acting)
        # the weight left in a force would deflect the structure
        force -= force.mean()
        n, flags = min(n, n_force), (*flags, *more)
        driven["force_n"] = force
        names += [*forces, *motions]
        parts.append(f"Δf on the tank from {', '.join([*forces, *motions])}")
    elif not parts:
        raise InputError(
            f"recording {attributes.run_id}",
            got="neither acceleration_root nor an initial displacement",
            allowed="base motion, or the release of a free run",
            remedy="set the attribute initial_displacement_m, or drive one block alone with --block tank",
        )
    excitation = (
        recorded(rate, **{name: values[:n] for name, values in driven.items()})
        if driven
        else free((n - 1) / rate, rate)
    )
    return Drive(twin, excitation, start, tuple(names), "; ".join(parts), flags)


def _is_free(recording: xr.Dataset) -> bool:
    return EXPERIMENTS[run_attributes(recording).experiment].moves == "release"


def _initial_displacement_m(recording: xr.Dataset) -> float:
    """Nominal deflection of the tank at the first sample; measured where a free run states none."""
    stated = run_attributes(recording).initial_displacement_m
    if stated is not None or not _is_free(recording) or DISPLACEMENT_TANK not in recording.data_vars:
        return float(stated or 0.0)
    first = float(recording[DISPLACEMENT_TANK].values[0])
    return first if np.isfinite(first) else 0.0


def _start_remarks(recording: xr.Dataset, stated_m: float) -> tuple[str, ...]:
    """A nominal deflection that the measured one contradicts, for example by its sign."""
    if DISPLACEMENT_TANK not in recording.data_vars:
        return ()
    measured = float(recording[DISPLACEMENT_TANK].values[0])
    if not np.isfinite(measured) or abs(measured - stated_m) <= _DEFLECTIONS_AGREE * abs(stated_m):
        return ()
    stated = f"released from the stated {1000 * stated_m:g} mm"
    return (f"{stated}, but displacement_tank starts at {1000 * measured:.3g} mm",)


def _integrated_twice(acceleration: FloatArray, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    try:
        velocity = integrated(acceleration, 1.0 / rate_hz)
        return velocity, integrated(velocity, 1.0 / rate_hz)
    except AnalysisError as error:
        raise InputError(f"driving acceleration: {error}") from error


def _usable(
    recording: xr.Dataset, names: Sequence[str], values: npt.NDArray[np.floating]
) -> tuple[FloatArray, int, tuple[str, ...]]:
    """Values with short gaps bridged, their number up to the first long gap, and what there is to say."""
    series, which = np.array(values, dtype=np.float64), ", ".join(names)
    flags = []
    good = np.isfinite(series)
    n_driven = series.size
    for start, stop in runs(good, False):
        # at the ends there is nothing to bridge to
        if stop - start > LONGEST_BRIDGE or start == 0 or stop == series.size:
            n_driven = start
            break
    if n_driven < min(_FEWEST_SAMPLES, series.size):
        raise InputError(
            f"driving channel {which}",
            got=f"a gap {n_driven} samples after the start",
            allowed=f"≥ {_FEWEST_SAMPLES} samples without a gap",
            remedy="simulate a stretch without gaps",
        )
    time = recording["time"].values
    if n_driven < series.size:
        flags.append(f"{which}: lost from {time[n_driven]:.6g} s on; simulated up to there")
    series, good = series[:n_driven], good[:n_driven]
    n_bridged = int((~good).sum())
    if n_bridged:
        places = np.arange(n_driven)
        # a few samples: the motion is smooth at many samples per cycle, and a simulation cannot stop and go on
        series[~good] = CubicSpline(places[good], series[good])(places[~good])
        flags.append(f"{which}: {n_bridged} lost samples bridged")
    n_clipped = sum(int(clipped_samples(recording[name]).sum()) for name in names)
    if n_clipped:
        flags.append(f"{which}: {n_clipped} clipped samples drive the twin")
    return series, n_driven, tuple(flags)
