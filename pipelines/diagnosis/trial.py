"""The commands of the blind trial: sealed, run and scored in three steps that share no process."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from pipelines.diagnosis.trial_report import FILES, write_report
from pipelines.report.outputs import provenance_of, sha256_of
from pipelines.report.progress import progress
from pipelines.report.result_folder import require_result_folder
from sealed_trial.running import DIAGNOSE, DIAGNOSES, OUTCOME, Outcome, require_no_key, run_trial
from sealed_trial.scoring.answer import read_answer
from sealed_trial.scoring.rivals import commonest, metadata_classifier, metadata_features
from sealed_trial.scoring.score import Score, scored
from sealed_trial.sealing.key import made_or_read_key, read_key
from sealed_trial.sealing.trial_folder import (
    COMMITMENTS,
    LOCKED,
    READABLE,
    check_data,
    opened_truths,
    read_commitments,
    seal,
)
from sloshlab.errors import InputError

MOST_WORKERS = 64


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


def run_cases(folder: Path, *, n_workers: int, time_limit_s: float, reports: bool) -> dict[str, Any]:
    """Diagnose every case that has not been; return the summary of the command.

    Raises
    ------
    InputError
        If a key is in reach, or data are not those that were published.
    """
    if not 1 <= n_workers <= MOST_WORKERS:
        raise InputError("--workers", got=str(n_workers), allowed=f"1 … {MOST_WORKERS}")
    if not time_limit_s > 0:
        raise InputError("--time-limit", got=f"{time_limit_s:g}", allowed="> 0")
    # A process that could open the truths must not diagnose.
    require_no_key(folder, sys.argv, os.environ)
    n_cases = len(read_commitments(folder).cases)
    command = (*DIAGNOSE,) if reports else (*DIAGNOSE, "--no-report")
    with progress("diagnosing cases", n_cases) as advance:

        def finished(outcome: Outcome) -> None:
            advance(f"{outcome.case} {outcome.status} in {outcome.wall_s:.0f} s")

        outcomes = run_trial(
            folder, n_workers=n_workers, time_limit_s=time_limit_s, command=command, finished=finished
        )
    bad = [outcome.case for outcome in outcomes if outcome.status != "done"]
    flags = (
        [f"{len(bad)} of {len(outcomes)} cases crashed or ran out of time: {', '.join(bad[:8])}"] if bad else []
    )
    return {"lines": [f"{len(outcomes)} cases diagnosed"], "flags": flags, "cases": len(outcomes), "failed": bad}


def score_trial(folder: Path, output: Path, *, key: Path | None) -> dict[str, Any]:
    """Open the truths, score, write page, figures and `scores.json`; return the summary of the command.

    Raises
    ------
    InputError
        If a truth, a commitment or a recording is not what was sealed, or cases have not been run.
    """
    require_result_folder(output, FILES)
    score = score_of(folder, key)
    cases = sorted((folder / DIAGNOSES).glob("*/*.json"))
    diagnosed = {path.relative_to(folder).as_posix(): sha256_of(path) for path in cases}
    truths = [path for path in (folder / name for name in (READABLE, LOCKED)) if path.is_file()]
    write_report(score, output, provenance_of("", [folder / COMMITMENTS, *truths], settings=diagnosed))
    lines = [f"{name}: {rate.successes} of {rate.n}" for name, rate in score.rates.items()]
    lines.append(f"written: {output / 'blind_trial.md'}")
    rates = {name: rate.value for name, rate in score.rates.items() if rate.n}
    return {"lines": lines, "purpose": score.purpose, "rates": rates}


def score_of(folder: Path, key: Path | None) -> Score:
    """All scores of a trial that was run."""
    commitments = read_commitments(folder)
    # Recordings first: a score is worth nothing if a file is not the one that was published.
    for case in commitments.cases:
        check_data(folder, case)
    truths = opened_truths(folder, commitments, None if key is None else read_key(key))
    outcomes, answers = {}, {}
    for name in truths:
        place = folder / DIAGNOSES / name
        if not (place / OUTCOME).is_file():
            raise InputError(name, got="not diagnosed", allowed="all cases", remedy=f"sloshlab trial run {folder}")
        outcomes[name] = Outcome(**json.loads((place / OUTCOME).read_bytes()))
        answers[name] = read_answer(place / "verdict.json")
    kinds = [truth["kind"] for truth in truths.values()]
    # Rig and plan are drawn without knowing the class, so that whoever guesses it from all but the signals
    # scores at chance.
    features = [metadata_features(folder / "cases" / name) for name in truths]
    rivals = {
        "the commonest class, said of every case": commonest(kinds),
        "nearest neighbours in the metadata alone": metadata_classifier(features, kinds),
    }
    return scored(commitments.purpose, truths, answers, outcomes, rivals)
