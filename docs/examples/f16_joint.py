"""The joint between a wing and what hangs under it (F-16) diagnosed: ``f16_joint.py FOLDER CASE [LEVEL ...]``.

Reads ``FOLDER/f16/F16Data_SineSw_Level*.mat``, writes the passage of each sweep through the torsion mode near
7.3 Hz as a run into CASE, and diagnoses them with `f16_joint_twin.py`: the payload side is simulated from the
recorded motion of the wing side, so that whatever is missing lies between the two sensors.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.io import loadmat
from scipy.signal import decimate

from sloshlab.recording import LOST, write_recording

TWIN = Path(__file__).with_name("f16_joint_twin.py")
LEVELS = (1, 3, 5, 7)
START_HZ, SWEEP_HZ_PER_S = 15.0, 0.05
FROM_HZ, TO_HZ = 7.45, 6.65
EVERY = 4
BEGINNING_S = 2.0
"""Not compared: the joint's own transient."""
NOISE_M_PER_S2 = 0.02
KNOWN_TO = 0.02
"""Of the payload side's RMS: modes beyond the joint, cross sensitivity."""


def write_case(folder: Path, case: Path, levels: tuple[int, ...] = LEVELS) -> Path:
    """Write the case folder; returns it."""
    (case / "recordings").mkdir(parents=True, exist_ok=True)
    for level in levels:
        content = loadmat(folder / "f16" / f"F16Data_SineSw_Level{level}.mat")
        rate = float(content["Fs"].item())
        chosen = slice(*(round((START_HZ - f) / SWEEP_HZ_PER_S * rate) for f in (FROM_HZ, TO_HZ)))
        wing, payload = (
            decimate(content["Acceleration"][k, chosen].astype(float), EVERY, zero_phase=True) for k in (1, 2)
        )
        run = recording(wing, payload, rate / EVERY, level)
        write_recording(run, case / "recordings" / f"level_{level}.nc")
    return case


def recording(wing: np.ndarray, payload: np.ndarray, rate_hz: float, level: int) -> xr.Dataset:
    """One passage."""
    known_to = KNOWN_TO * float(payload.std())
    payload, quality = payload.copy(), np.zeros(payload.size, np.uint8)
    beginning = slice(0, round(BEGINNING_S * rate_hz))
    payload[beginning], quality[beginning] = np.nan, LOST
    acceleration = {"units": "m s-2", "quantity": "acceleration"}
    channels = {
        "acceleration_wing": ("time", wing, acceleration),
        "acceleration_payload": (
            "time",
            payload,
            {**acceleration, "known_to": known_to, "noise_std": NOISE_M_PER_S2},
        ),
        "quality": ("time", quality),
    }
    attributes = {
        "sloshlab_format": "1",
        "run_id": f"level_{level}",
        "experiment": "other",
        "configuration": "frozen",
        "rig": "aircraft",
        "sampling_rate_hz": rate_hz,
        "start_time_utc": "2014-09-01T00:00:00Z",
        "test": f"level {level}",
    }
    return xr.Dataset(channels, coords={"time": np.arange(wing.size) / rate_hz}, attrs=attributes)


def diagnosed(case: Path, *, report: bool = True) -> dict[str, Any]:
    """The diagnosis of the case, as the command ``sloshlab diagnose CASE --twin f16_joint_twin.py`` makes it."""
    from pipelines.diagnosis.diagnose import diagnose_case

    return diagnose_case(case, None, command="docs/examples/f16_joint.py", report=report, twin=TWIN)


def main(arguments: list[str]) -> None:
    """Write the case, diagnose it, say what was found."""
    folder = Path(arguments[0] if arguments else os.environ["SLOSHLAB_EXTERNAL_DATA"])
    levels = tuple(int(argument) for argument in arguments[2:]) or LEVELS
    case = write_case(folder, Path(arguments[1] if len(arguments) > 1 else "aircraft_case"), levels)
    found = diagnosed(case)
    sys.stdout.write("\n".join(found["lines"]) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
