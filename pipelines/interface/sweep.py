"""Sweeps in Python: recordings to windows, maps and a report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import xarray as xr

from pipelines.inputs.recordings import RunsLike, run_sources
from pipelines.inputs.rigs import RigsLike, rig_sources
from pipelines.interface import html
from pipelines.interface.folder_result import FolderResult
from pipelines.interface.provenance import call_text, hashes_of
from pipelines.interface.sweep_plots import SweepPlots
from pipelines.sweep.outputs import provenance_of_sweeps, stamped_results, write_experiment
from pipelines.sweep.results import SweepExperiment
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from pipelines.sweep.summary import sentences
from pipelines.sweep.work import WorkSettings, analyse_work
from sloshlab.errors import InputError


@dataclass(frozen=True, eq=False)
class SweepAnalysis(FolderResult):
    """Sweeps, analysed: what `analyse_sweep` returns.

    Its data are ``windows.nc`` and ``maps.nc``.

    Attributes
    ----------
    experiment : SweepExperiment
        Everything that was found, run by run.
    call : str
        What was asked for, as the report shows it.
    hashes : mapping
        SHA-256 of everything that was handed over, at the time of the analysis.
    """

    experiment: SweepExperiment
    call: str
    hashes: Mapping[Any, str] = field(repr=False)

    @property
    def windows(self) -> xr.Dataset:
        """The contents of ``windows.nc``: dimension ``window``, all runs behind each other.

        Work W [J] is the mean per cycle, positive where it is dissipated; with a tank also W̄, β, γ, loss factor.
        """
        return self._results["windows.nc"]

    @property
    def maps(self) -> xr.Dataset:
        """The contents of ``maps.nc``: W over (frequency, amplitude), W̄ and β over (ω̄, ū), with their errors.

        NaN outside the measured region. Several rigs lie along a dimension ``fill_level``.
        """
        return self._results["maps.nc"]

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the numbers; empty is good, and else the command exits with 3."""
        return self.experiment.all_flags

    @property
    def summary(self) -> tuple[str, ...]:
        """The result in sentences, as on top of the report."""
        return sentences(self.experiment)

    @property
    def plot(self) -> SweepPlots:
        """Figures on axes: ``plot.map(ax=…)``, ``plot.loop(window, ax=…)``."""
        return SweepPlots(self.experiment)

    def to_datatree(self) -> xr.DataTree:
        """Windows and maps as one tree, and with a tank those of every rig below its name."""
        parts = {"windows": self.windows, "maps": self.maps}
        for rig in self.experiment.rigs if len(self.experiment.rigs) > 1 else ():
            name = Path(rig.name).stem
            parts |= {f"{name}/windows": rig.windows, f"{name}/maps": rig.maps.dataset}
        return xr.DataTree.from_dict(parts, name=self.experiment.kind)

    def _write(self, folder: Path, *, report: bool) -> None:
        write_experiment(self.experiment, folder, command=self.call, report=report, known_sha256=self.hashes)

    @cached_property
    def _results(self) -> dict[str, xr.Dataset]:
        provenance = provenance_of_sweeps(self.experiment, self.call, self.hashes)
        return stamped_results(self.experiment, provenance)

    def _repr_html_(self) -> str:
        shown = html.data_sets({"windows": self.windows, "maps": self.maps})
        return html.card(self.experiment.title, self.summary, flags=self.flags, more=shown)


def analyse_sweep(
    runs: RunsLike,
    rig: RigsLike | None = None,
    *,
    p: int = 6,
    m: int = 24,
    boundaries: str = "measured",
    allow_incomplete: bool = False,
    force: str = "",
    acceleration: str = "",
    velocity: str = "",
    displacement: str = "",
    phase_reference: str = "",
    keep_signals: bool = True,
) -> SweepAnalysis:
    """Analyse sweeps: with a rig a tank on the shaker, else any structure with one force and one motion.

    Parameters
    ----------
    runs : path, xarray.Dataset, xarray.DataTree, or several of them
        Recordings. With a rig those of configuration ``empty`` and ``frozen`` identify the dry mass.
    rig : path, Rig, or several of them
        Rigs that differ in fill level only; the attribute `rig` of every run names its own. A mapping gives names
        to rigs in memory.
    p : int
        P; a window averages 2P cycles.
    m : int
        M, cycles between the centres of windows; less than 2P means overlap.
    boundaries : {"measured", "law"}
        Cycle boundaries from the measured phase or from the stated sweep law; with a rig only.
    allow_incomplete : bool
        Analyse a sweep that stops early up to where it stops, and flag it; with a rig only.
    force, acceleration, velocity, displacement : str
        Without a rig: channel of the force on the structure, and of its motion, exactly one.
    phase_reference : str
        Without a rig: channel whose phase counts the cycles; by default the motion.
    keep_signals : bool
        Keep force and motion of every run in memory, so that ``plot.loop`` can draw any window.

    Returns
    -------
    SweepAnalysis
        Nothing is written before its `report` or `save`. Upward positive; work positive where dissipated.

    Raises
    ------
    InputError
        If a run, a rig or their combination is bad.

    Notes
    -----
    The commands `sloshlab shaker` and `sloshlab work` do the same. Work per cycle is the area of the loop of force
    over displacement, (1.8) and (1.12) of the source that ``docs/references.md`` names; how it is computed and how
    well is in ``docs/shaker.md``.
    """
    sources = run_sources(runs)
    choices = {"p": p, "m": m}
    if rig is not None:
        rigs = rig_sources(rig)
        choices_of_rig = ShakerSettings.checked(p=p, m=m, boundaries=boundaries, allow_incomplete=allow_incomplete)
        experiment = analyse_shaker(sources, rigs, choices_of_rig, keep_signals=keep_signals)
        call = call_text("analyse_sweep", sources, rig=rigs, **choices, boundaries=boundaries)
    else:
        if not force:
            raise InputError(
                "rig", got="none", allowed="rig=, or force= and one motion", remedy="give the rig's file"
            )
        motions = {"acceleration": acceleration, "velocity": velocity, "displacement": displacement}
        settings = WorkSettings.checked(p=p, m=m, force=force, motions=motions, phase_reference=phase_reference)
        experiment = analyse_work(sources, settings, keep_signals=keep_signals)
        call = call_text("analyse_sweep", sources, force=force, **motions, **choices)
    hashes = hashes_of(experiment.inputs, {run.path: run.sha256 for run in experiment.runs})
    return SweepAnalysis(experiment, call, hashes)
