"""An opened netCDF file to a recording in SI units; sizes are checked before anything is allocated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import xarray as xr

from sloshlab import limited_process
from sloshlab.errors import RecordingError
from sloshlab.out_of_core import blocks
from sloshlab.recording.attributes import (
    RunAttributes,
    attributes_of,
    channel_attributes,
    factor_to_si_of,
    validated_attributes,
)
from sloshlab.recording.channel_access import is_channel
from sloshlab.recording.time_axis import require_uniform_time, time_coordinate
from sloshlab.recording.validation import no_channel, require_lost_flagged
from sloshlab.units import SI_UNITS

MAXIMUM_DECODED_BYTES: Final = 6 * 2**30
"""Recordings that would need more memory than this once decoded are refused before allocation."""
_DECODING_BLOCK = 1 << 20
_SCALED_ATTRIBUTES = ("range_min", "range_max", "noise_std", "known_to")
_STORAGE_ATTRIBUTES = ("scale_factor", "add_offset", "_FillValue", "missing_value")


def decoded(source: Any, name: str, maximum_decoded_bytes: int) -> xr.Dataset:
    """The recording of an opened netCDF file.

    Parameters
    ----------
    source : netCDF4.Dataset
        Without automatic scaling.
    name : str
        Of the file, for messages.
    maximum_decoded_bytes : int

    Raises
    ------
    RecordingError
        If it is too large, or breaks the format.
    """
    attributes = validated_attributes(RunAttributes, attributes_of(source), what=name)
    if "time" not in source.dimensions or "time" not in source.variables:
        raise RecordingError(
            f"{name}: time",
            got="no dimension and coordinate 'time'",
            allowed="time(time), seconds from the trigger",
        )
    n_samples = len(source.dimensions["time"])
    _check_size(source, n_samples, name, maximum_decoded_bytes)
    time_variable = source.variables["time"]
    if time_variable.dimensions != ("time",) or np.dtype(time_variable.dtype) != np.float64:
        raise RecordingError(
            f"{name}: time", got=f"{time_variable.dtype}{time_variable.dimensions}", allowed="float64(time)"
        )
    units = attributes_of(time_variable).get("units", "s")
    if units not in ("s", "second", "seconds"):
        raise RecordingError(f"{name}: units of time", got=repr(units), allowed="'s', seconds from the trigger")
    time = limited_process.empty(n_samples, np.float64)
    for part in _stored_blocks(time_variable, time):
        time[part] = time_variable[part]
    require_uniform_time(time, attributes.sampling_rate_hz, name)
    variables: dict[str, xr.Variable] = {}
    for channel, variable in source.variables.items():
        if channel == "time":
            continue
        its_attributes = attributes_of(variable)
        if len(set(variable.dimensions)) < len(variable.dimensions):
            raise RecordingError(
                f"{name}: {channel}", got=f"dimensions {variable.dimensions}", allowed="each dimension once"
            )
        if is_channel(channel, variable.dimensions, its_attributes):
            variables[channel] = _decoded_channel(channel, variable, its_attributes, name)
        elif np.dtype(variable.dtype).kind in "fiub" or variable.dtype is str:
            stored = {key: value for key, value in its_attributes.items() if key != "_FillValue"}
            variables[channel] = xr.Variable(variable.dimensions, _as_stored(variable), stored)
    if not any("quantity" in variable.attrs for variable in variables.values()):
        raise no_channel(name)
    recording = xr.Dataset(variables, coords=time_coordinate(time), attrs=attributes_of(source))
    recording["time"].attrs["units"] = "s"
    require_lost_flagged(recording, name)
    return recording


def _check_size(source: Any, n_samples: int, name: str, maximum_decoded_bytes: int) -> None:
    if n_samples == 0:
        raise RecordingError(f"{name}: time", got="0 samples", allowed="≥ 2 samples", remedy="record again")
    if n_samples == 1:
        raise RecordingError(f"{name}: time", got="1 sample", allowed="≥ 2 samples", remedy="record again")
    needed = 0
    for variable in source.variables.values():
        size = 1
        for dimension in variable.dimensions:
            size *= len(source.dimensions[dimension])
        # declared sizes, eight bytes each once decoded; nothing is read yet
        needed += 8 * size
    if needed > maximum_decoded_bytes:
        raise RecordingError(
            f"{name}: size",
            got=f"{n_samples} samples, {needed / 2**30:.1f} GiB decoded",
            allowed=f"≤ {maximum_decoded_bytes / 2**30:.1f} GiB",
            remedy="split the run into shorter files",
        )


def _decoded_channel(channel: str, variable: Any, attributes: dict[str, Any], name: str) -> xr.Variable:
    described = channel_attributes(channel, attributes, name)
    factor = factor_to_si_of(channel, described, name)
    kind = np.dtype(variable.dtype).kind
    if kind not in "fiu":
        raise RecordingError(f"{name}: {channel}", got=f"values of type {variable.dtype}", allowed="numbers")
    # units once, on reading: counts go to SI in one multiplication
    scale = _number(attributes, "scale_factor", 1.0, channel, name) * factor
    offset = _number(attributes, "add_offset", 0.0, channel, name) * factor
    fill = attributes.get("_FillValue", attributes.get("missing_value"))
    values = _decoded_values(variable, scale, offset, None if fill is None or np.ndim(fill) else fill)
    kept = {key: value for key, value in attributes.items() if key not in _STORAGE_ATTRIBUTES}
    kept["units"] = SI_UNITS[described.quantity]
    if kind in "iu":
        # clipping is judged by half a step of the converter, which floats no longer show
        kept["adc_step"] = abs(scale)
    for key in _SCALED_ATTRIBUTES:
        if key in kept:
            kept[key] = float(kept[key]) * factor
    return xr.Variable(("time",), values, kept)


def _decoded_values(variable: Any, scale: float, offset: float, fill: float | None) -> np.ndarray:
    """Counts × scale + offset, NaN where they are the fill value.

    Block by block, so that only the result is large. Up to 16 bits float32 has no rounding that matters.
    """
    stored = np.dtype(variable.dtype)
    # 24 bits of precision are enough for 16 of a converter, unless a large offset takes them
    few_bits = stored.kind in "iu" and stored.itemsize <= 2 and abs(offset) <= 2**15 * abs(scale)
    values = limited_process.empty(len(variable), np.float32 if few_bits or stored == np.float32 else np.float64)
    for at in _stored_blocks(variable, values):
        raw, part = variable[at], values[at]
        np.multiply(raw, values.dtype.type(scale), out=part, dtype=values.dtype)
        if offset:
            np.add(part, values.dtype.type(offset), out=part)
        if fill is not None:
            part[raw == fill] = np.nan
    return values


def _as_stored(variable: Any) -> np.ndarray:
    """Values of a variable that is no channel, those over time block by block."""
    if variable.dimensions != ("time",) or variable.dtype is str:
        return np.asarray(variable[...])
    values = limited_process.empty(len(variable), variable.dtype)
    for part in _stored_blocks(variable, values):
        values[part] = variable[part]
    return values


def _stored_blocks(variable: Any, values: np.ndarray) -> Iterator[slice]:
    """Parts of a variable over time as it is stored; of its values only one is in memory where they are large."""
    storage = variable.chunking()
    if isinstance(storage, list):
        # each chunk is wanted once: kept, up to 64 MB of every channel would be
        variable.set_var_chunk_cache(size=0, nelems=1, preemption=1.0)
    # not more at once than a file may declare as one chunk
    block = min(storage[0], len(variable)) if isinstance(storage, list) else _DECODING_BLOCK
    # whole storage chunks, or each would be decompressed twice
    return blocks(len(variable), values, of=max(block, _DECODING_BLOCK // block * block))


def _number(attributes: Mapping[str, Any], key: str, default: float, channel: str, name: str) -> float:
    value = attributes.get(key, default)
    if isinstance(value, str) or np.ndim(value) != 0 or not np.isfinite(value):
        raise RecordingError(f"{name}: {channel}: {key}", got=repr(value), allowed="a finite number")
    return float(value)
