"""Answers to a challenge, scored by its owner's truths with the rules and the page of every blind trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipelines.diagnosis.challenge_truths import known_vocabulary, marked_truth
from pipelines.diagnosis.trial_report import FILES, write_report
from pipelines.report.outputs import provenance_of
from pipelines.report.result_folder import require_result_folder
from sealed_trial.challenge.challenge_commitments import (
    ChallengeCommitments,
    commitment_defects,
    matches,
    read_challenge_commitments,
)
from sealed_trial.challenge.challenge_folder import ANSWERS, PURPOSE, ChallengeCase, require_cases
from sealed_trial.challenge.frozen_answers import VERDICT, FrozenAnswers, require_frozen
from sealed_trial.challenge.truths_file import KeptTruth, read_truths
from sealed_trial.running import DIAGNOSES, OUTCOME, read_outcome
from sealed_trial.scoring.answer import read_answer
from sealed_trial.scoring.rivals import commonest, metadata_classifier, metadata_features
from sealed_trial.scoring.score import Score, scored
from sealed_trial.sealing.key import read_key
from sealed_trial.sealing.trial_folder import COMMITMENTS
from sloshlab.errors import InputError


@dataclass(frozen=True)
class _Opened:
    """Truths that count, by case, and in words those that do not."""

    truths: dict[str, dict[str, Any]]
    not_counted: dict[str, str]


def score_challenge(folder: Path, truths: Path, output: Path, *, key: Path | None = None) -> dict[str, Any]:
    """Check answers and truths, count, write page, figures and `scores.json`; return the summary of the command.

    A truth that is not the one committed to is said and not counted.

    Parameters
    ----------
    folder : Path
    truths : Path
        What `trial commit` kept for their owner, or written by hand where nothing was committed to.
    output : Path
    key : Path, optional
        Of locked truths.

    Raises
    ------
    InputError
        If answers were not frozen or have been changed since, or no truth can be counted.
    """
    require_result_folder(output, FILES)
    cases = require_cases(folder)
    commitments = read_challenge_commitments(folder)
    if defects := commitment_defects(cases, commitments):
        raise defects[0]
    answers = require_frozen(folder, cases)
    kept = read_truths(truths, None if key is None else read_key(key))
    opened = _opened(cases, kept, commitments, f"truths {truths}")
    score = _score_of(folder, cases, opened.truths)
    settings = {"challenge": folder.resolve().name, "digest": answers.digest, "not_counted": opened.not_counted}
    inputs = [path for path in (folder / COMMITMENTS, folder / ANSWERS, truths) if path.is_file()]
    provenance = provenance_of("", inputs, settings={**settings, "scored": [mark.case for mark in score.marks]})
    write_report(score, output, provenance, _about(folder, commitments, answers, opened.not_counted))
    lines = [f"{aim.name}: {aim.reached:.1%} of {aim.n}, {aim.standing}" for aim in score.acceptance if aim.n]
    lines.append(f"written: {output / 'blind_trial.md'}")
    flags = [f"case {case}: {why}; not counted" for case, why in opened.not_counted.items()]
    if commitments is None:
        flags.append("truths that nobody committed to before the answers were given")
    rates = {name: rate.value for name, rate in score.rates.items() if rate.n}
    return {"lines": lines, "flags": flags, "purpose": PURPOSE, "rates": rates, "digest": answers.digest}


def _opened(
    cases: Sequence[ChallengeCase],
    kept: Mapping[str, KeptTruth],
    commitments: ChallengeCommitments | None,
    what: str,
) -> _Opened:
    names = [case.name for case in cases]
    for case in kept:
        if case not in names:
            raise InputError(f"{what}: {case}", got="no such case", allowed="cases of the challenge")
    if commitments is not None and not any(each.salt for each in kept.values()):
        allowed = "the file that `sloshlab trial commit` wrote beside the commitments"
        raise InputError(what, got="truths without salts, which prove nothing", allowed=allowed)
    vocabulary = known_vocabulary()
    counted, not_counted = {}, {}
    for name in names:
        if name not in kept:
            not_counted[name] = "no truth was given"
        elif commitments is not None and not matches(name, kept[name], commitments):
            not_counted[name] = "the truth is not the one committed to"
        else:
            counted[name] = marked_truth(name, kept[name].truth, vocabulary)
    if not counted:
        case, why = next(iter(not_counted.items()))
        raise InputError(f"{what}: {case}", got=why, allowed="at least one truth that counts")
    return _Opened(counted, not_counted)


def _score_of(folder: Path, cases: Sequence[ChallengeCase], truths: dict[str, dict[str, Any]]) -> Score:
    places = {name: folder / DIAGNOSES / name for name in truths}
    outcomes = {name: read_outcome(place / OUTCOME) for name, place in places.items()}
    answers = {name: read_answer(place / VERDICT) for name, place in places.items()}
    kinds = [truth["kind"] for truth in truths.values()]
    features = [metadata_features(case.folder) for case in cases if case.name in truths]
    rivals = {
        "the commonest class, said of every case": commonest(kinds),
        "nearest neighbours in the metadata alone": metadata_classifier(features, kinds),
    }
    return scored(PURPOSE, truths, answers, outcomes, rivals)


def _about(
    folder: Path, commitments: ChallengeCommitments | None, answers: FrozenAnswers, not_counted: Mapping[str, str]
) -> str:
    """Which challenge, whose word for it there is, and which cases are not in the numbers."""
    proof = (
        "Every truth that is counted is the one committed to before the answers were given."
        if commitments is not None
        else "**Nobody committed to these truths**: nothing shows that they are older than the answers."
    )
    lines = [
        f"Cases of somebody else, folder `{ascii(folder.resolve().name)[1:-1]}`. {proof}",
        f"Answered by {answers.program}; digest of the frozen answers: `{answers.digest}`.",
        *(f"- Not counted: `{case}`, {why}." for case, why in not_counted.items()),
    ]
    return "\n\n".join(lines[:2]) + ("\n\n" + "\n".join(lines[2:]) if lines[2:] else "")
