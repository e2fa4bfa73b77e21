"""From the parts of a plan to tasks, and from a folder to a plan."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from campaigns.stored_task import StoredTask
from pipelines.campaign.case_tasks import case_folders, diagnosis_tasks, trial_tasks
from pipelines.campaign.plan import Plan, plan_from_document, read_plan
from pipelines.campaign.recording_tasks import matching, recording_tasks
from pipelines.campaign.training_tasks import training_tasks
from sealed_trial.sealing.trial_folder import COMMITMENTS
from sloshlab.errors import InputError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.recording import read_attributes

_TASKS: Final[dict[str, Callable[[Any, Path], list[StoredTask]]]] = {
    "sweep": recording_tasks,
    "beam": recording_tasks,
    "sdof": recording_tasks,
    "train": training_tasks,
    "diagnose": diagnosis_tasks,
    "trial": trial_tasks,
}
KINDS: Final = tuple(_TASKS)
_PIPELINES: Final = {"pipelines.sweep": "sweep", "pipelines.structure": "beam"}


def planned(source: Path, store: Path, kind: str | None = None) -> Plan:
    """The plan in a file, or that of a folder.

    Parameters
    ----------
    source : Path
        Folder or PLAN.toml.
    store : Path
        Takes the results; what lies in it is not read.
    kind : str, optional
        What to do with the files of the folder; by default what they are for.

    Raises
    ------
    InputError
        If the file is no plan, or the folder holds nothing to be done.
    """
    if kind is not None and kind not in KINDS:
        raise InputError("--kind", got=repr(kind)[:80], allowed=", ".join(KINDS))
    if source.is_dir():
        part = {"kind": kind or _kind_of(source, store), "folder": source.absolute()}
        return plan_from_document({"part": [part]}, f"campaign {source}")
    if kind is not None:
        raise InputError("--kind", got="a plan, which says so itself", allowed="--kind with a folder")
    return read_plan(source)


def tasks_of(plan: Plan, store: Path) -> list[StoredTask]:
    """All tasks of a plan, in its order.

    Parameters
    ----------
    plan : Plan
    store : Path
        Takes the results; what lies in it is not read.

    Raises
    ------
    InputError
        If a file is missing or cannot be read, or there is nothing to do.
    """
    tasks = [task for part in plan.parts for task in _TASKS[part.kind](part, store)]
    if not tasks:
        folders = ", ".join(str(part.folder) for part in plan.parts[:3])
        raise InputError(
            f"campaign of {folders}", got="nothing to do", allowed="at least one run of moving liquid"
        )
    return [dataclasses.replace(task, time_limit_s=task.time_limit_s or plan.time_limit_s) for task in tasks]


def _kind_of(folder: Path, store: Path) -> str:
    """What a folder is for: a trial, cases, or recordings of one experiment."""
    if (folder / COMMITMENTS).is_file():
        return "trial"
    recordings = matching(folder, ["*.nc"], store)
    if not recordings:
        if case_folders(folder, store):
            return "diagnose"
        raise InputError(
            f"folder {folder}",
            got="neither recordings nor cases",
            allowed="*.nc with rig*.toml, cases, or a trial",
        )
    return _kind_of_recordings(folder, recordings)


def _kind_of_recordings(folder: Path, recordings: Sequence[Path]) -> str:
    pipeline = EXPERIMENTS[read_attributes(recordings[0]).experiment].pipeline.partition(":")[0]
    kind = next((kind for room, kind in _PIPELINES.items() if pipeline.startswith(f"{room}.")), None)
    if kind is None:
        allowed = "recordings of the shaker, a beam or a guided tank"
        raise InputError(f"recording {recordings[0]}", got="an experiment without a campaign", allowed=allowed)
    return kind
