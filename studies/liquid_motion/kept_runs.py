"""Shaken tanks, each kept in a file as soon as it is computed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipelines.report.progress import progress
from sloshlab import __version__, atomic_file
from studies.liquid_motion.shaking import LAYERS, N_AVERAGED, N_CYCLES, TANK, Shaken, Shaking, shaken

_PHASORS = ("vertical", "sideways", "centre")


def computed(folder: Path, wanted: Sequence[Shaking]) -> dict[Shaking, Shaken]:
    """Shake what is not there yet, and return all.

    Parameters
    ----------
    folder : Path
        One file per run.
    wanted : sequence of Shaking

    Raises
    ------
    InstabilityError
        If a computation cannot go on.
    """
    found = {shaking: kept for shaking in wanted if (kept := _kept(folder, shaking)) is not None}
    left = [shaking for shaking in wanted if shaking not in found]
    folder.mkdir(parents=True, exist_ok=True)
    with progress("shaken tanks", len(left)) as done:
        for shaking in left:
            found[shaking] = shaken(shaking)
            content = json.dumps({"identity": _identity(shaking), **plain(found[shaking])})
            atomic_file.write_bytes(folder / f"{_identity(shaking)[:16]}.json", content.encode())
            done(f"{shaking.vertical_g:g} g up, {shaking.sideways_g:g} g sideways")
    return {shaking: found[shaking] for shaking in wanted}


def plain(run: Shaken) -> dict[str, object]:
    """Everything of a run as numbers and lists."""
    phasors = {name: [getattr(run, name).real, getattr(run, name).imag] for name in _PHASORS}
    last = {"phase": run.phase.tolist(), "centre_over_height": run.centre_over_height.tolist()}
    return {**vars(run.shaking), **phasors, **last, "liquid_mass_kg": run.liquid_mass_kg}


def _identity(shaking: Shaking) -> str:
    """Hash of what determines the run: what is computed, and by which version."""
    of = f"{shaking!r} {TANK!r} {LAYERS} {N_CYCLES} {N_AVERAGED} {__version__}"
    return hashlib.sha256(of.encode()).hexdigest()


def _kept(folder: Path, shaking: Shaking) -> Shaken | None:
    """What an earlier study kept of a run; nothing if it is damaged or of another one."""
    try:
        content = json.loads((folder / f"{_identity(shaking)[:16]}.json").read_bytes())
        if content["identity"] != _identity(shaking):
            return None
        vertical, sideways, centre = (complex(*content[name]) for name in _PHASORS)
        phase, heights = (np.array(content[name], np.float64) for name in ("phase", "centre_over_height"))
        return Shaken(shaking, vertical, sideways, centre, phase, heights, float(content["liquid_mass_kg"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
