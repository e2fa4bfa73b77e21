"""The Silverbox diagnosed with a twin of its own: ``python docs/examples/silverbox_diagnosis.py FOLDER CASE``.

Three realisations of the multisine, all before the last quarter that is for the test, become the recordings of
CASE; they are diagnosed with `silverbox_twin.py`. Only then are the last quarter and the arrow simulated,
free-running, by the baseline, the retuned baseline and the extended twin, without the first 50 samples.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.io import loadmat

from sloshlab.identification.case import CaseRun
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.recording import run_attributes, write_recording
from sloshlab.user_twin import UserTwinModel, load_extended, load_user_twin

TWIN = Path(__file__).with_name("silverbox_twin.py")
RATE_HZ = 1e7 / 2**14
MULTISINE, ARROW = slice(40_650, 127_400), slice(100, 40_575)
REALISATION, LENGTH, N_RUNS = 8692, 4346, 3
TEST = {"multisine": slice(MULTISINE.start + 65_063, MULTISINE.stop), "arrow": ARROW}
NOT_SCORED = 50


def signals(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Input and output [V]."""
    content = loadmat(folder / "silverbox" / "SNLS80mV.mat")
    return content["V1"].ravel().astype(float), content["V2"].ravel().astype(float)


def write_case(folder: Path, case: Path) -> Path:
    """Write the case folder; returns it. The test data are not looked at."""
    voltages = signals(folder)
    (case / "recordings").mkdir(parents=True, exist_ok=True)
    for number in range(N_RUNS):
        start = MULTISINE.start + number * REALISATION
        run = recording(*(voltage[start : start + LENGTH] for voltage in voltages), name=f"realisation_{number}")
        write_recording(run, case / "recordings" / f"realisation_{number}.nc")
    return case


def recording(force: np.ndarray, displacement: np.ndarray, *, name: str) -> xr.Dataset:
    """One realisation; each is a test of its own."""
    channels = {
        "force_input": ("time", force, {"units": "N", "quantity": "force"}),
        "displacement_output": ("time", displacement, {"units": "m", "quantity": "displacement"}),
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": name,
        "test": name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "silverbox",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2004-01-01T00:00:00Z",
    }
    return xr.Dataset(channels, coords={"time": np.arange(force.size) / RATE_HZ}, attrs=attributes)


def diagnosed(case: Path, *, report: bool = True) -> dict[str, Any]:
    """The diagnosis of the case, as the command ``sloshlab diagnose CASE --twin silverbox_twin.py`` makes it."""
    from pipelines.diagnosis.diagnose import diagnose_case

    return diagnose_case(case, None, command="docs/examples/silverbox_diagnosis.py", report=report, twin=TWIN)


def free_run_errors_mv(folder: Path, values: dict[str, float], extension: Extension) -> dict[str, float]:
    """RMS errors of free runs over the test data [mV]."""
    force, displacement = signals(folder)
    errors = {}
    for name, part in TEST.items():
        dataset = recording(force[part], displacement[part], name=name)
        run = CaseRun(name, dataset, run_attributes(dataset))
        model = UserTwinModel(load_user_twin(TWIN), [run])
        simulated = model.simulate(run, values, extension)["displacement_output"]
        errors[name] = 1e3 * float(np.sqrt(np.mean((simulated - displacement[part])[NOT_SCORED:] ** 2)))
    return errors


def main(arguments: list[str]) -> None:
    """Write the case, diagnose it, say what was found and how it runs on the test data."""
    folder = Path(arguments[0] if arguments else os.environ["SLOSHLAB_EXTERNAL_DATA"])
    case = write_case(folder, Path(arguments[1] if len(arguments) > 1 else "silverbox_case"))
    found = diagnosed(case)
    sys.stdout.write("\n".join(found["lines"]) + "\n")
    for name in ("retuned_twin.toml", "extended_twin.toml"):
        values, extension = load_extended(case / "diagnosis" / name)
        errors = free_run_errors_mv(folder, values, extension)
        sys.stdout.write(
            f"{name}: " + ", ".join(f"{part} {error:.2f} mV" for part, error in errors.items()) + "\n"
        )
    errors = free_run_errors_mv(folder, {}, NOTHING)
    sys.stdout.write(
        "as believed: " + ", ".join(f"{part} {error:.2f} mV" for part, error in errors.items()) + "\n"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
