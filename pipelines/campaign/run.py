"""The command `campaign`: a plan carried out, what failed in a line each, a table and a page."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from campaigns.campaign import run_campaign
from campaigns.outcome import Outcome
from campaigns.store import RESULTS, Store, require_names
from campaigns.stored_task import StoredTask
from campaigns.where import Where, executor_of
from pipelines.campaign.kinds import planned, tasks_of
from pipelines.campaign.plan import Plan
from pipelines.campaign.summary_page import CarriedOut, page_of
from pipelines.campaign.summary_tables import summary_csv, timings_csv
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines
from pipelines.report.page import write_page
from pipelines.report.progress import progress
from pipelines.report.result_folder import require_result_folder, result_folder
from pipelines.report.terminal import warn
from sloshlab import atomic_file
from sloshlab.errors import InputError

PLAN: Final = "plan.json"
_PLAN_MARK: Final = b'"sloshlab_campaign"'
_LOOKED_AT_BYTES: Final = 100
FILES: Final = ("summary.csv", "timings.csv", "report.html")


@dataclass(frozen=True)
class CampaignOptions:
    """Choices of the command.

    Attributes
    ----------
    kind : str, optional
        What to do with the files of a folder.
    where : Where
        This machine or a cluster.
    time_limit_s : float, optional
        Of every task, in place of that of the plan.
    retries : int, optional
        In place of those of the plan.
    failed_again : bool
        Whether tasks that failed or took too long are tried again.
    report : bool
        False leaves the page out.
    """

    kind: str | None
    where: Where
    time_limit_s: float | None = None
    retries: int | None = None
    failed_again: bool = False
    report: bool = True


def carry_out(source: Path, folder: Path, options: CampaignOptions, *, command: str) -> dict[str, Any]:
    """Carry out a campaign; return the summary of the command.

    Parameters
    ----------
    source : Path
        Folder or PLAN.toml.
    folder : Path
        Takes the results; what is there already of the same files and settings is kept.
    options : CampaignOptions
    command : str
        What the user typed, for the page.

    Raises
    ------
    InputError
        If the plan is bad, a file is missing, or there is no space for results.
    ClusterError
        If a cluster cannot be reached, or is lost.
    """
    require_result_folder(folder, FILES if options.report else FILES[:2])
    plan = _with_options(planned(source, folder, options.kind), options)
    tasks = tasks_of(plan, folder)
    require_names(tasks)
    _keep_plan(plan, folder)
    executor = executor_of(options.where, plan.slurm.asked, said=warn)
    kept: list[str] = []
    with progress("campaign", len(tasks)) as advance:

        def finished(task: StoredTask, outcome: Outcome, before: bool) -> None:
            if before:
                kept.append(task.name)
            took = "kept" if before else f"{outcome.status} in {outcome.seconds:.1f} s"
            advance(f"{task.name} {took}")

        outcomes = run_campaign(
            tasks,
            Store(folder),
            executor,
            retries=plan.retries,
            failed_again=options.failed_again,
            finished=finished,
        )
    carried = CarriedOut(tuple(tasks), outcomes, len(kept))
    _write(carried, folder, plan, command=command, report=options.report)
    return _summary(carried, folder, report=options.report)


def _with_options(plan: Plan, options: CampaignOptions) -> Plan:
    given = {"time_limit_s": options.time_limit_s, "retries": options.retries}
    return plan.model_copy(update={name: value for name, value in given.items() if value is not None})


def _keep_plan(plan: Plan, folder: Path) -> None:
    """Leave what is to be done where its results will be, so that one that was killed says what it was."""
    file = folder / PLAN
    if os.path.lexists(file) and _PLAN_MARK not in file.read_bytes()[:_LOOKED_AT_BYTES]:
        remedy = "another folder, or move it away"
        raise InputError(f"results {file}", got="a file that no campaign wrote", remedy=remedy)
    content = {"sloshlab_campaign": 1, **plan.model_dump(mode="json", by_alias=True)}
    atomic_file.write_bytes(file, (json.dumps(content, indent=1) + "\n").encode())


def _write(carried: CarriedOut, folder: Path, plan: Plan, *, command: str, report: bool) -> None:
    settings = {"keys": {task.name: carried.outcomes[task.name].key for task in carried.tasks}}
    provenance = provenance_of(command, [], settings=settings)
    # thousands of keys would be all that a reader sees of the page; each task has its own record
    shown = {**provenance, "settings": plan.model_dump_json(exclude={"parts": {"__all__": {"folder"}}})}
    with result_folder(folder, shown) as complete:
        atomic_file.write_bytes(complete / "summary.csv", summary_csv(carried.tasks, carried.outcomes))
        atomic_file.write_bytes(complete / "timings.csv", timings_csv(carried.tasks, carried.outcomes))
        if report:
            write_page(page_of(carried, shown), complete, result_id=provenance[RESULT_ID])


def _summary(carried: CarriedOut, folder: Path, *, report: bool) -> dict[str, Any]:
    counts = Counter(outcome.status for outcome in carried.outcomes.values())
    n_flagged = sum(bool(outcome.flags) for outcome in carried.outcomes.values())
    lines = [
        f"{counts['done']} of {len(carried.tasks)} tasks done, {carried.n_before} of them there before",
        f"results: {folder / RESULTS}",
        f"table: {folder / 'summary.csv'}",
        *report_lines(folder, written=report),
    ]
    flags = failure_lines(carried.tasks, carried.outcomes)
    if n_flagged:
        flags.append(f"{n_flagged} results are flagged; summary.csv says why")
    return {
        "lines": lines,
        "flags": flags,
        "output": str(folder),
        "tasks": len(carried.tasks),
        "before": carried.n_before,
        "flagged": n_flagged,
        **{status: counts[status] for status in ("done", "failed", "timed_out", "died")},
    }


def failure_lines(tasks: Sequence[StoredTask], outcomes: Mapping[str, Outcome]) -> list[str]:
    """One line for every task without a result.

    Parameters
    ----------
    tasks : sequence of StoredTask
    outcomes : mapping
        By name.
    """
    return [
        f"{task.name} {outcome.status.replace('_', ' ')}: {outcome.line}"
        for task in tasks
        if (outcome := outcomes[task.name]).status != "done"
    ]
