"""The command `diagnose`: what physics the simulation of a case left out."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipelines.diagnosis.results import Diagnosis
from pipelines.diagnosis.worker_threads import WorkerThreads
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines
from pipelines.report.progress import amounts
from pipelines.report.result_folder import require_result_folder, result_folder
from sloshlab import atomic_file
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.consistency.samples import examined_samples
from sloshlab.diagnosis.examination import examination_facts, examined, seen_at
from sloshlab.diagnosis.findings import findings_of
from sloshlab.diagnosis.verdict import verdict_facts, verdict_of
from sloshlab.identification.case import Case, read_case
from sloshlab.missing_physics.user_effects import load_user_effects
from sloshlab.user_twin import UserTwinModel, load_user_twin, with_known_drive


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written for certain."""
    return ("verdict.json", "extended_twin.toml", "retuned_twin.toml", *(["report.html"] if report else []))


def diagnose_case(
    folder: Path,
    output: Path | None,
    *,
    command: str,
    report: bool = True,
    twin: Path | None = None,
    effects: Sequence[Path] = (),
) -> dict[str, Any]:
    """Diagnose a case; write ``verdict.json`` and the report; return the summary of the command.

    Parameters
    ----------
    folder : Path
    output : Path, optional
        ``diagnosis/`` in the case folder by default. All files appear together, complete, or none does.
    command : str
        What the user typed, for the report.
    report : bool
        False leaves the report and its figures out.
    twin : Path, optional
        Python module of a user's own twin; its code is run.
    effects : sequence of Path
        Python modules with effects of a user's own; their code is run.
    """
    target = output or folder / "diagnosis"
    case, recordings = _examined(read_case(folder, with_rig=twin is None))
    # Before the search, which takes minutes: a folder that is in the way has to be said at once.
    require_result_folder(target, files_of(report=report))
    own = [effect for file in effects for effect in load_user_effects(file)]
    model, cut = None, tuple[str, ...]()
    if twin is not None:
        described = load_user_twin(twin)
        case, cut = with_known_drive(case, described.driving)
        model = UserTwinModel(described, case.runs, name=f"twin {twin}", executor=WorkerThreads())
    with amounts("diagnosing") as advance:
        found = findings_of(
            case, lambda what, done, of: advance(done, max(of, 1), what), model, executor=WorkerThreads()
        )
        verdict = verdict_of(found)
    examination = examined(found)
    named = verdict.best if verdict.kind != "unknown" else None
    verdict = verdict.seen(seen_at(examination, named, verdict.block))
    provenance = _provenance(case, command, twin, effects)
    facts = {RESULT_ID: provenance[RESULT_ID], **verdict_facts(found, verdict)}
    facts |= examination_facts(examination, found)
    diagnosis = Diagnosis(found, verdict, examination, provenance, recordings)
    with result_folder(target, provenance) as complete:
        atomic_file.write_bytes(complete / "verdict.json", (json.dumps(facts, indent=1) + "\n").encode())
        best = verdict.model or found.retuned
        found.model.save_extended(best.values, best.fit.candidates, complete / "extended_twin.toml")
        found.model.save_extended(found.retuned.values, (), complete / "retuned_twin.toml")
        if report:
            # Drawing is imported only where a report is wanted: the trial runs without.
            from pipelines.diagnosis.sections import page_of
            from pipelines.report.page import write_page

            write_page(page_of(diagnosis), complete, result_id=provenance[RESULT_ID])
    lines = [
        verdict.headline,
        verdict.statement,
        f"verdict: {verdict.kind}",
        f"written: {target / 'verdict.json'}",
    ]
    lines += cut
    if own:
        lines.append("effects of your own: " + ", ".join(f"{effect.block}.{effect.name}" for effect in own))
    return {"lines": lines + report_lines(target, written=report), "flags": list(diagnosis.flags), **facts}


def _examined(case: Case) -> tuple[Case, tuple[ConsistencyExamination, ...]]:
    """The case without samples that were not measured, and what was found of them.

    Delays, gains and limits of sensors stay: they are effects that the diagnosis finds by itself.
    """
    runs, examinations = [], []
    for run in case.runs:
        found, wrong = examined_samples(run.recording, checks=("held samples", "filled samples", "spikes"))
        examination = ConsistencyExamination(run.name, tuple(found), (), wrong)
        runs.append(dataclasses.replace(run, recording=examination.measured_only(run.recording)))
        examinations.append(examination)
    return dataclasses.replace(case, runs=tuple(runs)), tuple(examinations)


def _provenance(case: Case, command: str, twin: Path | None, effects: Sequence[Path]) -> dict[str, Any]:
    files = [twin or case.folder / "rig.toml", *effects, *sorted((case.folder / "recordings").glob("*.nc"))]
    return provenance_of(command, files, settings="diagnosis")
