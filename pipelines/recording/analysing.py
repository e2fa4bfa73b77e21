"""The command `analyse`: recordings go to the pipeline that their experiment names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sloshlab.errors import AnalysisError
from sloshlab.experiments import EXPERIMENTS, Experiment, experiment_names
from sloshlab.recording import channels, read_attributes, read_recording
from sloshlab.registry import loaded

Pipeline = Callable[[Sequence[Path], Sequence[Path], Path, str], dict[str, Any]]
"""Takes recordings, rigs, folder for the results and the command as typed; returns the summary of the command."""


def analyse_runs(paths: Sequence[Path], rigs: Sequence[Path], output: Path, command: str) -> dict[str, Any]:
    """Analyse recordings by the pipeline of their experiment.

    Parameters
    ----------
    paths, rigs : sequence of Path
        Recordings, and the rigs that they belong to.
    output : Path
        Folder for the results.
    command : str
        What the user typed, for the report.

    Raises
    ------
    AnalysisError
        If the runs belong to different pipelines or to none, or lack a channel that their experiment needs.
    """
    described = {path: EXPERIMENTS[read_attributes(path).experiment] for path in paths}
    references = {experiment.pipeline for experiment in described.values()}
    if len(references) != 1 or "" in references:
        raise AnalysisError(
            "recordings to analyse",
            got=f"experiments {', '.join(sorted({experiment.name for experiment in described.values()}))}",
            allowed=f"runs of one pipeline: {_pipelines()}",
            remedy="analyse them apart; `sloshlab work` takes any sweep",
        )
    for path, experiment in described.items():
        _require_channels(path, experiment)
    pipeline: Pipeline = loaded(references.pop())
    return pipeline(paths, rigs, output, command)


def _pipelines() -> str:
    references = dict.fromkeys(experiment.pipeline for experiment in EXPERIMENTS if experiment.pipeline)
    return "; or ".join(", ".join(_names_of(reference)) for reference in references)


def _names_of(pipeline: str) -> Sequence[str]:
    return experiment_names(lambda experiment: experiment.pipeline == pipeline)


def _require_channels(path: Path, experiment: Experiment) -> None:
    there = channels(read_recording(path))
    missing = experiment.missing_channels(there)
    if missing:
        raise AnalysisError(
            f"{path}: channels",
            got=", ".join(there),
            allowed=f"for {experiment.name} also {', '.join(f'{start}…' for start in missing)}",
            remedy="record or import the missing channels",
        )
