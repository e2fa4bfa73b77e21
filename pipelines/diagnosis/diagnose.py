"""The command `diagnose`: what physics the simulation of a case left out."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from threadpoolctl import threadpool_limits

from pipelines.diagnosis.results import Diagnosis
from pipelines.diagnosis.workers import Workers
from pipelines.inputs.recordings import RunSource, recording_of
from pipelines.inputs.rigs import RigSource, folder_of, rig_of
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines
from pipelines.report.progress import amounts
from pipelines.report.result_folder import require_result_folder, result_folder
from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.consistency.samples import examined_samples
from sloshlab.diagnosis.examination import examined, seen_at
from sloshlab.diagnosis.findings import findings_of
from sloshlab.diagnosis.verdict import verdict_of
from sloshlab.errors import InputError
from sloshlab.flight_twin.described_wing import MODEL
from sloshlab.flight_twin.twin import flight_twin
from sloshlab.identification.case import MOST_RUNS, Case, CaseRun, read_case
from sloshlab.informative_runs import informative_runs
from sloshlab.missing_physics.user_effects import load_user_effects
from sloshlab.recording import run_attributes
from sloshlab.user_twin import BlockTwinModel, UserTwinModel, load_user_twin, with_known_drive


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
    opened = opened_folder(folder, with_rig=twin is None and not is_flight(folder))
    # Before the search, which takes minutes: a folder that is in the way has to be said at once.
    require_result_folder(target, files_of(report=report))
    diagnosis = diagnosed(opened, command=command, twin=twin, effects=effects, told=say)
    return write_diagnosis(diagnosis, target, report=report)


_STAGES: Final = (
    ("retuning", 0.1),
    ("one effect", 0.38),
    ("in the place of", 0.65),
    ("refining", 0.60),
    ("one more effect", 0.43),
    ("in the place of", 0.73),
)
"""Share of a search that is over in each of its stages: medians over 86 searches of blind trials that took longer
than a minute, looked at every half minute. Whether an effect more is sought is known late: the shares may fall."""


@dataclass(frozen=True, eq=False)
class OpenedCase:
    """A case without the samples that were not measured.

    Attributes
    ----------
    case : Case
    recordings : tuple of ConsistencyExamination
        Whether each recording agrees with itself.
    sources : tuple of Path, RecordingInMemory or RigInMemory
        What it was read from: the rig, where it has one, and the recordings.
    """

    case: Case
    recordings: tuple[ConsistencyExamination, ...]
    sources: tuple[RunSource | RigSource, ...]


def opened_folder(folder: Path, *, with_rig: bool = True) -> OpenedCase:
    """The case in a folder with ``rig.toml`` and ``recordings/*.nc``.

    Raises
    ------
    InputError
        If the folder is no case, or holds more than can be judged.
    """
    case = read_case(folder, with_rig=with_rig)
    files = sorted((folder / "recordings").glob("*.nc"))
    described = [folder / "rig.toml"] if with_rig else [folder / MODEL] if is_flight(folder) else []
    return _examined(case, (*described, *files))


def is_flight(folder: Path) -> bool:
    """Whether a case is one of a wing in flight, which a model file describes in the place of a rig."""
    return (folder / MODEL).is_file() and not (folder / "rig.toml").exists()


def opened_recordings(name: str, runs: Sequence[RunSource], rig: RigSource | None) -> OpenedCase:
    """A case of recordings that lie in no folder together, or in memory.

    Parameters
    ----------
    name : str
        What the case is called.
    runs : sequence of Path or RecordingInMemory
    rig : Path or RigInMemory, optional
        None where a twin of the user's own stands for it.

    Raises
    ------
    InputError
        If a recording or the rig is bad, two recordings have one name, or there are too many.
    """
    if not 1 <= len(runs) <= MOST_RUNS:
        raise InputError(f"case {name}", got=f"{len(runs)} recordings", allowed=f"1 … {MOST_RUNS}")
    found: dict[str, CaseRun] = {}
    for run in runs:
        called = run.stem if isinstance(run, Path) else run.name
        if called in found:
            raise InputError(f"case {name}", got=f"two recordings {called}", allowed="one of each name")
        recording = recording_of(run)
        found[called] = CaseRun(called, recording, run_attributes(recording))
    described, folder = (None, None) if rig is None else (rig_of(rig), folder_of(rig))
    in_order = tuple(found[called] for called in sorted(found))
    case = Case(name, folder or Path(), described, in_order)
    return _examined(case, (*([] if rig is None else [rig]), *runs))


# Workers keep every core busy; threads of BLAS beside them wait for one another (a third of the processor), and
# round sums by how many they are.
@threadpool_limits.wrap(limits=1)  # type: ignore[untyped-decorator]
def diagnosed(
    opened: OpenedCase,
    *,
    command: str,
    twin: Path | None = None,
    effects: Sequence[Path] = (),
    told: Callable[[str], None] = lambda line: None,
) -> Diagnosis:
    """Search what physics the simulation of a case left out.

    Parameters
    ----------
    opened : OpenedCase
    command : str
        What the user typed, for the report.
    twin, effects : Path, sequence of Path
        As of `diagnose_case`.
    told : callable
        Takes what these runs can decide, a line each, before the search.
    """
    case, remarks = opened.case, list[str]()
    own = [effect for file in effects for effect in load_user_effects(file)]
    model: UserTwinModel | None = None
    cut = tuple[str, ...]()
    if twin is not None:
        described = load_user_twin(twin)
        case, cut = with_known_drive(case, described.driving)
        model = UserTwinModel(described, case.runs, name=f"twin {twin}", executor=Workers())
    elif is_flight(case.folder):
        wing = flight_twin(case.folder / MODEL)
        case, cut = with_known_drive(case, wing.driving)
        model = BlockTwinModel(wing, case.runs, name=f"model {case.folder / MODEL}", executor=Workers())
    # Before the search: who reads that a run is lacking may record it instead of waiting for an answer.
    untold = iter(informative_runs(case).lines)
    with amounts("diagnosing", _STAGES) as advance:

        def progressed(what: str, done: int, of: int) -> None:
            # At the first step, when nothing refuses the case any more.
            for line in untold:
                told(line)
            advance(done, max(of, 1), what)

        found = findings_of(case, progressed, model, executor=Workers())
        verdict = verdict_of(found)
    examination = examined(found)
    named = verdict.best if verdict.kind != "unknown" else None
    verdict = verdict.seen(seen_at(examination, named, verdict.block))
    remarks += cut
    if own:
        remarks.append("effects of your own: " + ", ".join(f"{effect.block}.{effect.name}" for effect in own))
    inputs = (*([] if twin is None else [twin]), *_in_order(opened, effects))
    provenance = provenance_of(command, inputs, settings="diagnosis")
    return Diagnosis(found, verdict, examination, provenance, opened.recordings, tuple(remarks))


def write_diagnosis(diagnosis: Diagnosis, target: Path, *, report: bool = True) -> dict[str, Any]:
    """Write ``verdict.json``, the twins and the report; return the summary of the command.

    Parameters
    ----------
    diagnosis : Diagnosis
    target : Path
        All files appear together, complete, or none does.
    report : bool
        False leaves the report and its figures out.
    """
    found, verdict, facts = diagnosis.findings, diagnosis.verdict, diagnosis.facts
    with result_folder(target, diagnosis.provenance) as complete:
        atomic_file.write_bytes(complete / "verdict.json", (json.dumps(facts, indent=1) + "\n").encode())
        best = verdict.model or found.retuned
        found.model.save_extended(best.values, best.fit.candidates, complete / "extended_twin.toml")
        found.model.save_extended(found.retuned.values, (), complete / "retuned_twin.toml")
        if report:
            # Drawing is imported only where a report is wanted: the trial runs without.
            from pipelines.diagnosis.sections import page_of
            from pipelines.report.page import write_page

            write_page(page_of(diagnosis), complete, result_id=diagnosis.provenance[RESULT_ID])
    lines = [
        verdict.headline,
        verdict.statement,
        f"verdict: {verdict.kind}",
        f"written: {target / 'verdict.json'}",
        *diagnosis.remarks,
    ]
    return {"lines": lines + report_lines(target, written=report), "flags": list(diagnosis.flags), **facts}


def _in_order(opened: OpenedCase, effects: Sequence[Path]) -> list[RunSource | RigSource]:
    """What a case was read from, with the user's own effects between rig and recordings."""
    n_rigs = int(opened.case.rig is not None)
    return [*opened.sources[:n_rigs], *effects, *opened.sources[n_rigs:]]


def _examined(case: Case, sources: tuple[RunSource | RigSource, ...]) -> OpenedCase:
    """The case without samples that were not measured, and what was found of them.

    Delays, gains and limits of sensors stay: they are effects that the diagnosis finds by itself.
    """
    runs, examinations = [], []
    for run in case.runs:
        found, wrong = examined_samples(run.recording, checks=("held samples", "filled samples", "spikes"))
        examination = ConsistencyExamination(run.name, tuple(found), (), wrong)
        runs.append(dataclasses.replace(run, recording=examination.measured_only(run.recording)))
        examinations.append(examination)
    return OpenedCase(dataclasses.replace(case, runs=tuple(runs)), tuple(examinations), sources)
