"""All runs of the study, each kept in a file of its own: stopped at any time, it goes on with the next one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipelines.report.progress import progress
from sloshlab import atomic_file
from sloshlab._version import __version__
from studies.tank_scaling.harmonic_runs import POINTS, HarmonicRun, Point, shaken
from studies.tank_scaling.similarity import SimilarTank
from studies.tank_scaling.varied_motion import VariedRun, dynamic_force

LAYERS: Final = 12
"""Particles over the height: one with 16 costs 2.4 times as much, one with 24 eight times."""
SEEDS: Final = (0, 1, 2)
SIZES: Final = (1 / 25, 1.0, 2.0, 5.0, 25.0)
"""λ: the training tank, twice, five times; 25 is the largest tank of a wing (0.7 m). The small one, in which water
acts as an oil 125 times as viscous in the training tank, shows whether the computation feels viscosity."""
RESOLUTION_POINT: Final = Point(3.8, 3.0)
RESOLUTION_LAYERS: Final = (16, 24)
RESOLUTION_SIZES: Final = (1.0, 25.0)
VARIED_SIZES: Final = (1.0, 2.0, 5.0, 25.0)
FEWER_SEEDS: Final = (0, 1)
"""Of varied motion, and with finer particles."""
_DIGITS: Final = 5

Run = HarmonicRun | VariedRun


def runs() -> list[Run]:
    """All runs, those that say most first, so that a campaign that ends early says something, too."""
    found: list[Run] = []
    for seed in SEEDS:
        found += [HarmonicRun(point, SimilarTank(size), LAYERS, seed) for point in POINTS for size in SIZES]
        if seed in FEWER_SEEDS:
            found += [VariedRun(SimilarTank(size), LAYERS, seed) for size in VARIED_SIZES]
            found += [
                HarmonicRun(RESOLUTION_POINT, SimilarTank(size), layers, seed)
                for layers in RESOLUTION_LAYERS
                for size in RESOLUTION_SIZES
            ]
    return found


def compute(folder: Path, wanted: Sequence[Run] | None = None) -> dict[Run, dict[str, Any]]:
    """Compute what is not there yet, and return what every run gave.

    Parameters
    ----------
    folder : Path
        One file per run.
    wanted : sequence of HarmonicRun or VariedRun, optional
        All runs by default.
    """
    listed = runs() if wanted is None else list(wanted)
    found = {run: kept for run in listed if (kept := _kept(folder, run)) is not None}
    left = [run for run in listed if run not in found]
    folder.mkdir(parents=True, exist_ok=True)
    with progress("tanks in similarity", len(left), [run.work for run in left]) as done:
        for run in left:
            found[run] = {"identity": identity(run), **_computed(run)}
            atomic_file.write_bytes(_place(folder, run), json.dumps(found[run]).encode())
            done(run.name)
    return {run: found[run] for run in listed}


def identity(run: Run) -> str:
    """Hash of what determines a run: what is computed, and by which version."""
    return hashlib.sha256(f"{run!r} {__version__}".encode()).hexdigest()


def _computed(run: Run) -> dict[str, Any]:
    if isinstance(run, VariedRun):
        return {"dynamic_force": np.round(dynamic_force(run), _DIGITS).tolist()}
    cycles = shaken(run)
    return {
        "w_bar": np.round(cycles.w_bar, _DIGITS).tolist(),
        "beta": np.round(cycles.beta, _DIGITS).tolist(),
        "left_out": vars(cycles.left_out),
    }


def _place(folder: Path, run: Run) -> Path:
    return folder / f"{run.name}.json"


def _kept(folder: Path, run: Run) -> dict[str, Any] | None:
    """What an earlier campaign kept of a run; nothing if it is of another run or damaged."""
    try:
        content = json.loads(_place(folder, run).read_bytes())
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) and content.get("identity") == identity(run) else None
