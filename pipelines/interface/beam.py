"""The beam and the guided tank in Python: decays and random runs to damping, spectra and a report."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from pipelines.inputs.recordings import RunsLike, run_sources
from pipelines.inputs.rigs import RigLike, rig_source
from pipelines.interface import html
from pipelines.interface.drawing import axes_to_draw_on, in_words
from pipelines.interface.folder_result import FolderResult
from pipelines.interface.provenance import call_text, hashes_of
from pipelines.structure.analysis import analyse_beam as analysed
from pipelines.structure.analysis import checked_settings
from pipelines.structure.outputs import provenance_of_beam, stamped_results, write_beam
from pipelines.structure.results import BeamExperiment
from pipelines.structure.summary import sentences
from pipelines.structure.with_twins import analyse_beam_with_twins
from sloshlab.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class BeamPlots:
    """Figures of a beam or a guided tank, each on axes that are given or new.

    Attributes
    ----------
    experiment : BeamExperiment
    """

    experiment: BeamExperiment

    def damping(self, *, ax: Axes | None = None) -> Axes:
        """Draw ζ₁ [%] of every free run over the amplitude of acceleration [g], with means over repeats.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional

        Raises
        ------
        AnalysisError
            If there is no free run.
        """
        return self._over_amplitude("damping", ax)

    def frequency(self, *, ax: Axes | None = None) -> Axes:
        """Draw f₁ [Hz] of every free run over the amplitude of acceleration [g], with means over repeats.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional

        Raises
        ------
        AnalysisError
            If there is no free run.
        """
        return self._over_amplitude("frequency", ax)

    def decay(self, run: str = "", *, ax: Axes | None = None) -> Axes:
        """Draw ζ₁ [%] along one decay by all three methods, with 90 % intervals of the noise.

        Parameters
        ----------
        run : str
            Its `run_id`; by default the first free run.
        ax : matplotlib.axes.Axes, optional

        Raises
        ------
        InputError
            If there is no such decay.
        """
        from pipelines.structure.figures_decay import draw_readings

        free = {one.name: one for one in self.experiment.free_runs}
        chosen = free.get(run) if run else next(iter(free.values()), None)
        if chosen is None:
            raise InputError(
                "decay", got=repr(run) if run else "no free run", allowed=", ".join(free) or "a free run"
            )
        with axes_to_draw_on(ax) as axes:
            draw_readings(axes, chosen, "damping")
            axes.set(
                title=in_words(chosen.label),
                xlabel="amplitude of acceleration a [g]",
                ylabel="damping ratio ζ₁ [%]",
            )
            axes.legend()
        return axes

    def _over_amplitude(self, quantity: Any, ax: Axes | None) -> Axes:
        from pipelines.structure.figures_decay import draw_repeats

        with axes_to_draw_on(ax) as axes:
            draw_repeats(axes, self.experiment, quantity)
            axes.legend()
        return axes


@dataclass(frozen=True, eq=False)
class BeamAnalysis(FolderResult):
    """Runs of a beam or a guided tank, analysed: what `analyse_beam` returns.

    Its data are ``modal.nc`` and ``spectra.nc``.

    Attributes
    ----------
    experiment : BeamExperiment
        Everything that was found, run by run.
    call : str
        What was asked for, as the report shows it.
    hashes : mapping
        SHA-256 of everything that was handed over, at the time of the analysis.
    twins : mapping of str to bytes
        Files of the twins and of what they simulated, by name.
    """

    experiment: BeamExperiment
    call: str
    hashes: Mapping[Any, str] = field(repr=False)
    twins: Mapping[str, bytes] = field(repr=False, default_factory=dict)

    @property
    def modal(self) -> xr.Dataset:
        """The contents of ``modal.nc``: modal accelerations [m/s²], damping and frequency along every decay."""
        return self._results["modal.nc"]

    @property
    def spectra(self) -> xr.Dataset:
        """The contents of ``spectra.nc``: densities, H₁, H₂ and coherence of random runs; empty without one."""
        return self._results["spectra.nc"]

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the numbers; empty is good, and else the command exits with 3."""
        return self.experiment.flags

    @property
    def summary(self) -> tuple[str, ...]:
        """The result in sentences, as on top of the report."""
        return sentences(self.experiment)

    @property
    def plot(self) -> BeamPlots:
        """Figures on axes: ``plot.damping(ax=…)``, ``plot.frequency(ax=…)``, ``plot.decay(run, ax=…)``."""
        return BeamPlots(self.experiment)

    def to_datatree(self) -> xr.DataTree:
        """Modal results and spectra as one tree."""
        return xr.DataTree.from_dict({"modal": self.modal, "spectra": self.spectra}, name=self.experiment.kind)

    def _write(self, folder: Path, *, report: bool) -> None:
        write_beam(
            self.experiment, folder, command=self.call, report=report, twins=self.twins, known_sha256=self.hashes
        )

    @cached_property
    def _results(self) -> dict[str, xr.Dataset]:
        return stamped_results(self.experiment, provenance_of_beam(self.experiment, self.call, self.hashes))

    def _repr_html_(self) -> str:
        shown = html.data_sets({"modal": self.modal, "spectra": self.spectra})
        return html.card(self.experiment.title, self.summary, flags=self.flags, more=shown)


def analyse_beam(
    runs: RunsLike,
    rig: RigLike,
    *,
    modes: int | None = None,
    cycles: int = 4,
    segment_s: float | None = None,
    twins: bool = False,
    rom: Sequence[str | os.PathLike[str]] = (),
    ball: Sequence[str | os.PathLike[str]] = (),
) -> BeamAnalysis:
    """Analyse decays and random runs of a tank on a beam or on a guide.

    Parameters
    ----------
    runs : path, xarray.Dataset, xarray.DataTree, or several of them
        Recordings of ``beam_free`` and ``beam_random``, or of ``sdof_free``; frozen, sloshing or empty.
    rig : path or Rig
        With a table ``[structure]``.
    modes : int, optional
        Modes that are kept; by default all of the rig.
    cycles : int
        Cycles per stretch of a decay for envelope and sine fit, at least 2.
    segment_s : float, optional
        Length of the segments of random runs [s]; by default a sixth of the shortest run.
    twins : bool
        Simulate the sloshing runs with frozen liquid and dampers, too; recordings and rig must then be files.
    rom, ball : sequence of path-like
        Models of `train` and files of `sloshlab ball` to simulate the runs with, too.

    Returns
    -------
    BeamAnalysis
        Nothing is written before its `report` or `save`. Upward positive; damping ratios as pure numbers.

    Raises
    ------
    InputError
        If a run, the rig or their combination is bad.

    Notes
    -----
    The command `sloshlab beam` does the same; methods and errors are in ``docs/beam.md``.
    """
    sources, rig_given = run_sources(runs), rig_source(rig)
    settings = checked_settings(modes=modes, n_cycles=cycles, segment_s=segment_s)
    files: Mapping[str, bytes] = {}
    roms, balls = [Path(path) for path in rom], [Path(path) for path in ball]
    if twins or roms or balls:
        experiment, files = analyse_beam_with_twins(sources, rig_given, settings, roms=roms, balls=balls)
    else:
        experiment = analysed(sources, rig_given, settings)
    call = call_text(
        "analyse_beam",
        sources,
        rig=rig_given,
        modes=modes,
        cycles=cycles,
        segment_s=segment_s,
        rom=roms,
        ball=balls,
    )
    hashes = hashes_of(experiment.inputs, {run.path: run.sha256 for run in experiment.runs})
    return BeamAnalysis(experiment, call, hashes, files)
