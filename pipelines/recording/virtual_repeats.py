"""Repeats and levels of one virtual experiment on one rig: a folder of recordings that a case can be made of."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from pipelines.recording.virtual import VirtualRun, make_virtual_run, virtual_experiments
from pipelines.report.free_place import require_free_folder, require_free_place
from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS

MOST_RUNS: Final = 200
"""Of a case."""
_RANDOM: Final = ("beam_random", "shaker_random")
"""Experiments whose seed draws the motion, so that another seed is another test."""


@dataclass(frozen=True)
class _PlannedRun:
    run: VirtualRun
    name: str
    attributes: dict[str, Any]


def parsed_levels(text: str) -> tuple[float, ...]:
    """Numbers with commas between them.

    Examples
    --------
    >>> parsed_levels("0.06,0.03")
    (0.06, 0.03)

    Raises
    ------
    InputError
        If one is no finite number other than zero, or stands twice.
    """
    try:
        levels = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError("--levels", got=repr(text), allowed="numbers with commas, such as 0.06,0.03") from error
    if not all(math.isfinite(level) and level != 0 for level in levels) or len(set(levels)) < len(levels):
        raise InputError("--levels", got=repr(text), allowed="finite numbers other than 0, each once")
    return levels


def make_repeats(
    run: VirtualRun,
    rig: Path | None,
    folder: Path,
    *,
    n_repeats: int,
    levels: Sequence[float] = (),
    overwrite: bool = False,
) -> dict[str, Any]:
    """Make every level so many times, each with noise, liquid and start of its own; return the summary.

    Parameters
    ----------
    run : VirtualRun
        Its seed is that of the first; all are of one rig in one laboratory.
    rig : Path, optional
        Needed.
    folder : Path
        Made if missing.
    n_repeats : int
        Of every level.
    levels : sequence of float
        In the unit of the option that sets the level of the experiment; that of `run` by default.
    overwrite : bool
        Whether recordings that are there may be replaced.

    Raises
    ------
    InputError
        If a recording is in the way, or an argument is out of range; nothing is made then.
    """
    require_free_folder(folder, f"--output {folder}")
    if run.experiment not in virtual_experiments():
        raise InputError("EXPERIMENT", got=repr(run.experiment), allowed=", ".join(virtual_experiments()))
    planned = _planned(run, n_repeats, levels)
    for each in planned:
        require_free_place(folder / each.name, overwrite=overwrite, described="recording")
    lines: list[str] = []
    flags: list[str] = []
    made: dict[str, Any] = {}
    for each in planned:
        made = make_virtual_run(each.run, rig, folder / each.name, overwrite=overwrite, attributes=each.attributes)
        lines.append(made["lines"][0])
        flags += made["flags"]
    lines += made["lines"][1:]
    if run.experiment in _RANDOM and n_repeats > 1:
        lines.append(f"every run of {run.experiment} draws its own motion: realisations, no repeats of one test")
    return {
        "lines": lines,
        "flags": flags,
        "output": str(folder),
        "recordings": [str(folder / each.name) for each in planned],
        "laboratory_seed": made["laboratory_seed"],
        "laboratory_deviations": made["laboratory_deviations"],
    }


def _planned(run: VirtualRun, n_repeats: int, levels: Sequence[float]) -> list[_PlannedRun]:
    if n_repeats < 1 or n_repeats * max(1, len(levels)) > MOST_RUNS:
        got = f"{n_repeats} of {max(1, len(levels))} levels"
        raise InputError("--repeats", got=got, allowed=f"1 … {MOST_RUNS} runs in all")
    chosen: Sequence[float | None] = levels or (None,)
    planned = []
    for number, (level, repeat) in enumerate(itertools.product(chosen, range(1, n_repeats + 1))):
        chosen_run = replace(run, seed=run.seed + number)
        words = [run.experiment, run.configuration]
        if level is not None:
            chosen_run = _at_level(chosen_run, level)
            words.append(f"{level:g}")
        attributes: dict[str, Any] = {"repeat": repeat}
        if run.experiment in _RANDOM:
            attributes = {"repeat": 1, "test": f"realisation {number + 1}"}
        planned.append(_PlannedRun(chosen_run, f"{'_'.join(words)}_repeat_{repeat}.nc", attributes))
    return planned


def _at_level(run: VirtualRun, level: float) -> VirtualRun:
    """The same run at another level: a deflection, the RMS of a random root, or the acceleration of a shaker."""
    moves = EXPERIMENTS[run.experiment].moves
    if moves == "release":
        return replace(run, initial_displacement_m=level)
    return replace(run, rms_g=level) if moves == "root" else replace(run, acceleration_g=level)
