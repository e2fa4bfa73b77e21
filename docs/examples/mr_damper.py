"""A magneto-rheological damper diagnosed with a twin of its own: ``python mr_damper.py FOLDER CASE``.

Three strokes become the recordings of CASE; the middle one chooses nothing.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.io import loadmat

from sloshlab.recording import write_recording

TWIN = Path(__file__).with_name("mr_damper_twin.py")
FILES = {"stroke_20mm": "ensaio1.2.2.mat", "stroke_13mm": "ensaio7.2.2.mat", "stroke_9mm": "ensaio10.2.2.mat"}
RATE_HZ = 100.0


def write_case(folder: Path, case: Path) -> Path:
    """Write the case folder; returns it."""
    (case / "recordings").mkdir(parents=True, exist_ok=True)
    for name, file in FILES.items():
        table = np.asarray(loadmat(folder / "mr_damper" / file)["x_F"], np.float64)
        write_recording(recording(1e-3 * table[:, 0], table[:, 2], name), case / "recordings" / f"{name}.nc")
    return case


def recording(displacement_m: np.ndarray, force_n: np.ndarray, name: str) -> xr.Dataset:
    """One stroke."""
    channels = {
        "displacement_table": ("time", displacement_m, {"units": "m", "quantity": "displacement"}),
        "force_damper": ("time", force_n, {"units": "N", "quantity": "force", "zero_is_known": 1}),
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": name,
        "test": name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "mr damper",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2020-01-01T00:00:00Z",
    }
    return xr.Dataset(channels, coords={"time": np.arange(force_n.size) / RATE_HZ}, attrs=attributes)


def diagnosed(case: Path, *, report: bool = True) -> dict[str, Any]:
    """The diagnosis of the case, as ``sloshlab diagnose CASE --twin …`` makes it."""
    from pipelines.diagnosis.diagnose import diagnose_case

    return diagnose_case(case, None, command="docs/examples/mr_damper.py", report=report, twin=TWIN)


def main(arguments: list[str]) -> None:
    """Write the case, diagnose it, say what was found."""
    folder = Path(arguments[0] if arguments else os.environ["SLOSHLAB_EXTERNAL_DATA"])
    case = write_case(folder, Path(arguments[1] if len(arguments) > 1 else "mr_damper_case"))
    found = diagnosed(case)
    sys.stdout.write("\n".join(found["lines"]) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
