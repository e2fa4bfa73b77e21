"""Time of a sensitivity study: 32 networks on 480 s of the numerical tank, in two processes of one core each."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

from pipelines.command_line import DONE_BUT_FLAGGED
from pipelines.experiments import study_arguments
from tests.benchmarks.own_process import MeasurementError, last_line

STUDY_LABEL = "study of 32 networks on 480 s, two processes [s]"
RECORDINGS = Path("raw_data/numerical_tank/shaker")


def study_figures(folder: Path) -> dict[str, float]:
    """Seconds by the clock, those of all trainings together, and the error of the model that is picked."""
    command = [sys.executable, "-m", "pipelines.command_line", *study_arguments(RECORDINGS, folder / "study")]
    began = time.monotonic()
    done = subprocess.run([*command, "--workers", "2", "--json"], capture_output=True, text=True, check=False)
    if done.returncode not in (0, DONE_BUT_FLAGGED):
        raise MeasurementError(last_line(done.stderr) or f"study ended with {done.returncode}")
    told = json.loads(last_line(done.stdout))
    return {
        STUDY_LABEL: time.monotonic() - began,
        "study: all trainings, one after another [s]": float(told["training_s"]),
        "study: networks": float(told["cases"]),
        "study: RMS error of the picked one on the validation run [N]": float(told["validation_rms_n"]),
    }
