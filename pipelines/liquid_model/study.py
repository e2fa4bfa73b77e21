"""The command `study`: many models of one liquid, picked by validation error."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from campaigns.where import Where, executor_of
from pipelines.liquid_model.sensitivity_study import MODEL_NAME, sensitivity_study
from pipelines.liquid_model.study_cases import FURTHER_CASES, SOURCE_CASES, CaseResult, picked
from pipelines.liquid_model.study_page import StudiedModels, page_of
from pipelines.liquid_model.training_runs import RunFiles, training_runs
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.page import write_page
from pipelines.report.progress import amounts
from pipelines.report.result_folder import require_result_folder, result_folder
from pipelines.report.terminal import warn
from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.quantities import described
from sloshlab.reduced_order_model.training import TrainingSettings

CASES: Final = {"source": SOURCE_CASES, "all": (*SOURCE_CASES, *FURTHER_CASES)}
BEST_NAME: Final = "ROM.nc"


@dataclass(frozen=True)
class StudySettings:
    """Choices of a study.

    Attributes
    ----------
    cases : {"all", "source"}
    rate_hz : float, optional
        By default chosen from the training runs.
    n_workers : int
    scheduler : str, optional
        Of a cluster that trains instead of processes of this machine.
    """

    cases: str = "all"
    rate_hz: float | None = None
    n_workers: int = 2
    scheduler: str | None = None


def study(
    files: RunFiles, folder: Path, wanted: StudySettings, settings: TrainingSettings, *, command: str
) -> dict[str, Any]:
    """Train all cases, pick one, and write table, figure and the picked model; return the summary of the command.

    Parameters
    ----------
    files : RunFiles
    folder : Path
        Cases that it holds already are not trained again.
    wanted : StudySettings
    settings : TrainingSettings
    command : str
        What the user typed, for the report.

    Raises
    ------
    InputError
        If a recording, the rig or a setting is bad.
    """
    if wanted.cases not in CASES:
        raise InputError("--cases", got=repr(wanted.cases), allowed=", ".join(CASES))
    require_result_folder(folder, ["study.nc", BEST_NAME, "report.html"])
    runs = training_runs(files, wanted.rate_hz)
    with amounts("study") as advance:
        last = ""

        def on_case(result: CaseResult, done: int, n: int) -> None:
            nonlocal last
            last = f"{done} of {n} cases, {result.case.name}: {math.sqrt(result.validation_mse):.4g} N"

        results = sensitivity_study(
            [signals.run() for signals in runs.training],
            [signals.run() for signals in runs.validation],
            runs.rate_hz,
            folder,
            settings,
            cases=CASES[wanted.cases],
            executor=executor_of(Where(wanted.scheduler, wanted.n_workers, fresh=True), said=warn),
            facts=runs.facts(),
            on_case=on_case,
            on_progress=lambda share: advance(share, 1.0, last),
        )
    pick = picked(results)
    best = folder / pick.best.case.name / MODEL_NAME
    inputs = (*files.training, *files.validation, *files.still, files.rig)
    provenance = provenance_of(command, inputs, settings=(replace(wanted, n_workers=1, scheduler=None), settings))
    flags = (*runs.flags, *(f"{result.case.name}: {result.ended}" for result in results if not result.is_trained))
    found = StudiedModels(tuple(results), pick, settings, runs.rate.reason, flags, provenance)
    with result_folder(folder, provenance) as complete:
        write_dataset(dataset_of(results).assign_attrs(stamp_of(provenance)), complete / "study.nc")
        atomic_file.write_bytes(complete / BEST_NAME, best.read_bytes())
        write_page(page_of(found), complete, result_id=provenance[RESULT_ID])
    return {
        "lines": [f"picked: {pick.reason}", f"model: {folder / BEST_NAME}", *report_lines(folder)],
        "flags": list(flags),
        "output": str(folder),
        "picked": pick.best.case.name,
        "lighter": pick.lighter.case.name,
        "validation_rms_n": math.sqrt(pick.best.validation_mse),
        "cases": len(results),
        "training_s": sum(result.seconds for result in results),
    }


def dataset_of(results: list[CaseResult]) -> xr.Dataset:
    """One row per case, the best first; errors are infinite where a case could not be trained."""
    variables: dict[str, list[Any]] = {
        "study_case": [result.case.name for result in results],
        "structure": [result.case.structure for result in results],
        "network": [result.case.network for result in results],
        "n_input_delays": [result.case.delays for result in results],
        "n_output_delays": [result.case.output_delays for result in results],
        "n_neurons": [result.case.neurons for result in results],
        "n_parameters": [result.n_parameters for result in results],
        "n_epochs": [result.n_epochs for result in results],
        "training_s": [result.seconds for result in results],
        "training_rms_n": [math.sqrt(result.training_mse) for result in results],
        "validation_rms_n": [math.sqrt(result.validation_mse) for result in results],
        "ended": [result.ended for result in results],
    }
    columns: dict[str, Any] = {}
    for name, values in variables.items():
        is_text = isinstance(values[0], str)
        columns[name] = ("case_number", np.array(values, dtype=object if is_text else None))
    return described(xr.Dataset(columns)).assign_attrs(title="Sensitivity study of reduced-order models")
