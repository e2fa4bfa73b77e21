"""The virtual shaker campaign: the thesis's family of runs as recordings with a manifest."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

from acquisition.virtual_laboratory.sensors import Laboratory
from acquisition.virtual_laboratory.shaker_run import START_TIME_UTC, virtual_shaker_run, write_virtual_run
from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import InputError
from sloshlab.rig import Rig

FILL_LEVELS: Final = (0.25, 0.50, 0.75)
ACCELERATIONS_G: Final = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
MANIFEST_NAME: Final = "manifest.json"
CAMPAIGN_LABORATORY: Final = 0
"""Seed of the laboratory of every campaign that asks for no other."""
COMMAND: Final = "sloshlab virtual campaign -o raw_data/shaker --seed {seed}"

_RIG_TEXT = """\
# Tank on the electrodynamic shaker; two force cells under the base.
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61   # all that rests on the cells, as believed

[liquid]
name = "water"
density_kg_per_m3 = 1000.0
surface_tension_n_per_m = 0.0728
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = {fill_level:.2f}

[twin]
tank_model = "frozen"
"""

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class CampaignRun:
    """One recording of the campaign: its file name without suffix, fill level and settings."""

    name: str
    fill_level: float
    settings: Mapping[str, Any] = field(default_factory=dict)


def rig_name(fill_level: float) -> str:
    """File name of the rig description of a fill level."""
    return f"rig_fill_{fill_level:.2f}.toml"


def rig_text(fill_level: float) -> str:
    """TOML text of the rig description of a fill level."""
    return _RIG_TEXT.format(fill_level=fill_level)


def campaign_runs() -> list[CampaignRun]:
    """All runs in the order in which they are recorded."""
    runs = [run for fill_level in FILL_LEVELS for run in _runs_of_one_fill(fill_level)]
    half_full: list[tuple[str, dict[str, Any]]] = [
        ("sweep_3.00g_repeat_2", {"acceleration_g": 3.0, "repeat": 2}),
        ("sweep_down_3.00g", {"acceleration_g": 3.0, "direction": "down"}),
        ("vfa_6.00g", {"acceleration_g": 6.0, "experiment": "shaker_vfa"}),
    ]
    return runs + [CampaignRun(f"fill_0.50_{name}", 0.50, settings) for name, settings in half_full]


def make_campaign(
    folder: str | os.PathLike[str],
    *,
    seed: int = 0,
    laboratory_seed: int | None = CAMPAIGN_LABORATORY,
    overwrite: bool = False,
    progress: Progress | None = None,
    only: Callable[[CampaignRun], bool] | None = None,
) -> Path:
    """Record the campaign into a folder.

    Parameters
    ----------
    folder : path-like
        Made if missing; files of an earlier campaign are replaced, all together.
    seed : int
        Of noise, motion and liquid. Same seeds, same library versions: same bytes.
    laboratory_seed : int, optional
        Of the laboratory that serves all runs; None for one that is as the rigs tell.
    overwrite : bool
        Whether files may be replaced that the manifest does not vouch for.
    progress : callable, optional
        Called with (runs done, runs in all, name) after each run.
    only : callable, optional
        Record only the runs that it accepts; the manifest then lists only these.

    Returns
    -------
    Path
        The manifest: command, seed, version, and SHA-256 and size of every file.

    Raises
    ------
    InputError
        If a seed is negative, or somebody's own file is in the place of one of the campaign.

    Notes
    -----
    One laboratory, with one set of sensor gains and one true dry mass, serves all runs: see
    `campaign_laboratory`. Nothing of that truth is written.
    """
    for name, number in (("seed", seed), ("laboratory seed", laboratory_seed or 0)):
        if number < 0:
            raise InputError(f"{name} of the campaign", got=str(number), allowed="≥ 0")
    target = Path(folder)
    numbered = [(index, run) for index, run in enumerate(campaign_runs()) if only is None or only(run)]
    names = [*map(rig_name, FILL_LEVELS), *(f"{run.name}.nc" for _, run in numbered), MANIFEST_NAME]
    require_own_files(target, names, overwrite=overwrite)
    laboratory = campaign_laboratory(laboratory_seed)
    with atomic_file.filled_folder(target) as complete:
        for fill_level in FILL_LEVELS:
            (complete / rig_name(fill_level)).write_bytes(rig_text(fill_level).encode())
        for n_done, (index, run) in enumerate(numbered, start=1):
            path = complete / f"{run.name}.nc"
            record_campaign_run(run, path, index=index, seed=seed, laboratory=laboratory)
            if progress is not None:
                progress(n_done, len(numbered), run.name)
        content = {
            "format": 1,
            "command": COMMAND.format(seed=seed) + laboratory_option(laboratory_seed),
            "seed": seed,
            "sloshlab_version": __version__,
            "files": {path.name: file_record(path) for path in sorted(complete.iterdir())},
        }
        manifest = (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()
        (complete / MANIFEST_NAME).write_bytes(manifest)
    return target / MANIFEST_NAME


def record_campaign_run(
    run: CampaignRun, path: str | os.PathLike[str], *, index: int, seed: int, laboratory: Laboratory
) -> None:
    """Record one run of the campaign; `index` is its place in `campaign_runs`."""
    start = datetime.fromisoformat(START_TIME_UTC) + timedelta(minutes=10 * index)
    rig = Rig.from_toml_text(rig_text(run.fill_level))
    recording = virtual_shaker_run(
        rig,
        # by the place in the list: the same run has the same bytes, whichever others are made
        seed=1000 * seed + index,
        # one laboratory: gains and dry mass are those of the sensors, not of a run
        laboratory=laboratory,
        run_id=run.name,
        rig_name=rig_name(run.fill_level),
        start_time_utc=start.strftime("%Y-%m-%dT%H:%M:%SZ"),
        **run.settings,
    )
    write_virtual_run(recording, path)


def campaign_laboratory(seed: int | None = CAMPAIGN_LABORATORY) -> Laboratory:
    """The truth about the campaign's sensors and dry mass; without a seed the rig is as told."""
    return Laboratory.perfect() if seed is None else Laboratory.drawn(seed)


def laboratory_option(seed: int | None) -> str:
    """What the command of a campaign says of its laboratory; nothing of the one that is usual."""
    if seed == CAMPAIGN_LABORATORY:
        return ""
    return " --laboratory exact" if seed is None else f" --laboratory-seed {seed}"


def require_own_files(folder: Path, names: Iterable[str], *, overwrite: bool) -> None:
    """Refuse to replace what no earlier campaign wrote: it may be a measurement.

    Parameters
    ----------
    folder : Path
    names : iterable of str
        Of the files that will be written.
    overwrite : bool
        Refuse nothing.

    Raises
    ------
    InputError
        If a file is there and not, as it is, in the manifest of the folder.
    """
    known: dict[str, Any] = {}
    # a manifest that is not there, or none, vouches for nothing
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        known = {MANIFEST_NAME: None, **json.loads((folder / MANIFEST_NAME).read_text(encoding="utf-8"))["files"]}
    for name in names if not overwrite else ():
        path = folder / name
        if not os.path.lexists(path) or (name == MANIFEST_NAME and name in known):
            continue
        if path.is_symlink() or not path.is_file() or known.get(name) != file_record(path):
            raise InputError(
                f"recording {path}",
                got="a file that no campaign wrote, or that was changed since",
                remedy="another folder, or --overwrite",
            )


def file_record(path: str | os.PathLike[str]) -> dict[str, str | int]:
    """SHA-256 and size of one file, as the manifest holds them."""
    content = Path(path).read_bytes()
    return {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}


def _runs_of_one_fill(fill_level: float) -> list[CampaignRun]:
    prefix = f"fill_{fill_level:.2f}"
    runs = [
        CampaignRun(
            f"{prefix}_{configuration}_3.00g",
            fill_level,
            {"acceleration_g": 3.0, "configuration": configuration, "duration_s": 60.0},
        )
        for configuration in ("empty", "frozen")
    ]
    for acceleration_g in ACCELERATIONS_G:
        settings = {"acceleration_g": acceleration_g, **_mishaps(fill_level, acceleration_g)}
        runs.append(CampaignRun(f"{prefix}_sweep_{acceleration_g:.2f}g", fill_level, settings))
    return runs


def _mishaps(fill_level: float, acceleration_g: float) -> dict[str, Any]:
    """A block of lost samples in one run, a few clipped samples in another."""
    if (fill_level, acceleration_g) == (0.25, 3.0):
        # flagged as a real recorder would, so that the analysis meets both in the recordings of raw_data
        return {"lost": (131.0, 70)}
    if (fill_level, acceleration_g) == (0.75, 6.0):
        return {"n_clipped": 8}
    return {}
