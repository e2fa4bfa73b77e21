"""A drawn case as a folder: rig.toml and recordings, nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sealed_trial.case_drawing import DrawnCase
from sealed_trial.laboratory.hidden_rig import rig_text
from sealed_trial.laboratory.recording_file import run_attributes, write_recording


def write_case(folder: Path, case: DrawnCase, generator: np.random.Generator) -> None:
    """Read all sensors of a case and write its folder.

    Parameters
    ----------
    folder : Path
        Made; must not exist.
    case : DrawnCase
    generator : numpy.random.Generator
        Of the noise.
    """
    (folder / "recordings").mkdir(parents=True)
    (folder / "rig.toml").write_text(rig_text(case.laboratory.rig), encoding="utf-8")
    plan = case.laboratory.plan
    read = []
    for run, signals in zip(plan.runs, case.signals, strict=True):
        n_samples = round(run.duration_s * plan.sampling_rate_hz) + 1
        noisy = {}
        for name, values in signals.items():
            sensor = case.sensors[name]
            noise = sensor.noise_of(n_samples, plan.sampling_rate_hz, generator)
            noisy[name] = sensor.gain * values[:n_samples] + noise
        read.append(noisy)
    for change in case.late:
        read = change.distorted(read, plan.sampling_rate_hz, late=True)
    for number, (run, noisy) in enumerate(zip(plan.runs, read, strict=True), start=1):
        counts = {name: case.sensors[name].counts(values) for name, values in noisy.items()}
        path = folder / "recordings" / f"run_{number:02d}.nc"
        write_recording(path, counts, case.sensors, case.laboratory.rig, run_attributes(number, run, plan))
