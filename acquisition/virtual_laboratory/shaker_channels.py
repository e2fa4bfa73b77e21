"""What the sensors of the shaker give."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from acquisition.virtual_laboratory.sensors import (
    ACCELEROMETERS,
    FORCE_CELLS,
    Laboratory,
    Reading,
    cell_forces,
    reading,
)
from acquisition.virtual_laboratory.tone_motion import Accelerated
from sloshlab.recording import CLIPPED, LOST, STUCK, quality_attributes

FloatArray = NDArray[np.float64]


def readings_of(
    external_force_n: FloatArray,
    moved: Accelerated,
    time_s: FloatArray,
    laboratory: Laboratory,
    *,
    seed: int,
    noisy: bool,
    n_clipped: int,
) -> dict[str, Reading]:
    """Read force cells and accelerometers, one after the other in the order of the channels.

    Parameters
    ----------
    external_force_n : ndarray, shape (n,)
        F_ext, upward positive, without the weight.
    moved : Accelerated
        Motion of the tank.
    time_s : ndarray, shape (n,)
    laboratory : Laboratory
        Gains and offsets.
    seed : int
        Of the noise.
    noisy : bool
    n_clipped : int
        About so many samples of the first force cell.
    """
    forces = cell_forces(external_force_n, time_s, laboratory)
    truths = dict(zip(FORCE_CELLS, forces, strict=True))
    truths.update(dict.fromkeys(ACCELEROMETERS, moved.acceleration))
    # one after the other in the order of the channels: the recordings of raw_data, made again, are the same bytes
    generator = np.random.default_rng([seed, 2])
    return {
        name: reading(
            truth,
            quantity=name.partition("_")[0],
            gain=laboratory.gain[name],
            offset_share=laboratory.offset_share[name],
            generator=generator,
            noisy=noisy,
            n_clipped=n_clipped if name == FORCE_CELLS[0] else 0,
        )
        for name, truth in truths.items()
    }


def recording_of(
    time_s: FloatArray,
    readings: Mapping[str, Reading],
    lost_samples: NDArray[np.bool_],
    attributes: Mapping[str, Any],
) -> xr.Dataset:
    """The recording of what was read, with the flags of its samples.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
    readings : mapping of str to Reading
    lost_samples : ndarray of bool, shape (n,)
    attributes : mapping
        Global ones.
    """
    variables: dict[str, xr.Variable] = {}
    flags = np.where(lost_samples, np.uint8(LOST), np.uint8(0)).astype(np.uint8)
    for name, its_reading in readings.items():
        variables[name] = xr.Variable(
            ("time",),
            its_reading.values,
            _channel_attributes(name, its_reading),
            {"scale_factor": its_reading.step},
        )
        flags[its_reading.clipped] |= CLIPPED
    if flags.any():
        variables["quality"] = xr.Variable(("time",), flags, _legend())
    return xr.Dataset(variables, coords={"time": ("time", time_s, {"units": "s"})}, attrs=dict(attributes))


def _legend() -> dict[str, Any]:
    """What the bits of `quality` mean."""
    legend = quality_attributes()
    # the recordings in raw_data do not name the flag of stuck sensors; made again, they must be the same bytes
    is_named = legend["flag_masks"] != STUCK
    meanings = itertools.compress(legend["flag_meanings"].split(), is_named)
    return {"flag_masks": legend["flag_masks"][is_named], "flag_meanings": " ".join(meanings)}


def _channel_attributes(name: str, its_reading: Reading) -> dict[str, Any]:
    quantity = name.partition("_")[0]
    attributes: dict[str, Any] = {
        "units": {"force": "N", "acceleration": "m s-2"}[quantity],
        "quantity": quantity,
        "range_min": -its_reading.half_scale,
        "range_max": its_reading.half_scale,
        "noise_std": its_reading.noise_std,
    }
    if quantity == "force":
        attributes.update(block_from="shaker", block_to="tank")
    return attributes
