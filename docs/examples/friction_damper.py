"""A banded rotary friction damper diagnosed with a twin of its own: ``python friction_damper.py FOLDER CASE``.

Three amplitudes at one tension of the band become the recordings of CASE; the middle one chooses nothing.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from sloshlab.recording import write_recording

TWIN = Path(__file__).with_name("friction_damper_twin.py")
NAME = "dataset-2__characterization_datasets__0.5Hz30lbtension{}amplitude.json"
AMPLITUDES = ("0.5", "1", "1.5")
EVERY = 32
M_PER_INCH, N_PER_KIP = 0.0254, 4448.2216152605


def write_case(folder: Path, case: Path) -> Path:
    """Write the case folder; returns it."""
    (case / "recordings").mkdir(parents=True, exist_ok=True)
    for amplitude in AMPLITUDES:
        content = json.loads((folder / "friction_backlash" / NAME.format(amplitude)).read_text())
        declared = (content["displacement units"], content["friction force units"])
        if declared != ("in", "kip"):
            raise ValueError(f"{amplitude}: units {declared}")
        table = np.array(content["data"])
        n = table.shape[0] // EVERY * EVERY
        means = table[:n, 1:3].reshape(-1, EVERY, 2).mean(axis=1)  # noise of the samples between is averaged
        run = recording(
            means[:, 0] * M_PER_INCH, means[:, 1] * N_PER_KIP, content["sampling freq"] / EVERY, amplitude
        )
        write_recording(run, case / "recordings" / f"amplitude_{amplitude}.nc")
    return case


def recording(displacement: np.ndarray, force: np.ndarray, rate_hz: float, amplitude: str) -> xr.Dataset:
    """One amplitude."""
    channels = {
        "displacement_actuator": ("time", displacement, {"units": "m", "quantity": "displacement"}),
        "force_damper": ("time", force, {"units": "N", "quantity": "force", "zero_is_known": 1}),
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": f"amplitude {amplitude} in",
        "test": amplitude,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "friction damper",
        "sampling_rate_hz": rate_hz,
        "start_time_utc": "2018-01-01T00:00:00Z",
    }
    return xr.Dataset(channels, coords={"time": np.arange(force.size) / rate_hz}, attrs=attributes)


def diagnosed(case: Path, *, report: bool = True) -> dict[str, Any]:
    """The diagnosis of the case, as ``sloshlab diagnose CASE --twin …`` makes it."""
    from pipelines.diagnosis.diagnose import diagnose_case

    return diagnose_case(case, None, command="docs/examples/friction_damper.py", report=report, twin=TWIN)


def main(arguments: list[str]) -> None:
    """Write the case, diagnose it, say what was found."""
    folder = Path(arguments[0] if arguments else os.environ["SLOSHLAB_EXTERNAL_DATA"])
    case = write_case(folder, Path(arguments[1] if len(arguments) > 1 else "friction_damper_case"))
    found = diagnosed(case)
    sys.stdout.write("\n".join(found["lines"]) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
