"""Recordings as they are handed over: files, data sets in memory, trees of data sets."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from sloshlab.errors import InputError, RecordingError
from sloshlab.recording import (
    RunAttributes,
    channels,
    read_attributes,
    read_recording,
    run_attributes,
    validate_recording,
)
from sloshlab.units import SI_UNITS, factor_to_si

_SCALED_ATTRIBUTES = ("range_min", "range_max", "noise_std", "known_to", "adc_step")
"""Of a channel, in its units."""


def work_of(runs: Iterable[RunSource]) -> list[float]:
    """Work that each recording makes, in proportion, for the time left: bytes of files, or of arrays in memory.

    A file that cannot be read is none; whoever reads it says so.
    """
    return [
        float(run.recording.nbytes)
        if isinstance(run, RecordingInMemory)
        else float(run.is_file() and os.path.getsize(run))
        for run in runs
    ]


@dataclass(frozen=True, eq=False)
class RecordingInMemory:
    """A recording that is no file.

    Attributes
    ----------
    name : str
        What it is called in messages, reports and provenance.
    recording : xarray.Dataset
        In the recording format, channels in SI units.
    """

    name: str
    recording: xr.Dataset

    def __str__(self) -> str:
        return self.name

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of names, values and attributes; the same content has the same hash."""
        digest = hashlib.sha256(_as_bytes(self.recording.attrs))
        for name in sorted(map(str, self.recording.variables)):
            variable = self.recording[name]
            described = [name, list(map(str, variable.dims)), variable.dtype.str, list(variable.shape)]
            digest.update(json.dumps(described).encode())
            digest.update(_as_bytes(variable.attrs))
            digest.update(np.ascontiguousarray(variable.values).tobytes())
        return digest.hexdigest()

    @classmethod
    def of(cls, recording: xr.Dataset, name: str = "") -> RecordingInMemory:
        """A data set that keeps the recording format; channels are brought to SI units, in a copy.

        Parameters
        ----------
        recording : xarray.Dataset
            As `sloshlab.open_recording` gives it, upward positive.
        name : str
            By default its `run_id`.

        Raises
        ------
        RecordingError
            If it breaks the format.
        """
        named = name or str(recording.attrs.get("run_id", "recording in memory"))
        time = recording.coords.get("time")
        if time is not None and time.dtype.kind != "f":
            raise RecordingError(
                f"{named}: time",
                got=f"values of type {time.dtype}",
                allowed="seconds as float64",
                remedy="read the file with sloshlab.open_recording",
            )
        validate_recording(recording, name=named)
        return cls(named, _in_si(recording))


RunSource = Path | RecordingInMemory
"""One recording, as pipelines take it."""

RunLike = str | os.PathLike[str] | xr.Dataset | RecordingInMemory
RunsLike = RunLike | xr.DataTree | Mapping[str, RunLike] | Iterable[RunLike]
"""One or several recordings, as people hand them over."""


def recording_of(source: RunSource) -> xr.Dataset:
    """The recording, validated and in SI units.

    Raises
    ------
    RecordingError
        If the file is none.
    """
    return read_recording(source) if isinstance(source, Path) else source.recording


def attributes_of(source: RunSource) -> RunAttributes:
    """The validated global attributes of a recording.

    Raises
    ------
    RecordingError
        If the file cannot be opened, or an attribute is missing or of a wrong type.
    """
    if isinstance(source, Path):
        return read_attributes(source)
    return run_attributes(source.recording, name=source.name)


def run_sources(runs: RunsLike) -> list[RunSource]:
    """Recordings as pipelines take them, in the order given.

    Parameters
    ----------
    runs : path, xarray.Dataset, xarray.DataTree, or several of them
        A tree counts as all recordings in it, called by their paths; so does a mapping, called by its keys.

    Raises
    ------
    RecordingError
        If a data set breaks the format.
    InputError
        If there is nothing, or something else than a recording.
    """
    found = list(_sources(runs))
    if not found:
        raise InputError("recordings", got="none", allowed="at least one file or data set")
    return found


def run_source(run: RunLike, name: str = "") -> RunSource:
    """One recording as pipelines take it; `name` is for a data set.

    Raises
    ------
    InputError
        If it is no recording.
    """
    if isinstance(run, RecordingInMemory):
        return run
    if isinstance(run, xr.Dataset):
        return RecordingInMemory.of(run, name)
    if isinstance(run, str | os.PathLike):
        return Path(run)
    allowed = "a path, an xarray.Dataset or an xarray.DataTree"
    raise InputError("recording", got=f"an object of type {type(run).__name__}", allowed=allowed)


def _sources(runs: RunsLike) -> Iterator[RunSource]:
    if isinstance(runs, xr.DataTree):
        for node in runs.subtree:
            if node.data_vars:
                yield run_source(node.to_dataset(inherit=True), node.path.strip("/"))
    elif isinstance(runs, xr.Dataset | str | os.PathLike | RecordingInMemory):
        yield run_source(runs)
    elif isinstance(runs, Mapping):
        for name, run in runs.items():
            yield run_source(run, str(name))
    elif isinstance(runs, Iterable):
        for run in runs:
            yield run_source(run)
    else:
        yield run_source(runs)


def _in_si(recording: xr.Dataset) -> xr.Dataset:
    """The recording with channels in SI units; arrays that are so already are shared, not copied."""
    converted: dict[str, xr.Variable] = {}
    for name in channels(recording):
        variable = recording[name].variable
        quantity = variable.attrs["quantity"]
        factor = factor_to_si(variable.attrs["units"], quantity)
        if factor == 1.0 and variable.dtype.kind == "f":
            continue
        scaled = {key: float(variable.attrs[key]) * factor for key in _SCALED_ATTRIBUTES if key in variable.attrs}
        attributes = {**variable.attrs, **scaled, "units": SI_UNITS[quantity]}
        converted[name] = xr.Variable(variable.dims, variable.values.astype(np.float64) * factor, attributes)
    return recording.assign(converted)


def _as_bytes(attributes: Mapping[Any, Any]) -> bytes:
    def plain(value: Any) -> Any:
        return value.tolist() if isinstance(value, np.ndarray | np.generic) else repr(value)

    return json.dumps(
        {str(key): value for key, value in attributes.items()}, sort_keys=True, default=plain
    ).encode()
