"""Channels that belong together: the total force on the tank and its mean acceleration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.channel_names import (
    ACCELERATION_CONTROL,
    ACCELERATION_ROOF,
    ACCELERATION_TIP,
    FORCE_CELL,
    FORCE_INTERFACE,
)
from sloshlab.conditioning.gaps import require_channels
from sloshlab.errors import AnalysisError
from sloshlab.out_of_core import blocks, empty
from sloshlab.recording import channels
from sloshlab.units import SI_UNITS


def force_channels(recording: xr.Dataset) -> list[str]:
    """Channels whose sum is the external force on the tank: the cells, or the interface force.

    Raises
    ------
    AnalysisError
        If there is neither a ``force_cell_*`` nor a ``force_interface``.
    """
    forces = channels(recording, "force")
    cells = [name for name in forces if name.startswith(FORCE_CELL)]
    # an interface force beside cells is not added: it would count the same force twice
    chosen = cells or [name for name in forces if name == FORCE_INTERFACE]
    if not chosen:
        raise AnalysisError(
            "force on the tank",
            got=f"force channels {', '.join(forces) or 'none'}",
            allowed="force_cell_1, force_cell_2, … or force_interface",
            remedy="name the force cells in the channel map, or name the channel with --force",
        )
    return chosen


def acceleration_channels(recording: xr.Dataset) -> list[str]:
    """Channels whose mean is the tank's acceleration.

    They are the roof accelerometers; without them the tip's, else the control accelerometer, else
    the only acceleration there is. With roof accelerometers the control is left for checking.

    Raises
    ------
    AnalysisError
        If none of these is there, or several unknown ones are.
    """
    accelerations = channels(recording, "acceleration")
    # the control accelerometer is left for comparison where the roof has its own
    for prefix in (ACCELERATION_ROOF, ACCELERATION_TIP, ACCELERATION_CONTROL):
        chosen = [name for name in accelerations if name.startswith(prefix)]
        if chosen:
            return chosen
    if len(accelerations) == 1:
        return accelerations
    raise AnalysisError(
        "acceleration of the tank",
        got=f"acceleration channels {', '.join(accelerations) or 'none'}",
        allowed="acceleration_roof_1, acceleration_roof_2, … or acceleration_tip or acceleration_control",
        remedy="name the tank's accelerometers in the channel map, or name the channel with --acceleration",
    )


def force_sign(channel: xr.DataArray) -> float:
    """+1 for a force on the tank, −1 for one stated as the force of the tank on something else."""
    return -1.0 if channel.attrs.get("block_from") == "tank" else 1.0


def derived_channel(
    source: xr.DataArray, values: npt.NDArray[np.float64], name: str, attributes: Mapping[str, Any]
) -> xr.DataArray:
    """New values on the time of `source`, which is shared; attributes start from empty."""
    derived = source.copy(deep=False, data=values).rename(name)
    derived.attrs = dict(attributes)
    derived.encoding = {}
    return derived


def total_force(recording: xr.Dataset, names: Sequence[str] | None = None) -> xr.DataArray:
    """External force F_ext on the tank: the sum of its force channels.

    Parameters
    ----------
    recording : xarray.Dataset
        A recording in SI units.
    names : sequence of str, optional
        Force channels to add up; by default `force_channels`.

    Returns
    -------
    xarray.DataArray
        ``force_total(time)`` [N], in the widest type of its channels, upward positive, NaN where any of
        them is lost. The static mean is not removed. A channel stated as the force *of* the tank
        (`block_from` = "tank") enters with a minus, because F_ext acts on the tank (1.6).

    Raises
    ------
    AnalysisError
        If a channel is missing or is not a force.
    """
    chosen = force_channels(recording) if names is None else list(names)
    _require_quantity(recording, chosen, "force")
    signs = [force_sign(recording[name]) for name in chosen]
    return _combined(recording, chosen, signs, "force_total", "force")


def weights_by_noise(recording: xr.Dataset, names: Sequence[str]) -> list[float]:
    """Weights of channels of one motion, inverse to the variance of their noise; equal unless all state it.

    The mean with these weights has the least noise, not the least error of calibration.

    Parameters
    ----------
    recording : xarray.Dataset
        Its channels may have the attribute `noise_std`.
    names : sequence of str

    Returns
    -------
    list of float
        With sum 1.
    """
    stated = [float(recording[name].attrs.get("noise_std", 0.0)) for name in names]
    # The mean of a loud and a quiet accelerometer would have half of the loud one's noise.
    known = all(np.isfinite(std) and std > 0 for std in stated)
    inverse = [(min(stated) / std) ** 2 if known else 1.0 for std in stated]
    return [weight / sum(inverse) for weight in inverse]


def mean_acceleration(
    recording: xr.Dataset, names: Sequence[str] | None = None, weights: Sequence[float] | None = None
) -> xr.DataArray:
    """Acceleration ü of the tank: the mean of its accelerometers.

    Parameters
    ----------
    recording : xarray.Dataset
        A recording in SI units.
    names : sequence of str, optional
        Accelerations to average; by default `acceleration_channels`.
    weights : sequence of float, optional
        One per name, with sum 1; equal by default.

    Returns
    -------
    xarray.DataArray
        ``acceleration_mean(time)`` [m/s²], in the widest type of its channels, upward positive, NaN where
        any of them is lost.

    Raises
    ------
    AnalysisError
        If a channel is missing or is not an acceleration.
    """
    chosen = acceleration_channels(recording) if names is None else list(names)
    _require_quantity(recording, chosen, "acceleration")
    factors = [1.0 / len(chosen)] * len(chosen) if weights is None else list(weights)
    return _combined(recording, chosen, factors, "acceleration_mean", "acceleration")


class TankSignals(NamedTuple):
    """Force on a tank and its acceleration, combined once for all who ask.

    Attributes
    ----------
    force : xarray.DataArray
        `total_force` of the recording.
    acceleration : xarray.DataArray
        `mean_acceleration` of it.
    """

    force: xr.DataArray
    acceleration: xr.DataArray


def tank_signals(recording: xr.Dataset) -> TankSignals:
    """Force and acceleration of the tank of a recording.

    Raises
    ------
    AnalysisError
        If a channel is missing.
    """
    return TankSignals(total_force(recording), mean_acceleration(recording))


def dynamic_force_noise_power(
    recording: xr.Dataset, forces: Sequence[str], accelerations: Sequence[str], mass_kg: float
) -> float:
    """Mean square of m ü − F that the stated noise of the sensors alone gives.

    Parameters
    ----------
    recording : xarray.Dataset
        Its channels may have the attribute `noise_std`.
    forces, accelerations : sequence of str
        Channels that are added to F, and averaged to ü; their noises are taken as independent.
    mass_kg : float
        m.

    Returns
    -------
    float
        [N²]; 0 if no channel states a noise.
    """
    noise = {name: float(recording[name].attrs.get("noise_std", 0.0)) for name in [*forces, *accelerations]}
    of_mean = sum(noise[name] ** 2 for name in accelerations) / len(accelerations) ** 2
    # the gain of ü on d is the mass
    return sum(noise[name] ** 2 for name in forces) + mass_kg**2 * of_mean


def _require_quantity(recording: xr.Dataset, names: Sequence[str], quantity: str) -> None:
    if not names:
        raise AnalysisError(f"{quantity} channels", got="an empty list", allowed="at least one")
    require_channels(recording, names)
    for name in names:
        got = recording[name].attrs.get("quantity")
        if got != quantity:
            raise AnalysisError(f"channel {name}", got=f"quantity {got!r}", allowed=repr(quantity))


def _combined(
    recording: xr.Dataset, names: Sequence[str], factors: Sequence[float], name: str, quantity: str
) -> xr.DataArray:
    """Σ factor × channel in the widest type of the channels, block by block."""
    # equal factors are applied once to the sum: no temporary array per channel
    equal = len(set(factors)) == 1
    # single precision stays single, which halves the memory
    widest = np.result_type(*(recording[channel].dtype for channel in names), np.float32)
    values = [recording[channel].values for channel in names]
    total = empty(values[0].size, widest)
    for part in blocks(total.size, total, *values):
        of_part = total[part]
        np.multiply(values[0][part], 1.0 if equal else factors[0], out=of_part, dtype=widest)
        for of_channel, factor in zip(values[1:], factors[1:], strict=True):
            more = of_channel[part] if equal else factor * of_channel[part]
            np.add(of_part, more, out=of_part, casting="same_kind")
        if equal and factors[0] != 1.0:
            of_part *= widest.type(factors[0])
    attributes = {"units": SI_UNITS[quantity], "quantity": quantity, "combined_from": ", ".join(names)}
    return derived_channel(recording[names[0]], total, name, attributes)
