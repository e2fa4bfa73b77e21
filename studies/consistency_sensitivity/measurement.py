"""Damaged cases through the whole analysis: what they do to W̄ and β, and whether anything is said."""

from __future__ import annotations

import json
import os
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from pipelines.sweep.results import SweepExperiment
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab.errors import InputError
from sloshlab.recording import read_recording, write_recording
from sloshlab.sweep.windows import WindowSettings
from studies.consistency_sensitivity.damages import DAMAGES, Case, Damage

BELIEVED_DRY_MASS_KG = 0.61


@dataclass(frozen=True)
class CaseFiles:
    """Where the runs of a case lie.

    Attributes
    ----------
    folder : str
        Of the recordings.
    fill_level : str
        As in the names of the files, ``"0.50"``.
    run : str
        Of the sloshing run, ``"sweep_3.00g"``.
    """

    folder: str
    fill_level: str
    run: str

    @property
    def name(self) -> str:
        """Short name."""
        return f"{Path(self.folder).parent.name}/fill_{self.fill_level}_{self.run}"

    def read(self) -> Case:
        """The recordings, undamaged."""
        read = [
            read_recording(f"{self.folder}/fill_{self.fill_level}_{name}.nc")
            for name in (self.run, "empty_3.00g", "frozen_3.00g")
        ]
        return Case(read[0], read[1], read[2], BELIEVED_DRY_MASS_KG, float(self.fill_level))


CASES = (
    CaseFiles("raw_data/shaker", "0.50", "sweep_3.00g"),
    CaseFiles("raw_data/shaker", "0.25", "sweep_1.50g"),
    CaseFiles("raw_data/shaker", "0.75", "sweep_5.00g"),
    CaseFiles("raw_data/numerical_tank/shaker", "0.50", "sweep_3.00g"),
    CaseFiles("raw_data/numerical_tank/shaker", "0.25", "sweep_4.00g"),
    CaseFiles("raw_data/numerical_tank/shaker", "0.50", "sweep_down_3.00g"),
)


@dataclass(frozen=True)
class Outcome:
    """What a damage did and what was said.

    Attributes
    ----------
    case, damage : str
    size : float
    w_bar_change, beta_change : float
        Median over windows of the change, over the median of the undamaged run; infinite for a refused run.
    w_bar_open, beta_open : float
        Change of W̄ and β that the open points of the run say may go unseen, in the same measure.
    answer : str
        ``"silent"``, ``"flagged"`` or ``"refused"``.
    said : str
        The first flag or the refusal.
    """

    case: str
    damage: str
    size: float
    w_bar_change: float
    beta_change: float
    w_bar_open: float
    beta_open: float
    answer: str
    said: str


def measured(files: CaseFiles, damages: Sequence[Damage] = DAMAGES) -> Iterator[Outcome]:
    """Every size of every damage of one case."""
    case = files.read()
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        base = {alone: analysed(case.alone() if alone else case, Path(folder)) for alone in (False, True)}
        for damage in damages:
            for size in damage.sizes:
                seed = zlib.crc32(f"{files.name} {damage.name} {size}".encode())
                damaged = damage.apply(case, size, np.random.default_rng(seed))
                yield _outcome(files, damage, size, base[damaged.empty is None], damaged, Path(folder))


def _outcome(
    files: CaseFiles, damage: Damage, size: float, clean: SweepExperiment, damaged: Case, folder: Path
) -> Outcome:
    known = (files.name, damage.name, size)
    try:
        experiment = analysed(damaged, folder)
    except InputError as error:
        return Outcome(*known, np.inf, np.inf, 0.0, 0.0, "refused", str(error))
    w_bar, beta = (
        _change(clean.windows[name], experiment.windows[name], clean, experiment) for name in ("w_bar", "beta")
    )
    scale = {name: float(np.median(np.abs(clean.windows[name].values))) for name in ("w_bar", "beta")}
    said = [flag for flag in experiment.all_flags if flag not in clean.all_flags]
    points = [point for examination in experiment.examinations for point in examination.not_checked]
    w_bar_open = max((point.w_bar_error for point in points), default=0.0) / scale["w_bar"]
    beta_open = max((point.beta_error for point in points), default=0.0) / scale["beta"]
    return Outcome(
        *known, w_bar, beta, w_bar_open, beta_open, "flagged" if said else "silent", said[0] if said else ""
    )


def _change(before: xr.DataArray, after: xr.DataArray, clean: SweepExperiment, damaged: SweepExperiment) -> float:
    """Median change over windows at the same time, over the median magnitude of the undamaged ones."""
    there = np.interp(clean.windows["time_s"], damaged.windows["time_s"], after, left=np.nan, right=np.nan)
    return float(np.nanmedian(np.abs(there - before.values)) / np.median(np.abs(before.values)))


def analysed(case: Case, folder: Path, *, allow_incomplete: bool = False) -> SweepExperiment:
    """A case through the analysis of the shaker, by way of files in a folder."""
    paths = []
    for name, recording in (("sloshing", case.sloshing), ("empty", case.empty), ("frozen", case.frozen)):
        if recording is None:
            continue
        paths.append(folder / f"{name}.nc")
        plain = recording.copy()
        for channel in plain.data_vars:
            plain[channel].encoding = {}
        write_recording(plain.assign_attrs(run_id=name, rig="rig.toml"), paths[-1])
    rig = folder / "rig.toml"
    rig.write_text(
        f"[tank]\nheight_m = 0.0272\nlength_m = 0.1172\nwidth_m = 0.0780\ndry_mass_kg = {case.dry_mass_kg!r}\n"
        f'[liquid]\nname = "water"\ndensity_kg_per_m3 = 1000.0\nfill_level = {case.fill_level!r}\n'
    )
    return analyse_shaker(paths, [rig], ShakerSettings(WindowSettings(), allow_incomplete=allow_incomplete))


def write_outcomes(files: CaseFiles, path: Path) -> None:
    """Append the outcomes of a case to a file of JSON lines, one after the other."""
    with path.open("a", encoding="utf-8") as lines:
        for outcome in measured(files):
            lines.write(json.dumps(asdict(outcome)) + "\n")
            lines.flush()
