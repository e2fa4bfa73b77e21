"""Records of a benchmark as runs of a case."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from pipelines.field_benchmarks.definition import Record
from sloshlab.identification.case import CaseRun
from sloshlab.recording import run_attributes, write_recording
from sloshlab.units import SI_UNITS

_START: Final = "2000-01-01T00:00:00Z"
"""Recordings have a start; benchmarks state none, and nothing depends on it."""


def recording_of(record: Record) -> xr.Dataset:
    """The record in the recording format; each is a test of its own."""
    channels = {name: ("time", values, _attributes(record, name)) for name, values in record.channels.items()}
    attributes = {
        "sloshlab_format": "1",
        "run_id": record.name,
        "test": record.name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "benchmark",
        "sampling_rate_hz": record.sampling_rate_hz,
        "start_time_utc": _START,
    }
    time = np.arange(record.n_samples) / record.sampling_rate_hz
    return xr.Dataset(channels, coords={"time": time}, attrs=attributes)


def _attributes(record: Record, name: str) -> dict[str, Any]:
    quantity = name.partition("_")[0]
    found: dict[str, Any] = {"units": SI_UNITS[quantity], "quantity": quantity}
    if quantity == "voltage":
        # Levels and outputs of circuits are read in volts whose zero is that of what is measured.
        found["zero_is_known"] = 1
    if name in record.noise_std:
        found["noise_std"] = record.noise_std[name]
    return found


def run_of(record: Record) -> CaseRun:
    """The record as a run."""
    recording = recording_of(record)
    return CaseRun(record.name, recording, run_attributes(recording))


def write_case(records: tuple[Record, ...], folder: Path) -> Path:
    """Write a case folder for ``sloshlab diagnose``; returns it.

    Parameters
    ----------
    records : tuple of Record
    folder : Path
    """
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    for record in records:
        write_recording(recording_of(record), folder / "recordings" / f"{record.name}.nc")
    return folder
