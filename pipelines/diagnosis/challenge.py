"""Cases of somebody else: truths committed to, the folder checked, every case answered and the answers frozen."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from campaigns.where import Where, executor_of
from pipelines.diagnosis.challenge_truths import is_outside, known_vocabulary, marked_truth
from pipelines.diagnosis.trial import require_effort, require_folder_of_answers, summary_of
from pipelines.report.free_place import require_free_place
from pipelines.report.progress import progress
from pipelines.report.terminal import warn
from sealed_trial.challenge.challenge_commitments import (
    commitment_defects,
    committed,
    read_challenge_commitments,
    require_same_cases,
)
from sealed_trial.challenge.challenge_folder import (
    LARGEST_CASE_BYTES,
    ChallengeCase,
    found_cases,
    require_cases,
    truths_in_reach,
)
from sealed_trial.challenge.frozen_answers import freeze
from sealed_trial.challenge.stated_truth import StatedTruth
from sealed_trial.challenge.truths_file import kept_document, read_truths
from sealed_trial.running import DIAGNOSE, DIAGNOSES, OUTCOME, Outcome, require_no_key, run_folders
from sealed_trial.scoring.looks import revision
from sealed_trial.sealing.key import made_or_read_key
from sealed_trial.sealing.locked_truths import locked
from sealed_trial.sealing.selection import EVERYTHING, Selection
from sealed_trial.sealing.trial_folder import COMMITMENTS
from sloshlab import __version__, atomic_file
from sloshlab.errors import InputError, SloshlabError
from sloshlab.flight_twin.described_wing import read_flight_wing
from sloshlab.recording import read_recording
from sloshlab.rig import Rig
from sloshlab.toml_file import read_toml


def commit_truths(folder: Path, truths: Path, output: Path, *, key: Path | None) -> dict[str, Any]:
    """Publish commitments to truths in a challenge, keep the truths with their salts; return the summary.

    Parameters
    ----------
    folder : Path
        The challenge; gets `commitments.json`.
    truths : Path
        What their owner wrote.
    output : Path
        What their owner keeps: truths and salts, for `trial score`.
    key : Path, optional
        Locks `output`; made where it is missing.

    Raises
    ------
    InputError
        If truths and cases do not fit, a truth is impossible, or a file lies within the challenge.
    """
    for what, path in (("truths", truths), ("-o", output)):
        if folder.resolve() in path.resolve().parents:
            raise InputError(f"{what} {path}", got="a place within the challenge", allowed="a file outside")
    require_free_place(output, overwrite=False, described="truths")
    require_free_place(folder / COMMITMENTS, overwrite=False, described="commitments")
    cases = require_cases(folder)
    stated = {case: kept.truth for case, kept in read_truths(truths).items()}
    require_same_cases([case.name for case in cases], list(stated))
    _require_blocks(cases, stated)
    vocabulary = known_vocabulary()
    kinds = {case: marked_truth(case, truth, vocabulary)["kind"] for case, truth in stated.items()}
    commitments, kept = committed(cases, stated)
    secret = None if key is None else made_or_read_key(key, folder)
    document = kept_document(kept)
    public = commitments.model_dump_json(indent=1).encode() + b"\n"
    private = json.dumps(document, indent=1, sort_keys=True).encode() + b"\n"
    with atomic_file.together() as stagings:
        place = stagings.file(output)
        place.touch(mode=0o600)
        place.write_bytes(private if secret is None else locked(document, secret))
        stagings.file(folder / COMMITMENTS).write_bytes(public)
    unnamed = [
        case for case, truth in stated.items() if truth.hidden != "outside" and is_outside(truth, vocabulary)
    ]
    lines = [f"{len(cases)} cases committed to in {folder / COMMITMENTS}"]
    lines += [f"{case}: a name that the vocabulary lacks; the right answer is `unknown`" for case in unnamed]
    lines += [
        f"publish the SHA-256 of it: {hashlib.sha256(public).hexdigest()}",
        f"keep {output}" + (f" and the key {key}" if key else "") + " away from whoever diagnoses",
    ]
    return {"lines": lines, "cases": len(cases), "classes": kinds}


def _require_blocks(cases: Sequence[ChallengeCase], stated: Mapping[str, StatedTruth]) -> None:
    """Refuse truths in a block that no answer can name."""
    for case in cases:
        if case.twin is not None and any(effect.block == "tank" for effect in stated[case.name].effects):
            allowed = "excitation, structure or sensor: a twin of your own has no tank"
            raise InputError(f"truth of {case.name}: block", got="tank", allowed=allowed)
        for effect in stated[case.name].effects:
            if case.model is None and effect.block in ("aerodynamics", "control"):
                allowed = "these blocks in cases with model.toml"
                raise InputError(f"truth of {case.name}: block", got=effect.block, allowed=allowed)


def check_challenge(folder: Path) -> dict[str, Any]:
    """Say everything that is wrong with a challenge; return the summary of the command, with its defects.

    Modules of twins are not run.

    Raises
    ------
    InputError
        If it is no challenge at all.
    """
    cases, defects = _examined(folder)
    own = [case.name for case in cases if case.twin is not None]
    lines = [f"{len(cases)} cases, {sum(len(case.recordings) for case in cases)} recordings"]
    if own:
        lines.append(f"{len(own)} with a twin of their own, whose code `trial run --trust-code` runs: {own[0]} …")
    lines.append("truths committed to" if (folder / COMMITMENTS).is_file() else "truths not committed to")
    if there := sum((folder / DIAGNOSES / case.name / OUTCOME).is_file() for case in cases):
        lines.append(f"{there} answers are there already; remove {folder / DIAGNOSES} unless they are your own")
    if not defects:
        lines.append("nothing is wrong")
    return {"lines": lines, "defects": [str(defect) for defect in defects], "cases": len(cases), "own_twins": own}


def _examined(folder: Path) -> tuple[tuple[ChallengeCase, ...], list[InputError]]:
    """Cases, and every defect: of the folder, its commitments, what lies beside it, rigs and recordings."""
    cases, found = found_cases(folder)
    defects = [*found, *truths_in_reach(folder, [Path.cwd()])]
    try:
        defects += commitment_defects(cases, read_challenge_commitments(folder))
    except InputError as error:
        defects.append(error)
    if found:  # files of which even the size is wrong are not opened
        return cases, defects
    with progress("checking cases", len(cases)) as advance:
        for case in cases:
            defects += _unreadable(case)
            advance(case.name)
    return cases, defects


def _unreadable(case: ChallengeCase) -> list[InputError]:
    """What a diagnosis could not read, and what it would read from elsewhere."""
    defects = []
    checks = [partial(_bytes_of, file) for file in case.recordings]
    if case.model is not None:
        checks.append(partial(_checked_model, case.model))
    elif case.twin is None:
        checks.append(partial(_checked_rig, case.folder / "rig.toml"))
    n_bytes = 0
    for check in checks:
        try:
            n_bytes += check()
        except SloshlabError as error:
            defects.append(InputError(f"case {case.name}: {error}"))
    if n_bytes > LARGEST_CASE_BYTES:
        defects.append(InputError(f"case {case.name}", got=f"{n_bytes} bytes of samples", allowed="≤ 2 GiB"))
    return defects


def _bytes_of(recording: Path) -> int:
    return int(read_recording(recording).nbytes)


def _checked_rig(file: Path) -> int:
    """Read the rig; refuse files of it that lie outside the case."""
    Rig.from_toml(file)
    for text in _texts(read_toml(file, f"rig {file}")):
        if Path(text).is_absolute() or ".." in Path(text).parts:
            raise InputError(f"rig {file}", got=f"the path {ascii(text)[:80]}", allowed="files of its own case")
    return 0


def _checked_model(file: Path) -> int:
    read_flight_wing(file)
    return 0


def _texts(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for part in value.values() for text in _texts(part)]
    if isinstance(value, list):
        return [text for part in value for text in _texts(part)]
    return [value] if isinstance(value, str) else []


def run_challenge(
    folder: Path,
    chosen: Selection,
    *,
    n_workers: int,
    time_limit_s: float,
    trust_code: bool,
    options: Sequence[str] = (),
    diagnoses: str = DIAGNOSES,
    perturbation: int | None = None,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Diagnose every chosen case of a challenge, freeze the answers when all are there; return the summary.

    Parameters
    ----------
    folder : Path
    chosen : Selection
        Cases by name; halves are of trials of our own.
    n_workers, time_limit_s, options, diagnoses, perturbation, scheduler
        As of `pipelines.diagnosis.trial.run_cases`.
    trust_code : bool
        Whether twins of the cases are run: they are programs, with all rights of whoever calls this.

    Raises
    ------
    InputError
        If the challenge has a defect, truths or a key are in reach, or a twin would be run without consent.
    """
    require_effort(n_workers, time_limit_s)
    require_folder_of_answers(diagnoses)
    if chosen.half is not None:
        raise InputError("--half", got=f"{chosen.half} cases of a challenge", allowed="--cases A,B,…, or all")
    require_no_key(folder, sys.argv, os.environ)
    cases, defects = _examined(folder)
    if defects:
        more = f"; {len(defects) - 1} more" if len(defects) > 1 else ""
        raise InputError(f"{defects[0]}{more}; `sloshlab trial check {folder}` lists all")
    names = chosen.of([case.name for case in cases])
    selected = [case for case in cases if case.name in names]
    own = [case.name for case in selected if case.twin is not None]
    if own and not trust_code:
        got = f"{len(own)} twins that are Python modules, such as {own[0]}/twin.py"
        remedy = "read them, then --trust-code; or --cases without them"
        raise InputError(f"challenge {folder}", got=got, allowed="code that you trust", remedy=remedy)
    place = diagnoses if perturbation is None else f"{diagnoses}_perturbed_{perturbation}"
    n_before = sum((folder / place / case.name / OUTCOME).is_file() for case in selected)
    with progress("diagnosing cases", len(selected)) as advance:

        def finished(outcome: Outcome) -> None:
            advance(f"{outcome.case} {outcome.status} in {outcome.wall_s:.0f} s")

        outcomes = run_folders(
            [case.folder for case in selected],
            folder / place,
            n_workers=n_workers,
            time_limit_s=time_limit_s,
            command=(*DIAGNOSE, *options),
            options_of=_twin_of,
            perturbation=perturbation,
            finished=finished,
            executor=executor_of(Where(scheduler, n_workers, one_core=False), said=warn),
        )
    summary = summary_of(outcomes, folder / place)
    if n_before:
        summary["lines"].append(f"{n_before} of them were there before")
    if place == DIAGNOSES and chosen == EVERYTHING:
        answers = freeze(folder, cases, f"sloshlab {__version__}, revision {revision()}")
        summary["lines"] += [
            f"answers frozen in {folder / 'answers.json'}",
            f"publish its digest: {answers.digest}",
        ]
        summary["digest"] = answers.digest
    return summary


def _twin_of(case: Path) -> Sequence[str]:
    """Words that name the twin of a case, where it has one of its own."""
    return ("--twin", str(case / "twin.py")) if (case / "twin.py").is_file() else ()
