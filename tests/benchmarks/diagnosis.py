"""Time and memory of a diagnosis: cases of a small development trial, one after the other, on two cores."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sealed_trial.running import run_trial
from sealed_trial.sealing.trial_folder import seal

MEDIAN_LABEL = "a case diagnosed with its report, median [s]"
LONGEST_LABEL = "… longest [s]"
MEMORY_LABEL = "… peak memory [GiB]"
N_CASES = 6
SEED = 1


def diagnosis_figures(folder: Path) -> dict[str, float]:
    """Draw the cases and diagnose each in a process of its own, on two cores; seconds by the clock."""
    trial = folder / "trial"
    seal(trial, seed=SEED, n_cases=N_CASES, key=None)
    outcomes = run_trial(trial, n_workers=1, time_limit_s=900.0)
    return {
        MEDIAN_LABEL: float(np.median([outcome.wall_s for outcome in outcomes])),
        LONGEST_LABEL: max(outcome.wall_s for outcome in outcomes),
        MEMORY_LABEL: max(outcome.memory_mib for outcome in outcomes) / 1024,
    }
