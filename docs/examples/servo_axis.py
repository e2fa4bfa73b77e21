"""A servo axis (EMPS) diagnosed with a twin of its own: ``servo_axis.py FOLDER CASE [NEWTONS]``.

Reads ``FOLDER/emps/DATA_EMPS.mat``, writes four periods of the motion as recordings into CASE, and diagnoses them
with `servo_axis_twin.py`, the force being known to some newtons. The motion repeats every 6.24 s, so that the
periods are repeats of one test; of the samples every fourth is kept.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.io import loadmat

from sloshlab.recording import LOST, write_recording

TWIN = Path(__file__).with_name("servo_axis_twin.py")
RATE_HZ, EVERY = 1000.0, 4
PERIOD, LENGTH, NOT_SCORED = 6240, 6120, 20
FORCE = {"units": "N", "quantity": "force", "zero_is_known": 1}
FORCE_KNOWN_TO_N = 4.0
"""As if it were white noise up to 125 Hz: 1.6 N of it below 20 Hz, where the axis moves, 3 % of the force's RMS.

The force repeats to 0.3 N, but is deduced from a voltage with one constant, and ripples by 1 to 2 N every 2.5 mm.
"""


def write_case(folder: Path, case: Path, force_known_to_n: float = FORCE_KNOWN_TO_N) -> Path:
    """Write the case folder; returns it."""
    content = loadmat(folder / "emps" / "DATA_EMPS.mat")
    reference, position, voltage = (content[name].ravel().astype(float) for name in ("qg", "qm", "vir"))
    force = voltage * content["gtau"].item()
    (case / "recordings").mkdir(parents=True, exist_ok=True)
    for repeat in range(4):
        part = slice(repeat * PERIOD, repeat * PERIOD + LENGTH, EVERY)
        run = recording(reference[part], position[part], force[part], repeat)
        run["force_motor"].attrs["known_to"] = force_known_to_n
        write_recording(run, case / "recordings" / f"period_{repeat}.nc")
    return case


def recording(reference: np.ndarray, position: np.ndarray, force: np.ndarray, repeat: int) -> xr.Dataset:
    """One period; the first 20 samples do not count, as in the benchmark."""
    force, quality = force.copy(), np.zeros(force.size, np.uint8)
    unscored = slice(0, NOT_SCORED // EVERY)
    force[unscored], quality[unscored] = np.nan, LOST
    channels = {
        "displacement_reference": ("time", reference, {"units": "m", "quantity": "displacement"}),
        "displacement_axis": ("time", position, {"units": "m", "quantity": "displacement"}),
        "force_motor": ("time", force, FORCE),
        "quality": ("time", quality),
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": f"period_{repeat}",
        "experiment": "other",
        "configuration": "frozen",
        "rig": "servo axis",
        "sampling_rate_hz": RATE_HZ / EVERY,
        "start_time_utc": "2019-01-01T00:00:00Z",
        "repeat": repeat,
    }
    return xr.Dataset(channels, coords={"time": np.arange(force.size) * EVERY / RATE_HZ}, attrs=attributes)


def diagnosed(case: Path, *, report: bool = True) -> dict[str, Any]:
    """The diagnosis of the case, as the command ``sloshlab diagnose CASE --twin servo_axis_twin.py`` makes it."""
    from pipelines.diagnosis.diagnose import diagnose_case

    return diagnose_case(case, None, command="docs/examples/servo_axis.py", report=report, twin=TWIN)


def main(arguments: list[str]) -> None:
    """Write the case, diagnose it, say what was found."""
    folder = Path(arguments[0] if arguments else os.environ["SLOSHLAB_EXTERNAL_DATA"])
    known_to = float(arguments[2]) if len(arguments) > 2 else FORCE_KNOWN_TO_N
    case = write_case(folder, Path(arguments[1] if len(arguments) > 1 else "servo_axis_case"), known_to)
    found = diagnosed(case)
    sys.stdout.write("\n".join(found["lines"]) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
