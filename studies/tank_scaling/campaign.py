"""All runs of the study, each kept in a file of its own: stopped at any time, it goes on with the next one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
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
SEED: Final = 0
SECOND_SEED: Final = 1
"""Of the training tank alone, with which all others are compared, and of what its motion does not decide."""
SIZES: Final = (1.0, 2.0, 5.0, 25.0)
"""λ: the training tank, twice, five times; 25 is the largest tank of a wing (0.7 m)."""
SMALL_SIZES: Final = (1 / 25, 1 / 10, 1 / 5)
"""No tanks that anybody builds: in them water acts as oils 125, 32 and 11 times as viscous in the training tank,
which shows from where on the computation feels viscosity."""
RESOLUTION_POINT: Final = Point(3.8, 3.0)
RESOLUTION: Final = ((16, 1.0), (16, 25.0), (24, 1.0))
"""Layers over the height, and size."""
_DIGITS: Final = 5

Run = HarmonicRun | VariedRun


def runs() -> list[Run]:
    """All runs, those that say most first, so that a campaign that ends early says something, too."""
    found: list[Run] = [
        HarmonicRun(point, SimilarTank(size), LAYERS, SEED) for size in (*SMALL_SIZES, *SIZES) for point in POINTS
    ]
    found += [HarmonicRun(point, SimilarTank(1.0), LAYERS, SECOND_SEED) for point in POINTS]
    found += [VariedRun(SimilarTank(size), LAYERS, SEED) for size in SIZES]
    found.append(VariedRun(SimilarTank(1.0), LAYERS, SECOND_SEED))
    return found + [HarmonicRun(RESOLUTION_POINT, SimilarTank(size), layers, SEED) for layers, size in RESOLUTION]


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


def cycles_by_name(results: Mapping[Run, Mapping[str, Any]]) -> dict[str, Any]:
    """Cycles and estimates of all harmonic runs by their names: what is kept of a campaign.

    Parameters
    ----------
    results : mapping
        Of `compute`.
    """
    return {
        run.name: {name: result[name] for name in ("w_bar", "beta", "left_out")}
        for run, result in results.items()
        if isinstance(run, HarmonicRun)
    }


def results_of_cycles(kept: Mapping[str, Any]) -> dict[Run, Any]:
    """The harmonic runs of what was kept.

    Parameters
    ----------
    kept : mapping
        Of `cycles_by_name`.
    """
    return {run: kept[run.name] for run in runs() if run.name in kept}


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
