"""A simulation as a recording: the channels of the run that drove it, under the same names, simulated.

Channels carry no noise, range or scaling of the sensors that recorded the run; a twin's own sensors do. Samples
after the end of a simulation are lost: NaN, flagged in `quality`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.errors import InputError
from sloshlab.modal.rig_beam import shapes_at
from sloshlab.recording import LOST, channels, quality_attributes
from sloshlab.rig import Rig
from sloshlab.twin.blocks import Blocks
from sloshlab.twin.motion import Motion
from sloshlab.twin.simulation import Simulation
from sloshlab.units import SI_UNITS

FloatArray = npt.NDArray[np.float64]

LIQUID_FORCE: Final = "force_liquid"
"""Δf, the force of the liquid on the tank beyond that of frozen liquid; written in addition."""

_TANK_PLACES = ("tank", "tip", "roof", "control", "mean")
_KEPT = ("block_from", "block_to", "x_m")
_N_OTHER_ROWS: Final = 5
"""Beside the modes: motion of the base, force of the terms on the tank, external force."""
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
    weights = channel_weights(motion.twin, name, attributes, rig, n_cells=n_cells)
    return None if weights is None else combined(rows_of(motion), weights)


def rows_of(motion: Motion) -> list[FloatArray]:
    """What channels are made of: q, q̇, q̈ mode by mode, u, u̇, ü of the base, Δf and external force on the tank."""
    modes = [motion.modes[:, order, j] for order in range(3) for j in range(motion.modes.shape[2])]
    return [*modes, *motion.base_motion.T, motion.tank_force_n, motion.external_force_n]


def channel_weights(
    twin: Blocks, name: str, attributes: Mapping[str, Any], rig: Rig, *, n_cells: int = 1
) -> FloatArray | None:
    """The channel of `true_channel` as weights of `rows_of` a motion of this twin, shape (3 n_modes + 5,)."""
    quantity, _, place = name.partition("_")
    if quantity == "force":
        return _force(twin, place, attributes, n_cells)
    if quantity not in ORDER_OF_DERIVATIVE:
        return None
    order, has_structure = ORDER_OF_DERIVATIVE[quantity], twin.structure is not None
    along = attributes.get("x_m")
    # the control accelerometer is on what the shaker moves: the tank, or the base where a structure carries the
    # tank
    if place.startswith("root") or along == 0.0 or (place.startswith("control") and has_structure):
        return _moving(twin, order, np.zeros(_n_modes(twin))) if has_structure else None
    if place.startswith("beam"):
        shape = _shape_along_beam(twin, along, rig)
        return None if shape is None else _moving(twin, order, shape)
    return _of_tank(twin, order) if place.startswith(_TANK_PLACES) else None


def combined(rows: Sequence[FloatArray], weights: FloatArray) -> FloatArray:
    """Sum of weighted rows, shape (n,); rows of no weight are not read."""
    total = np.zeros(rows[-1].size)
    for i in np.flatnonzero(weights).tolist():
        _add(weights[i], rows[i], total)
    return total


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _add(weight: float, row: FloatArray, total: FloatArray) -> None:
    for i in range(total.size):
        total[i] += weight * row[i]


def _n_modes(twin: Blocks) -> int:
    return 0 if twin.structure is None else twin.structure.masses_kg.size


def _moving(twin: Blocks, order: int, shape: FloatArray) -> FloatArray:
    """Absolute motion of a place of this deflection per mode."""
    n = _n_modes(twin)
    weights = np.zeros(3 * n + _N_OTHER_ROWS)
    weights[order * n : (order + 1) * n] = shape
    weights[3 * n + order] = 1.0
    return weights


def _of_tank(twin: Blocks, order: int) -> FloatArray:
    return _moving(twin, order, np.zeros(0) if twin.structure is None else twin.structure.mode_shape)


def _force(twin: Blocks, place: str, attributes: Mapping[str, Any], n_cells: int) -> FloatArray | None:
    if not (place.startswith("cell") or place in ("interface", "total")):
        return None
    # (1.19) solved for the force: F_ext = (M_dry + m_l) ü − Δf
    weights = twin.carried_mass_kg * _of_tank(twin, 2)
    weights[-2:] = -1.0
    sign = -1.0 if attributes.get("block_from") == "tank" else 1.0
    # cells carry equal shares: the twin's tank does not tilt
    return sign * weights / (n_cells if place.startswith("cell") else 1)


def _shape_along_beam(twin: Blocks, along: float | None, rig: Rig) -> FloatArray | None:
    described, structure = rig.structure, twin.structure
    if along is None or structure is None or described is None or described.kind != "beam":
        return None
    return np.asarray(structure.shapes(shapes_at(described, [along]), [along])[0])


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
