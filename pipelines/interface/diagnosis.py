"""The diagnosis in Python: a case in, a verdict with its evidence out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pipelines.diagnosis.diagnose import diagnosed, opened_folder, opened_recordings, write_diagnosis
from pipelines.diagnosis.results import Diagnosis
from pipelines.inputs.recordings import RecordingInMemory, RunsLike, run_sources
from pipelines.inputs.rigs import RigLike, rig_source
from pipelines.interface import html
from pipelines.interface.drawing import axes_to_draw_on, in_words, legend_below
from pipelines.interface.folder_result import FolderResult
from pipelines.interface.provenance import call_text
from sloshlab.errors import InputError
from sloshlab.identification.observations import Observation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Final = {
    "nothing_missing": html.GOOD,
    "named": html.FOUND,
    "indistinguishable": html.OPEN,
    "unknown": html.FLAGGED,
}


def held_out_runs(diagnosis: Diagnosis) -> frozenset[str]:
    """Names of the runs that chose nothing; one run alone is fitted, too, and is none of them."""
    split = diagnosis.findings.split
    return frozenset(run.name for run in split.held_out) if split.has_held_out else frozenset()


@dataclass(frozen=True)
class DiagnosisPlots:
    """Figures of a diagnosis, each on axes that are given or new.

    Attributes
    ----------
    diagnosis : Diagnosis
    """

    diagnosis: Diagnosis

    def before_after(self, run: str = "", channel: str = "", *, ax: Axes | None = None) -> Axes:
        """Draw a channel as recorded, by the retuned baseline, and with what was left out.

        Ten cycles are shown, those that the retuned baseline misses most.

        Parameters
        ----------
        run, channel : str
            By default the held-out run, which chose nothing, that is missed most, and its channel where a named
            effect acts or else the one that is missed most.
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        InputError
            If there is no such run or channel.
        """
        from pipelines.diagnosis.figures import draw_before_after

        observation = self._observation(run, channel)
        role = "held out" if observation.run.name in held_out_runs(self.diagnosis) else "fitted"
        with axes_to_draw_on(ax) as axes:
            draw_before_after(axes, self.diagnosis, observation)
            axes.set_title(f"{in_words(observation.run.name)}, {role}")
            axes.set_ylabel(axes.get_ylabel().replace("$", r"\$"), fontsize=axes.xaxis.label.get_fontsize())
            legend_below(axes)
        return axes

    def errors(self, *, ax: Axes | None = None) -> Axes:
        """Draw the error on held-out runs over the noise floor, of the model as believed, retuned and named.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        """
        from pipelines.diagnosis.figures import draw_held_out_errors

        with axes_to_draw_on(ax) as axes:
            draw_held_out_errors(axes, self.diagnosis)
        return axes

    def _observation(self, run: str, channel: str) -> Observation:
        from pipelines.diagnosis.figures import most_missed_observations

        found = self.diagnosis.findings
        observed = [one for of_run in (*found.held_out, *found.fitting) for one in of_run]
        if not run:
            observed = most_missed_observations(self.diagnosis)
        matching = [one for one in observed if run in ("", one.run.name) and channel in ("", one.channel)]
        if not matching:
            known = ", ".join(sorted({f"{one.run.name}: {one.channel}" for one in observed}))
            raise InputError("run and channel", got=f"{run or 'any'}: {channel or 'any'}", allowed=known)
        return matching[0]


@dataclass(frozen=True, eq=False)
class CaseVerdict(FolderResult):
    """What physics a simulation left out, with size, place and evidence: what `diagnose` returns.

    Its data are ``verdict.json`` and the extended and retuned twins.

    Attributes
    ----------
    diagnosis : Diagnosis
        Everything that was found.
    """

    diagnosis: Diagnosis = field(repr=False)

    @property
    def kind(self) -> str:
        """``nothing_missing``, ``named``, ``indistinguishable`` or ``unknown``."""
        return self.diagnosis.verdict.kind

    @property
    def headline(self) -> str:
        """The answer in at most forty words."""
        return self.diagnosis.verdict.headline

    @property
    def statement(self) -> str:
        """The answer with its numbers and what speaks for it."""
        return self.diagnosis.verdict.statement

    @property
    def effects(self) -> list[dict[str, Any]]:
        """What was left out: name, block, numbers with their intervals, and where it shows; as in verdict.json."""
        return list(self.facts["effects"])

    @property
    def probabilities(self) -> dict[str, float]:
        """Of every explanation; they add up to 1."""
        return dict(self.diagnosis.verdict.probabilities)

    @property
    def separating_experiment(self) -> str:
        """Which experiment tells apart what this case cannot; empty where none is needed."""
        return self.diagnosis.verdict.separating_experiment

    @property
    def fit(self) -> dict[str, Any]:
        """Errors on runs that chose nothing, in noise floors: ``heldout_retuned``, ``heldout_after`` and more."""
        return dict(self.facts["fit"])

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the verdict; empty is good."""
        return self.diagnosis.flags

    @cached_property
    def facts(self) -> dict[str, Any]:
        """The content of ``verdict.json``."""
        return self.diagnosis.facts

    @property
    def plot(self) -> DiagnosisPlots:
        """Figures on axes: ``plot.before_after(ax=…)``, ``plot.errors(ax=…)``."""
        return DiagnosisPlots(self.diagnosis)

    def histories(self) -> xr.DataTree:
        """Every channel of every run, recorded and simulated.

        Returns
        -------
        xarray.DataTree
            One node a run; variables ``channel(model, time)`` in the units of the recording, upward positive, for
            the models ``recorded``, ``retuned`` (the baseline with its best numbers) and, where there is one,
            ``extended`` (with what was left out, or the nearest that is known). ``held_out`` says which runs chose
            nothing.
        """
        found = self.diagnosis.findings
        held_out = held_out_runs(self.diagnosis)
        readings = {"retuned": found.readings(found.retuned)}
        if self.diagnosis.after is not None:
            readings["extended"] = found.readings(self.diagnosis.after)
        parts = {}
        for run in found.case.runs:
            known = [name for name in readings["retuned"][run.name] if name in run.recording]
            variables = {
                name: (
                    ("model", "time"),
                    np.stack([run.recording[name].values, *(of[run.name][name] for of in readings.values())]),
                    {"units": run.recording[name].attrs["units"]},
                )
                for name in known
            }
            coordinates = {"model": ["recorded", *readings], "time": run.recording["time"]}
            parts[run.name] = xr.Dataset(variables, coordinates, {"held_out": int(run.name in held_out)})
        return xr.DataTree.from_dict(parts, name=found.case.name)

    def _write(self, folder: Path, *, report: bool) -> None:
        write_diagnosis(self.diagnosis, folder, report=report)

    def __repr__(self) -> str:
        return f"<CaseVerdict {self.kind}: {self.headline}>"

    def _repr_html_(self) -> str:
        fit = self.fit
        chose_nothing = held_out_runs(self.diagnosis)
        which = "runs that chose nothing" if chose_nothing else "the fitted runs, as there is no other"
        error = f"{fit['heldout_retuned']:.3g} → {fit['heldout_after']:.3g} times the noise"
        lines = [self.headline, f"error on {which}: {error}", self.statement]
        if self.separating_experiment:
            lines.append(f"to tell them apart: {self.separating_experiment}")
        rows = [
            (
                f"{effect['name']} ({effect['block']})",
                name,
                f"{number['estimate']:.4g}",
                f"{number['low']:.4g} … {number['high']:.4g}",
            )
            for effect in self.effects
            for name, number in effect["parameters"].items()
        ]
        more = html.table(("effect", "number", "estimate", "interval"), rows) if rows else ""
        title = f"{self.diagnosis.findings.case.name}: {self.kind.replace('_', ' ')}"
        return html.card(title, lines, colour=_COLOURS[self.kind], flags=self.flags, more=more)


def diagnose(
    case: str | os.PathLike[str] | RunsLike,
    *,
    rig: RigLike | None = None,
    twin: str | os.PathLike[str] | None = None,
    effects: Sequence[str | os.PathLike[str]] = (),
    name: str = "case",
) -> CaseVerdict:
    """Find what physics the simulation of a case left out, or that nothing is missing.

    Parameters
    ----------
    case : path, xarray.DataTree, or several recordings
        A folder with ``rig.toml`` and ``recordings/*.nc``; or recordings, as `analyse_sweep` takes them, and
        `rig`.
    rig : path or Rig, optional
        Of recordings that lie in no case folder.
    twin : path-like, optional
        Python module of a twin of one's own instead of that of the rig; its code is run.
    effects : sequence of path-like
        Python modules with effects of one's own; their code is run.
    name : str
        Of a case that is no folder.

    Returns
    -------
    CaseVerdict
        Nothing is written before its `report` or `save`. The search takes minutes.

    Raises
    ------
    InputError
        If the case or the rig is bad.

    Notes
    -----
    The command `sloshlab diagnose` does the same; the method, and how often it is right, are in
    ``docs/diagnosis.md`` and ``docs/blind_trial.md``.
    """
    module, modules = None if twin is None else Path(twin), [Path(path) for path in effects]
    if isinstance(case, str | os.PathLike):
        if rig is not None:
            got = "a folder, and a rig besides"
            raise InputError("case", got=got, allowed="the rig of the folder", remedy="give recordings with rig=")
        opened = opened_folder(Path(case), with_rig=module is None)
        call = call_text("diagnose", [Path(case).absolute()], twin=module, effects=modules)
        return CaseVerdict(diagnosed(opened, command=call, twin=module, effects=modules))
    if isinstance(case, xr.Dataset | RecordingInMemory) or (rig is None) == (module is None):
        got = "one recording" if isinstance(case, xr.Dataset | RecordingInMemory) else "recordings without"
        raise InputError(f"case {name}", got=got, allowed="several recordings, with rig= or twin=")
    runs = run_sources(case)
    described = None if rig is None else rig_source(rig)
    call = call_text("diagnose", runs, rig=described, twin=module, effects=modules)
    opened = opened_recordings(name, runs, described)
    return CaseVerdict(diagnosed(opened, command=call, twin=module, effects=modules))
