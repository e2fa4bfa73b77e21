"""A simulation as a recording: the channels of the run that drove it, under the same names, simulated.

Channels carry no noise, range or scaling of the sensors that recorded the run; a twin's own sensors do. Samples
after the end of a simulation are lost: NaN, flagged in `quality`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.errors import InputError
from sloshlab.modal.rig_beam import shapes_at
from sloshlab.recording import LOST, channels, quality_attributes
from sloshlab.rig import Rig
from sloshlab.twin.motion import Motion
from sloshlab.twin.simulation import Simulation
from sloshlab.units import SI_UNITS

FloatArray = npt.NDArray[np.float64]

LIQUID_FORCE: Final = "force_liquid"
"""Δf, the force of the liquid on the tank beyond that of frozen liquid; written in addition."""

_TANK_PLACES = ("tank", "tip", "roof", "control", "mean")
_KEPT = ("block_from", "block_to", "x_m")
ORDER_OF_DERIVATIVE: Final = {"displacement": 0, "velocity": 1, "acceleration": 2}


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """A simulated recording and the channels that the twin has no counterpart for."""

    recording: xr.Dataset
    left_out: tuple[str, ...]


def simulated_run(
    simulation: Simulation,
    recording: xr.Dataset,
    rig: Rig,
    *,
    attributes: Mapping[str, Any],
    seed: int | None = None,
) -> SimulatedRun:
    """Simulated channels under the names of a recording.

    Parameters
    ----------
    simulation : Simulation
        Driven by this recording, so at its rate and from its first sample on.
    recording : xarray.Dataset
        Names, places (`x_m`) and time of the channels.
    rig : Rig
        For accelerometers along the beam.
    attributes : mapping
        Global attributes that differ from those of the recording.
    seed : int, optional
        Of the noise of the twin's sensors.

    Raises
    ------
    InputError
        If none of the channels has a counterpart.
    """
    generator = None if seed is None else np.random.default_rng(seed)
    variables: dict[str, Any] = {}
    left_out = []
    for name in channels(recording):
        truth = true_channel(simulation, name, recording[name].attrs, rig, n_cells=_n_cells(recording))
        if truth is None:
            left_out.append(name)
            continue
        values = _as_read(simulation, name, truth, generator)
        variables[name] = _variable(values, recording.sizes["time"], recording[name].attrs)
    if not variables:
        raise InputError(
            "recording", got=f"channels {', '.join(left_out)}", allowed="a force or a motion of tank, beam or base"
        )
    described = {"quantity": "force", "block_from": "liquid", "block_to": "tank"}
    variables[LIQUID_FORCE] = _variable(simulation.tank_force_n, recording.sizes["time"], described)
    if simulation.time_s.size < recording.sizes["time"]:
        flags = np.zeros(recording.sizes["time"], dtype=np.uint8)
        flags[simulation.time_s.size :] = LOST
        variables["quality"] = ("time", flags, quality_attributes())
    simulated = xr.Dataset(variables, coords={"time": ("time", recording["time"].values, {"units": "s"})})
    simulated.attrs = {**recording.attrs, **attributes}
    return SimulatedRun(simulated, tuple(left_out))


def true_channel(
    motion: Motion, name: str, attributes: Mapping[str, Any], rig: Rig, *, n_cells: int = 1
) -> FloatArray | None:
    """What a perfect sensor of this name shows, or None where the twin has no such place.

    Forces are those of the structure or the shaker on the tank, or the reverse where `block_from` is the tank;
    each of several force cells carries an equal share.
    """
    quantity, _, place = name.partition("_")
    if quantity == "force":
        return _force(motion, place, attributes, n_cells)
    if quantity not in ORDER_OF_DERIVATIVE:
        return None
    order = ORDER_OF_DERIVATIVE[quantity]
    along = attributes.get("x_m")
    has_structure = motion.twin.structure is not None
    # the control accelerometer is on what the shaker moves: the tank, or the base where a structure carries the
    # tank
    if place.startswith("root") or along == 0.0 or (place.startswith("control") and has_structure):
        return motion.base_motion[:, order] if has_structure else None
    if place.startswith("beam"):
        return _along_beam(motion, along, order, rig)
    return _of_tank(motion, order) if place.startswith(_TANK_PLACES) else None


def _of_tank(motion: Motion, order: int) -> FloatArray:
    if order == 0:
        return motion.displacement_m
    return motion.velocity_m_per_s if order == 1 else motion.acceleration_m_per_s2


def _force(motion: Motion, place: str, attributes: Mapping[str, Any], n_cells: int) -> FloatArray | None:
    sign = -1.0 if attributes.get("block_from") == "tank" else 1.0
    if place.startswith("cell"):
        # cells carry equal shares: the twin's tank does not tilt
        return sign * motion.interface_force_n / n_cells
    return sign * motion.interface_force_n if place in ("interface", "total") else None


def _along_beam(motion: Motion, along: float | None, order: int, rig: Rig) -> FloatArray | None:
    described, structure = rig.structure, motion.twin.structure
    if along is None or structure is None or described is None or described.kind != "beam":
        return None
    shape = structure.shapes(shapes_at(described, [along]), [along])[0]
    return np.asarray(motion.base_motion[:, order] + motion.modes[:, order] @ shape)


def _as_read(
    simulation: Simulation, name: str, truth: FloatArray, generator: np.random.Generator | None
) -> FloatArray:
    for sensor in simulation.twin.sensors:
        if sensor.channel == name:
            return sensor.reading(truth, simulation.sampling_rate_hz, generator=generator)
    return truth


def _variable(values: FloatArray, n_samples: int, attributes: Mapping[str, Any]) -> tuple[str, FloatArray, Any]:
    padded = np.full(n_samples, np.nan)
    padded[: values.size] = values
    kept = {key: attributes[key] for key in _KEPT if key in attributes}
    return "time", padded, {"units": SI_UNITS[attributes["quantity"]], "quantity": attributes["quantity"], **kept}


def _n_cells(recording: xr.Dataset) -> int:
    return sum(name.startswith("force_cell") for name in channels(recording, "force"))
