"""`windows.nc`, `maps.nc` and the report of a sweep experiment, and the summary of its command."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from pipelines.report.outputs import InMemory, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.result_folder import require_result_folder, result_folder
from pipelines.sweep.results import SweepExperiment
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("windows.nc", "maps.nc", *(["report.html"] if report else []))


def write_experiment(
    experiment: SweepExperiment,
    folder: Path,
    *,
    command: str,
    report: bool = True,
    known_sha256: Mapping[Path | InMemory, str] | None = None,
) -> dict[str, Any]:
    """Write `windows.nc`, `maps.nc` and the report; return the summary of the command.

    Parameters
    ----------
    experiment : SweepExperiment
        What was analysed.
    folder : Path
        Made if it is not there. All files appear together, complete, or none does; those of an earlier result go.
    command : str
        What the user typed, for the report.
    report : bool
        False leaves the report and its figures out.
    known_sha256 : mapping, optional
        Hashes of inputs that need not be computed again, beside those of the runs.

    Returns
    -------
    dict
        ``lines`` for people, ``flags``, and numbers for machines.
    """
    provenance = provenance_of_sweeps(experiment, command, known_sha256)
    with result_folder(folder, provenance) as complete:
        for name, dataset in stamped_results(experiment, provenance).items():
            write_dataset(dataset, complete / name)
        if report:
            from pipelines.sweep.report import write_report

            write_report(dataclasses.replace(experiment, provenance=provenance), complete)
    n_windows = int(experiment.windows.sizes["window"])
    n_unsteady = provenance["n_unsteady_windows"]
    left_out = f"; {n_unsteady} left out, their amplitude changes too quickly" if n_unsteady else ""
    lines = [f"windows: {folder / 'windows.nc'} ({n_windows} windows{left_out})", f"maps: {folder / 'maps.nc'}"]
    return {
        "lines": lines + report_lines(folder, written=report),
        "flags": list(experiment.all_flags),
        "findings": [
            {"run": examination.run_id, **finding.to_dict()}
            for examination in experiment.examinations
            for finding in examination.findings
        ],
        "not_checked": {
            e.run_id: [point.text for point in e.not_checked] for e in experiment.examinations if e.not_checked
        },
        "runs": len(experiment.runs),
        "windows": n_windows,
        "unsteady_windows": n_unsteady,
        "output": str(folder),
    }


def provenance_of_sweeps(
    experiment: SweepExperiment, command: str, known_sha256: Mapping[Path | InMemory, str] | None = None
) -> dict[str, Any]:
    """What the results of an experiment rest on."""
    known: dict[Path | InMemory, str] = dict(known_sha256 or {})
    known.update({run.path: run.sha256 for run in experiment.runs})
    # what is kept for a report alone changes no result, nor what identifies it
    settings = dataclasses.replace(experiment.settings, has_report=True)
    return {
        **provenance_of(command, experiment.inputs, known, settings=settings),
        "n_unsteady_windows": sum(int(run.windows.attrs["n_unsteady_windows"]) for run in experiment.runs),
    }


def stamped_results(experiment: SweepExperiment, provenance: Mapping[str, Any]) -> dict[str, xr.Dataset]:
    """The contents of `windows.nc` and `maps.nc` by these names, with what they rest on as attributes."""
    stamp = {
        "title": experiment.title,
        **stamp_of(provenance),
        "half_width_cycles": experiment.settings.windows.half_width_cycles,
        "spacing_cycles": experiment.settings.windows.spacing_cycles,
        "n_unsteady_windows": provenance["n_unsteady_windows"],
    }
    contents = {"windows.nc": experiment.windows, "maps.nc": experiment.maps}
    return {name: dataset.assign_attrs(stamp) for name, dataset in contents.items()}


def analyse_and_write(
    recordings: Sequence[Path], rigs: Sequence[Path], output: Path, command: str
) -> dict[str, Any]:
    """The pipeline of sweeps on the shaker with its usual settings."""
    require_result_folder(output, files_of(report=True))
    experiment = analyse_shaker(recordings, rigs, ShakerSettings())
    return write_experiment(experiment, output, command=command)
