"""Two commands of the blind trial: sealed and run, in steps that share no process."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from campaigns.where import Where, executor_of
from pipelines.report.progress import progress
from pipelines.report.terminal import warn
from sealed_trial.running import DIAGNOSE, DIAGNOSES, Outcome, require_no_key, run_trial
from sealed_trial.sealing.key import made_or_read_key
from sealed_trial.sealing.selection import Selection
from sealed_trial.sealing.trial_folder import read_commitments, seal
from sloshlab.errors import InputError

MOST_WORKERS: Final = 64
_FOLDER_OF_ANSWERS: Final = re.compile(rf"{DIAGNOSES}(_\w{{1,64}})?", re.ASCII)


def seal_trial(folder: Path, *, seed: int, n_cases: int, key: Path | None, development: bool) -> dict[str, Any]:
    """Draw and seal a trial; return the summary of the command.

    Raises
    ------
    InputError
        If a sealed trial has no key file, or a development trial has one.
    """
    if development == (key is not None):
        raise InputError(
            "--key",
            got="a key for a development trial" if development else "nothing",
            allowed="--key FILE outside the trial for a sealed trial, --development without a key",
        )
    secret = None if key is None else made_or_read_key(key, folder)
    with progress("drawing cases", n_cases) as advance:
        commitments = seal(folder, seed=seed, n_cases=n_cases, key=secret, said=advance)
    lines = [f"{len(commitments.cases)} cases in {folder / 'cases'}, commitments in {folder / 'commitments.json'}"]
    if key is not None:
        lines.append(f"key: {key}; keep it away from whoever diagnoses")
    return {"lines": lines, "cases": len(commitments.cases), "purpose": commitments.purpose}


def run_cases(
    folder: Path,
    chosen: Selection,
    *,
    n_workers: int,
    time_limit_s: float,
    options: Sequence[str] = (),
    diagnoses: str = DIAGNOSES,
    perturbation: int | None = None,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Diagnose every chosen case that has not been; return the summary of the command.

    Parameters
    ----------
    folder : Path
        The trial.
    chosen : Selection
    n_workers : int
        Cases at once.
    time_limit_s : float
        A case may take.
    options : sequence of str
        For `sloshlab diagnose`.
    diagnoses : str
        Folder of the trial that takes the answers; `_perturbed_SEED` is added to it where recordings are moved.
    perturbation : int, optional
        Seed of the moves.
    scheduler : str, optional
        Of a cluster that diagnoses instead of processes of this machine.

    Raises
    ------
    InputError
        If a key is in reach, or data are not those that were published.
    """
    require_effort(n_workers, time_limit_s)
    require_folder_of_answers(diagnoses)
    # A process that could open the truths must not diagnose.
    require_no_key(folder, sys.argv, os.environ)
    place = diagnoses if perturbation is None else f"{diagnoses}_perturbed_{perturbation}"
    n_cases = len(chosen.of([case.case for case in read_commitments(folder).cases]))
    with progress("diagnosing cases", n_cases) as advance:

        def finished(outcome: Outcome) -> None:
            advance(f"{outcome.case} {outcome.status} in {outcome.wall_s:.0f} s")

        outcomes = run_trial(
            folder,
            n_workers=n_workers,
            time_limit_s=time_limit_s,
            command=(*DIAGNOSE, *options),
            chosen=chosen,
            diagnoses=place,
            perturbation=perturbation,
            finished=finished,
            executor=executor_of(Where(scheduler, n_workers, one_core=False), said=warn),
        )
    return summary_of(outcomes, folder / place)


def summary_of(outcomes: Sequence[Outcome], place: Path) -> dict[str, Any]:
    """How the diagnoses of cases ended, for the summary of a command."""
    bad = [outcome.case for outcome in outcomes if outcome.status != "done"]
    flags = (
        [f"{len(bad)} of {len(outcomes)} cases crashed or ran out of time: {', '.join(bad[:8])}"] if bad else []
    )
    lines = [f"{len(outcomes)} cases diagnosed, answers in {place}"]
    return {"lines": lines, "flags": flags, "cases": len(outcomes), "failed": bad}


def require_effort(n_workers: int, time_limit_s: float) -> None:
    """Refuse numbers of workers and seconds that mean nothing.

    Raises
    ------
    InputError
    """
    if not 1 <= n_workers <= MOST_WORKERS:
        raise InputError("--workers", got=str(n_workers), allowed=f"1 … {MOST_WORKERS}")
    if not time_limit_s > 0:
        raise InputError("--time-limit", got=f"{time_limit_s:g}", allowed="> 0")


def require_folder_of_answers(name: str) -> None:
    """Refuse a name that could be that of anything else in a trial, or lead out of it.

    Raises
    ------
    InputError
    """
    if not _FOLDER_OF_ANSWERS.fullmatch(name):
        raise InputError("--diagnoses", got=name, allowed=f"{DIAGNOSES} or {DIAGNOSES}_NAME")
