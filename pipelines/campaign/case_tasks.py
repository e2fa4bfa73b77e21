"""Tasks that diagnose one case each: case folders, and the cases of a blind trial."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from campaigns.stored_task import StoredTask
from pipelines.campaign.plan import DiagnosePart, TrialPart
from pipelines.campaign.recording_tasks import Files, name_of
from pipelines.diagnosis.trial import require_folder_of_answers
from sealed_trial.running import DIAGNOSE, Outcome, answered, read_outcome, require_no_key
from sealed_trial.sealing.trial_folder import READABLE, check_data, read_commitments
from sloshlab.errors import InputError

_KEPT: Final = ("verdict.json", "extended_twin.toml", "retuned_twin.toml", "result.json")


def case_folders(folder: Path, kept_out: Path) -> list[Path]:
    """Case folders: the folder itself, and all below it.

    Parameters
    ----------
    folder : Path
    kept_out : Path
        Folders below it do not count.

    Raises
    ------
    InputError
        If there is no such folder.
    """
    if not folder.is_dir():
        raise InputError(f"folder {folder}", got="no such folder", allowed="a folder of cases")
    own = kept_out.resolve()
    cases = sorted(rig.parent for rig in folder.rglob("rig.toml") if rig.is_file())
    return [case for case in cases if (case / "recordings").is_dir() and own not in case.resolve().parents]


def diagnosis_tasks(part: DiagnosePart, kept_out: Path) -> list[StoredTask]:
    """One task for every case folder.

    Parameters
    ----------
    part : DiagnosePart
    kept_out : Path
        Folders below it do not count.
    """
    top = Path(part.folder.absolute().name)
    return [
        StoredTask(
            name_of(part.name, top if case == part.folder else case.relative_to(part.folder)),
            "pipelines.campaign.case_tasks:diagnosed",
            _files_of(case),
            {"report": part.report},
        )
        for case in case_folders(part.folder, kept_out)
    ]


def _files_of(case: Path) -> dict[str, Sequence[Path]]:
    """What a diagnosis reads: the rig, what it may name beside it, and the recordings."""
    beside = [path for path in sorted(case.iterdir()) if path.is_file() and path.name != "rig.toml"]
    return {"rig": [case / "rig.toml"], "beside": beside, "recordings": sorted((case / "recordings").glob("*.nc"))}


def trial_tasks(part: TrialPart, kept_out: Path) -> list[StoredTask]:
    """One task for every case of a trial, whose files are those that were published.

    Parameters
    ----------
    part : TrialPart
    kept_out : Path
        Not used: a trial says which cases are its own.

    Raises
    ------
    InputError
        If a key is in reach, or data are not those that were published.
    """
    require_folder_of_answers(part.diagnoses)
    require_no_key(part.folder, sys.argv, os.environ)
    commitments = read_commitments(part.folder)
    if commitments.purpose == "sealed" and (part.folder / READABLE).exists():
        raise InputError(f"{part.folder / READABLE}", got="readable truths", allowed="a sealed trial without them")
    for case in commitments.cases:
        check_data(part.folder, case)
    return [
        StoredTask(
            name_of(part.name, Path(case.case)),
            "pipelines.campaign.case_tasks:answered_blindly",
            _files_of(part.folder / "cases" / case.case),
            {"diagnoses": part.diagnoses, "time_limit_s": part.case_time_limit_s},
        )
        for case in commitments.cases
    ]


def diagnosed(
    folder: Path, files: Files, arguments: Mapping[str, Any], say_share: Callable[[float], None]
) -> dict[str, Any]:
    """Diagnose one case; this is what a worker does.

    Parameters
    ----------
    folder : Path
        Takes the verdict.
    files : mapping
        ``rig`` and ``recordings``, of one case folder.
    arguments : mapping
        Whether there shall be a ``report``.
    say_share : callable
    """
    from pipelines.diagnosis.diagnose import diagnose_case

    case = files["rig"][0].parent
    command = f"sloshlab diagnose {case.name}"
    summary = diagnose_case(case, folder, command=command, report=arguments["report"])
    names = "+".join(str(effect["name"]) for effect in summary["effects"])
    return {"flags": summary["flags"], "numbers": {"verdict": summary["verdict"], "effects": names}}


def answered_blindly(
    folder: Path, files: Files, arguments: Mapping[str, Any], say_share: Callable[[float], None]
) -> dict[str, Any]:
    """Diagnose one case of a trial in a process of its own, its answer in the trial; this is what a worker does.

    Parameters
    ----------
    folder : Path
        Takes a copy of the answer.
    files : mapping
        ``rig`` and ``recordings`` of a case.
    arguments : mapping
        Name of the folder of ``diagnoses`` in the trial.
    say_share : callable
    """
    case = files["rig"][0].parent
    require_no_key(case.parent.parent, [], os.environ)
    answer = case.parent.parent / arguments["diagnoses"] / case.name
    outcome = _outcome(case, answer, arguments["time_limit_s"])
    for name in _KEPT:
        if (answer / name).is_file():
            shutil.copyfile(answer / name, folder / name)
    bad = [] if outcome.status == "done" else [f"{case.name} {outcome.status}: {outcome.last_words}"]
    return {"flags": bad, "numbers": {"answer": outcome.status}}


def _outcome(case: Path, answer: Path, time_limit_s: float) -> Outcome:
    """What is there of the case already, as for `sloshlab trial run`; else the case is diagnosed."""
    from sealed_trial.running import OUTCOME

    if (answer / OUTCOME).exists():
        return read_outcome(answer / OUTCOME)
    words = [*DIAGNOSE, str(case), "-o", str(answer), "--no-report"]
    return answered(case, answer, words, time_limit_s)
