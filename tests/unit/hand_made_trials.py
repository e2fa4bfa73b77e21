"""Trials without a laboratory: tiny cases, truths and a stand-in for the diagnosis."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from sealed_trial.case_drawing import HiddenTruth
from sealed_trial.sealing.trial_folder import Commitments, _written

KEY = bytes(range(32))


def effect(name: str, block: str = "structure", strength: float = 10.0, **parameters: float) -> dict[str, Any]:
    """A true effect."""
    return {"name": name, "block": block, "parameters": parameters, "strength": strength}


def truth(case: str, kind: str, *effects: dict[str, Any], accepted: list[list[str]] | None = None) -> HiddenTruth:
    """A truth; its own names are accepted if nothing else is said."""
    names = [[effect["name"] for effect in effects]] if accepted is None else accepted
    return HiddenTruth(case, kind, list(effects), names)


def written_trial(folder: Path, truths: list[HiddenTruth], key: bytes | None) -> Commitments:
    """A sealed (or, without a key, a development) trial whose recordings are noise of a few samples."""
    for its_truth in truths:
        place = folder / "cases" / its_truth.case
        (place / "recordings").mkdir(parents=True)
        (place / "rig.toml").write_text("[tank]\n")
        counts = np.random.default_rng([int(its_truth.case[-3:])]).integers(-3000, 3000, 40).astype(np.int16)
        written_recording(place / "recordings" / "run_01.nc", counts)
    purpose = "development" if key is None else "sealed"
    by_case = {its_truth.case: its_truth for its_truth in truths}
    return _written(folder, by_case, purpose=purpose, seed=1, key=key, secret=b"secret")


def written_recording(path: Path, counts: np.ndarray) -> None:
    """A recording of one channel as a laboratory stores it."""
    time = ("time", np.arange(counts.size) / 100.0, {"units": "s"})
    described = {"units": "N", "quantity": "force", "scale_factor": 0.002}
    dataset = xr.Dataset({"force_tank": ("time", counts, described)}, coords={"time": time}, attrs={"run_id": "r"})
    dataset.to_netcdf(path, format="NETCDF4", engine="netcdf4", encoding={"force_tank": {"_FillValue": None}})


DIAGNOSIS = """
import json, os, pathlib, sys, time
case, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
with open(output / "calls.txt", "a") as file:
    file.write("called\\n")
if case.name == "case_002":
    sys.exit("no way through")
if case.name == "case_003":
    time.sleep(60)
(output / "verdict.json").write_text(json.dumps({"verdict": "nothing_missing", "effects": []}))
"""


def stand_in(folder: Path) -> tuple[str, ...]:
    """A diagnosis that answers, crashes in case 2 and takes a minute for case 3."""
    script = folder / "stand_in.py"
    script.write_text(DIAGNOSIS)
    return sys.executable, str(script)
