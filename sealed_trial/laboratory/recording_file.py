"""Recordings as files of the recording format, written with xarray alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from sealed_trial.laboratory.hidden_rig import HiddenRig
from sealed_trial.laboratory.sensors import Sensor
from sealed_trial.laboratory.test_plan import RunPlan, TestPlan

_UNITS = {"force": "N", "acceleration": "m s-2", "displacement": "m"}


def run_attributes(number: int, run: RunPlan, plan: TestPlan) -> dict[str, Any]:
    """Global attributes: what was done, nothing about what came of it."""
    attributes: dict[str, Any] = {
        "sloshlab_format": "1",
        "run_id": f"run_{number:02d}",
        "experiment": _experiment(run, plan),
        "configuration": "sloshing",
        "rig": "rig.toml",
        "sampling_rate_hz": float(plan.sampling_rate_hz),
        "start_time_utc": f"2026-03-02T{9 + number // 6:02d}:{10 * (number % 6):02d}:00Z",
        "repeat": run.repeat,
    }
    if run.motion == "free":
        attributes["initial_displacement_m"] = run.level
    elif run.motion == "random":
        attributes["acceleration_rms_g"] = run.level
    else:
        attributes["acceleration_g"] = run.level
    if run.motion == "swept":
        attributes["sweep_start_hz"] = run.frequencies_hz[0]
        # of the whole motion, which is a little longer than the recording
        octaves = float(np.log2(run.frequencies_hz[1] / run.frequencies_hz[0]))
        attributes["sweep_rate_octave_per_s"] = octaves / (run.duration_s + 0.2)
    return attributes


def _experiment(run: RunPlan, plan: TestPlan) -> str:
    if plan.kind == "shaker":
        return {"swept": "shaker_sweep", "wandering": "shaker_vfa"}.get(run.motion, "other")
    if run.motion == "free":
        return f"{plan.kind}_free"
    return "beam_random" if plan.kind == "beam" and run.motion == "random" else "other"


def write_recording(
    path: Path,
    counts: dict[str, npt.NDArray[np.int16]],
    sensors: dict[str, Sensor],
    rig: HiddenRig,
    attributes: dict[str, Any],
) -> None:
    """Write one run: counts with their scale, time, attributes."""
    rate = attributes["sampling_rate_hz"]
    encoding: dict[str, dict[str, Any]] = {}
    variables = {}  # the counts themselves, with their scale as an attribute
    for name, values in counts.items():
        sensor = sensors[name]
        variables[name] = ("time", values, _channel_attributes(name, sensor, rig))
        encoding[name] = {"zlib": True, "complevel": 4, "_FillValue": None}
    n_samples = next(iter(counts.values())).size
    time = ("time", np.arange(n_samples) / rate, {"units": "s"})
    encoding["time"] = {"dtype": "float64", "zlib": True, "complevel": 4, "_FillValue": None}
    dataset = xr.Dataset(variables, coords={"time": time}, attrs=attributes)
    dataset.to_netcdf(path, format="NETCDF4", engine="netcdf4", encoding=encoding)


def _channel_attributes(name: str, sensor: Sensor, rig: HiddenRig) -> dict[str, Any]:
    quantity = name.partition("_")[0]
    attributes: dict[str, Any] = {
        "units": _UNITS[quantity],
        "quantity": quantity,
        "range_min": -sensor.half_scale,
        "range_max": sensor.half_scale,
        "noise_std": sensor.stated_noise,
        "scale_factor": sensor.step,
    }
    if quantity == "force":
        source = {"beam": "beam", "sdof": "structure", "shaker": "shaker"}[rig.kind]
        attributes.update(block_from=source, block_to="tank")
    if rig.kind == "beam" and quantity == "acceleration":
        places = dict(zip(("beam_1", "beam_2", "beam_3", "tip"), rig.places_m(), strict=True))
        attributes["x_m"] = float({"root": 0.0, **places}[name.partition("_")[2]])
    return attributes
