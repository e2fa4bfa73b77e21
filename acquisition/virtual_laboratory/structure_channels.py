"""What the sensors of the beam and of the guided tank give."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from acquisition.virtual_laboratory.sensors import Reading, reading
from acquisition.virtual_laboratory.structure_computation import ComputedStructure
from acquisition.virtual_laboratory.structure_rig import StructureLaboratory, StructureRig
from sloshlab.channel_names import ACCELERATION_ROOT, ACCELERATION_TIP, DISPLACEMENT_TANK, FORCE_INTERFACE

FloatArray = NDArray[np.float64]

_NOISY_HALF_SCALE_COUNTS: Final = 8000


def true_values(
    rig: StructureRig, computed: ComputedStructure, base_m_per_s2: FloatArray, base_m: FloatArray
) -> dict[str, FloatArray]:
    """Return what perfect sensors would show, by the names of the channels.

    Parameters
    ----------
    rig : StructureRig
    computed : ComputedStructure
        Motion and force.
    base_m_per_s2, base_m : ndarray, shape (n,)
        Acceleration and displacement of the base.

    Returns
    -------
    dict
        SI units, upward positive. `force_interface` is the force of the structure on the tank, M_dry ü − F_S,
        without the weight; `displacement_tank` is that in the laboratory.
    """
    modal, shape = computed.modal_acceleration_m_per_s2, rig.structure.shape_at_tank
    tip = base_m_per_s2 + modal @ shape
    truths = {
        # of the structure on the tank: what moves the dry mass beside the liquid
        FORCE_INTERFACE: rig.dry_mass_kg * tip - computed.liquid_force_n,
        ACCELERATION_TIP: tip,
        DISPLACEMENT_TANK: base_m + computed.modal_displacement_m @ shape,
    }
    if rig.is_beam:
        truths[ACCELERATION_ROOT] = base_m_per_s2
        for k, its_shape in enumerate(rig.shapes, start=1):
            truths[f"acceleration_beam_{k}"] = base_m_per_s2 + modal @ its_shape
    return truths


def readings_of(
    truths: Mapping[str, FloatArray], truth: StructureLaboratory, *, seed: int, noisy: bool
) -> dict[str, Reading]:
    """Read all channels.

    Parameters
    ----------
    truths : mapping of str to ndarray
        From `true_values`.
    truth : StructureLaboratory
        Gains and offsets.
    seed : int
        Of the noise.
    noisy : bool
    """
    generator = np.random.default_rng([seed, 2])
    return {
        name: reading(
            values,
            quantity=name.partition("_")[0],
            gain=truth.sensors.gain[name],
            offset_share=truth.sensors.offset_share[name],
            generator=generator,
            noisy=noisy,
            noisy_half_scale_counts=_NOISY_HALF_SCALE_COUNTS,
        )
        for name, values in truths.items()
    }


def recording_of(
    readings: Mapping[str, Reading], rig: StructureRig, sampling_rate_hz: float, attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Arrange readings as a recording.

    Parameters
    ----------
    readings : mapping of str to Reading
    rig : StructureRig
    sampling_rate_hz : float
    attributes : mapping
        Global ones.
    """
    variables = {
        name: xr.Variable(
            ("time",),
            its_reading.values,
            _channel_attributes(name, its_reading, rig),
            {"scale_factor": its_reading.step},
        )
        for name, its_reading in readings.items()
    }
    n_samples = next(iter(readings.values())).counts.size
    time_s = np.arange(n_samples) / sampling_rate_hz
    return xr.Dataset(variables, coords={"time": ("time", time_s, {"units": "s"})}, attrs=dict(attributes))


def _channel_attributes(name: str, its_reading: Reading, rig: StructureRig) -> dict[str, Any]:
    quantity = name.partition("_")[0]
    attributes: dict[str, Any] = {
        "units": {"force": "N", "acceleration": "m s-2", "displacement": "m"}[quantity],
        "quantity": quantity,
        "range_min": -its_reading.half_scale,
        "range_max": its_reading.half_scale,
        "noise_std": its_reading.noise_std,
    }
    if quantity == "force":
        attributes.update(block_from="beam" if rig.is_beam else "structure", block_to="tank")
    if rig.is_beam and quantity == "acceleration":
        attributes["x_m"] = _place_m(name, rig)
    return attributes


def _place_m(name: str, rig: StructureRig) -> float:
    """Where an accelerometer of the beam is, from the root."""
    if name == ACCELERATION_ROOT:
        return 0.0
    places = (*rig.places_m, rig.length_m)
    return places[-1] if name == ACCELERATION_TIP else places[int(name.rpartition("_")[2]) - 1]
