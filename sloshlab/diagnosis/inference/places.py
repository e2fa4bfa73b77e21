"""Places of a remainder: how a force of structure or tank, or an error of a sensor, shows in all channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel, ModelOfBlocks
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.identification.rig_parameters import retuned_structure
from sloshlab.missing_force.force_inversion import ORDERS, modal_weights, response
from sloshlab.missing_force.probed_transfers import probed_transfers
from sloshlab.missing_physics.extension import NOTHING
from sloshlab.twin.structure import Structure

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SENSOR: Final = "sensor"
ELSEWHERE: Final = "structure elsewhere"
"""Of a user's own twin, which says of one coordinate alone how a force on it shows."""
STRUCTURE, TANK = "structure", "tank"
PLACES_IN_A_BAND: Final = 32
"""Frequencies at which a transfer is averaged: the half-width of a resonance is a tenth of a band."""


def block_of(place: str) -> str:
    """Block to which a place belongs.

    Examples
    --------
    >>> block_of("sensor force_cell_1"), block_of("tank")
    ('sensor', 'tank')
    """
    return place.partition(" ")[0]


def transfers_of(
    model: DiagnosedModel,
    run: Sequence[Observation],
    values: Mapping[str, float],
    frequencies_hz: FloatArray | None = None,
) -> dict[str, ComplexArray]:
    """Readings of the channels per force at each place, shape (n_frequencies, n_channels).

    Parameters
    ----------
    model : DiagnosedModel
        Of a user's own twin the transfer is probed by a pulse; none is known where that does not end.
    run : sequence of Observation
    values : mapping
        Of the baseline.
    frequencies_hz : ndarray, optional
        Those of the bands by default.
    """
    if isinstance(model, ModelOfBlocks):
        at_hz = run[0].frequencies_hz if frequencies_hz is None else frequencies_hz
        channels = model.compared(run[0].run)
        chosen = [channels.index(each.channel) for each in run]
        found = model.block_transfers(run[0].run, values, at_hz)
        return {place: transfers[:, chosen] for place, transfers in found.items()}
    if not isinstance(model, RigModel):
        return _probed(model, run, values)
    structure = None if model.twin.structure is None else retuned_structure(model.twin.structure, values)
    carried_kg = model.twin.carried_mass_kg * values.get("carried mass", 1.0)
    n_cells = sum(each.channel.startswith("force_cell") for each in run)
    shares = np.array([1 / n_cells if each.channel.startswith("force_cell") else 1.0 for each in run])
    at_hz = run[0].frequencies_hz if frequencies_hz is None else frequencies_hz
    return {
        place: shares
        * np.stack([_transfer(model, structure, carried_kg, each, place, at_hz) for each in run], axis=1)
        for place in (STRUCTURE, TANK)
    }


def _probed(
    model: DiagnosedModel, run: Sequence[Observation], values: Mapping[str, float]
) -> dict[str, ComplexArray]:
    """Of every band the line at which a force shows most over the noise of the channels."""
    try:
        probed = probed_transfers(model, run[0].run, values, NOTHING)
    except SloshlabError:
        return {}
    lines = np.stack([probed.readings[each.channel] for each in run], axis=1)
    bands = run[0].frequencies_hz
    of_line = np.clip(np.searchsorted(bands, probed.frequency_hz - 0.5 * (bands[1] - bands[0])), 0, bands.size - 1)
    noise = np.stack([np.median(each.variance, axis=0) for each in run], axis=1)[of_line]
    shown = (np.abs(lines) ** 2 / noise).sum(axis=1)
    found = np.zeros((bands.size, len(run)), np.complex128)
    for band in range(bands.size):
        own = np.flatnonzero(of_line == band)
        if own.size:
            found[band] = lines[own[np.argmax(shown[own])]]
    return {STRUCTURE: found}


def _transfer(
    model: RigModel,
    structure: Structure | None,
    carried_kg: float,
    observation: Observation,
    place: str,
    frequency: FloatArray,
) -> ComplexArray:
    """Reading of a channel per force at a place, shape (n_frequencies,)."""
    attributes, name = observation.run.recording[observation.channel].attrs, observation.channel
    if name.startswith("force"):
        # F = M ü − f between structure and tank: a force on the tank moves it and is itself seen by the cell, one
        # on the structure only moves it.
        moved = np.zeros(frequency.size, complex)
        if structure is not None:
            moved = carried_kg * response(structure, structure.mode_shape, 2, frequency)
        sign = -1.0 if attributes.get("block_from") == "tank" else 1.0
        return np.asarray(sign * (moved - (1.0 if place == TANK else 0.0)), np.complex128)
    weights = None if structure is None else modal_weights(structure, model.rig, name, attributes.get("x_m"))
    if structure is None or weights is None:
        return np.zeros(frequency.size, np.complex128)
    return np.asarray(response(structure, weights, ORDERS[name.partition("_")[0]], frequency), np.complex128)
