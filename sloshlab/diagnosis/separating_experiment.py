"""The experiment that tells equals apart: found by simulating what could be measured next under each of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from sloshlab.diagnosis.findings import Findings, explained_extension
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.errors import SloshlabError
from sloshlab.identification.case import CaseRun, level
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.identification.rig_parameters import RELEASE
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.twin.structure_forces import MASS_ERROR

_FACTORS: Final = (1 / 3, 3.0)
"""Of the level, and of the frequency, of a run: what a laboratory can set without another rig."""
_SAME_LEVEL: Final = 1.25
"""Ratio up to which two levels are one."""
_ADDED_MASS: Final = 0.1
"""Of the moving mass, as a weight that is known and screwed to the tank."""
_LEAST_NOISE_FLOORS: Final = 3.0
"""Noise floors of one channel by which predictions have to differ, for an experiment to be proposed."""


@dataclass(frozen=True)
class Experiment:
    """An experiment and how far apart its predictions are.

    Attributes
    ----------
    description : str
    channel : str
        That tells most.
    noise_floors : float
        RMS difference of the two models that are nearest to each other, over the noise of that channel.
    """

    description: str
    channel: str
    noise_floors: float


@dataclass(frozen=True, eq=False)
class _Planned:
    """A run that could be made: its drive, its release over that of the run it is like, and a weight."""

    description: str
    run: CaseRun
    release: float = 1.0
    extension: Extension = NOTHING


def separating_experiment(found: Findings, models: Sequence[ScoredModel]) -> Experiment | None:
    """The experiment in which models that predict the same so far differ most.

    Levels and frequencies of every test are changed by a factor of three, and a known mass is added. Numbers of
    each model are those of its fit; noise is that of the recordings.

    Parameters
    ----------
    found : Findings
    models : sequence of ScoredModel
        Two at least.

    Returns
    -------
    Experiment or None
        None where no experiment of these tells them apart, or the twin is a user's own.
    """
    if not isinstance(found.model, RigModel) or len(models) < 2:
        return None
    observed = {run[0].run.name: run for run in (*found.fitting, *found.held_out)}
    experiments = []
    for planned in _planned(found, [run for run in found.case.runs if run.name in observed]):
        told = _told(found, planned, observed[planned.run.name], models)
        if told is not None:
            experiments.append(Experiment(planned.description, *told))
    best = max(experiments, key=lambda experiment: experiment.noise_floors, default=None)
    return best if best is not None and best.noise_floors >= _LEAST_NOISE_FLOORS else None


def _planned(found: Findings, runs: Sequence[CaseRun]) -> list[_Planned]:
    """Changed runs, of every kind of test the one of the largest level."""
    largest: dict[tuple[str, str], CaseRun] = {}
    for run in sorted(runs, key=level):
        largest[run.attributes.experiment, run.attributes.configuration] = run
    planned = []
    weight = Extension(
        terms=(MASS_ERROR(place="tank", mass_kg=_ADDED_MASS * found.surroundings.moving_mass_kg),),
        key=(("added weight",),),
    )
    for run in largest.values():
        kind = "decays" if run.is_free else "runs on the moving base"
        for factor in _FACTORS:
            words = f"{kind} at {_times(factor)} the level of {run.name}"
            if not _is_held(factor * level(run), run, runs):
                planned.append(
                    _Planned(words, run, release=factor)
                    if run.is_free
                    else _Planned(words, _driven(found, run, factor))
                )
            if not run.is_free:
                planned.append(
                    _Planned(
                        f"{kind} at {_times(factor)} the frequencies of {run.name}",
                        _driven(found, run, 1.0, stretch=1.0 / factor),
                    )
                )
        words = (
            f"{kind} like {run.name} with a known mass of {weight.terms[0].values['mass_kg']:.2g} kg on the tank"
        )
        planned.append(_Planned(words, run, extension=weight))
    return planned


def _is_held(wanted: float, like: CaseRun, runs: Sequence[CaseRun]) -> bool:
    """Whether a run of the same kind has about this level already."""
    kind = (like.attributes.experiment, like.attributes.configuration)
    levels = [level(run) for run in runs if (run.attributes.experiment, run.attributes.configuration) == kind]
    return any(wanted / _SAME_LEVEL < held < wanted * _SAME_LEVEL for held in levels)


def _times(factor: float) -> str:
    return f"{factor:g} times" if factor >= 1 else "a third of"


def _driven(found: Findings, run: CaseRun, factor: float, stretch: float = 1.0) -> CaseRun:
    """A run whose drive is larger, or slower."""
    recording = run.recording
    time = np.arange(recording.sizes["time"], dtype=np.float64)
    for name in found.model.driving(run):
        values = np.nan_to_num(np.asarray(recording[name].values, np.float64))
        moved = np.interp(time / stretch, time, values, right=0.0)
        recording = recording.assign({name: recording[name].copy(data=factor * moved)})
    return replace(run, recording=recording)


def _told(
    found: Findings, planned: _Planned, observed: Sequence[Observation], models: Sequence[ScoredModel]
) -> tuple[str, float] | None:
    """Channel that tells most and how much, of the two models that are nearest to each other."""
    assert isinstance(found.model, RigModel)
    release = f"{RELEASE}{planned.run.name}"
    try:
        # A model of its own, as drives are cached by the name of a run.
        rig = RigModel(found.model.rig, found.case.folder, [planned.run])
        readings = [
            rig.simulate(
                planned.run,
                {**model.values, release: planned.release * model.values.get(release, 0.0)}
                if planned.run.is_free
                else model.values,
                planned.extension + explained_extension(model),
            )
            for model in models
        ]
    except SloshlabError:
        return None
    nearest: tuple[str, float] | None = None
    for first, other in combinations(readings, 2):
        sizes = {
            each.channel: float(
                np.sqrt(
                    np.mean((each.of(first[each.channel]) - each.of(other[each.channel])) ** 2 / each.variance)
                )
            )
            for each in observed
            if each.channel in first
        }
        channel = max(sizes, key=lambda name: sizes[name])
        if nearest is None or sizes[channel] < nearest[1]:
            nearest = (channel, sizes[channel])
    return nearest
