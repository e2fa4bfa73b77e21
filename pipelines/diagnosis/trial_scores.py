"""Two commands of the blind trial: answers scored, and compared with those to nearly the same recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipelines.diagnosis.trial import require_folder_of_answers
from pipelines.diagnosis.trial_report import FILES, write_report
from pipelines.report.outputs import provenance_of, sha256_of
from pipelines.report.result_folder import require_result_folder
from sealed_trial.running import DIAGNOSES, OUTCOME, Outcome, read_outcome
from sealed_trial.scoring.answer import Answer, read_answer
from sealed_trial.scoring.comparison import compared
from sealed_trial.scoring.looks import note_look
from sealed_trial.scoring.rivals import commonest, metadata_classifier, metadata_features
from sealed_trial.scoring.score import Score, scored
from sealed_trial.scoring.statistics import Rate
from sealed_trial.sealing.key import read_key
from sealed_trial.sealing.selection import EVERYTHING, Selection, half_of
from sealed_trial.sealing.trial_folder import (
    COMMITMENTS,
    LOCKED,
    READABLE,
    check_data,
    opened_truths,
    read_commitments,
)
from sloshlab.errors import InputError


@dataclass(frozen=True, eq=False)
class _Opened:
    """Cases of one trial with truths and answers, by the names they have among those of several trials."""

    purpose: str
    truths: dict[str, dict[str, Any]]
    answers: dict[str, Answer]
    outcomes: dict[str, Outcome]
    features: list[dict[str, float]]


def score_trials(
    folders: Sequence[Path],
    output: Path,
    *,
    key: Path | None,
    chosen: Selection = EVERYTHING,
    diagnoses: str = DIAGNOSES,
) -> dict[str, Any]:
    """Open the truths, score, write page, figures and `scores.json`; return the summary of the command.

    Whoever scores even cases of development trials looks at what judges, which `looks.csv` beside `output` notes.

    Raises
    ------
    InputError
        If a truth, a commitment or a recording is not what was sealed, or cases have not been run.
    """
    require_result_folder(output, FILES)
    require_folder_of_answers(diagnoses)
    score = score_of(folders, key, chosen, diagnoses)
    settings = {
        "trials": " ".join(folder.resolve().name for folder in folders),
        "diagnoses": diagnoses,
        "half": chosen.half or "both",
        "cases": str(len(score.marks)),
    }
    lines = [f"{aim.name}: {aim.reached:.1%} of {aim.n}, {aim.standing}" for aim in score.acceptance if aim.n]
    if score.purpose == "development" and any(half_of(mark.case) == "even" for mark in score.marks):
        # before anything is shown: what cannot be noted is not looked at
        lines.append(f"noted: {note_look(output, settings, score.acceptance)}")
    about = "{trials}, folder {diagnoses}, half: {half}.".format(**settings)
    write_report(score, output, _provenance(folders, score, settings), about)
    lines.append(f"written: {output / 'blind_trial.md'}")
    rates = {name: rate.value for name, rate in score.rates.items() if rate.n}
    aims = {aim.name: aim.standing for aim in score.acceptance}
    return {"lines": lines, "purpose": score.purpose, "rates": rates, "aims": aims}


def _provenance(folders: Sequence[Path], score: Score, settings: Mapping[str, str]) -> dict[str, Any]:
    """What the scores rest on: commitments and truths, and all that was answered."""
    names = (COMMITMENTS, READABLE, LOCKED)
    inputs = [path for folder in folders for path in (folder / name for name in names) if path.is_file()]
    places = [folder / settings["diagnoses"] for folder in folders]
    answered = {
        f"{place.parent.resolve().name}/{path.relative_to(place).as_posix()}": sha256_of(path)
        for place in places
        for path in sorted(place.glob("*/*.json"))
    }
    return provenance_of(
        "", inputs, settings={**settings, "scored": [mark.case for mark in score.marks], **answered}
    )


def score_of(folders: Sequence[Path], key: Path | None, chosen: Selection, diagnoses: str) -> Score:
    """All scores of the chosen cases of trials that were run."""
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise InputError("TRIAL", got="two folders of one name", allowed="every trial once, by its own name")
    opened = [_opened(folder, key, chosen, diagnoses) for folder in folders]
    prefixes = [f"{name}/" if len(folders) > 1 else "" for name in names]
    truths, answers, outcomes = {}, {}, {}
    for prefix, trial in zip(prefixes, opened, strict=True):
        for name, truth in trial.truths.items():
            case = prefix + name
            truths[case] = {**truth, "case": case}
            answers[case], outcomes[case] = trial.answers[name], trial.outcomes[name]
    kinds = [truth["kind"] for truth in truths.values()]
    # Rig and plan are drawn without knowing the class, so that whoever guesses it from all but the signals
    # scores at chance.
    rivals: dict[str, Rate] = {
        "the commonest class, said of every case": commonest(kinds),
        "nearest neighbours in the metadata alone": metadata_classifier(
            [features for trial in opened for features in trial.features], kinds
        ),
    }
    purpose = "sealed" if all(trial.purpose == "sealed" for trial in opened) else "development"
    return scored(purpose, truths, answers, outcomes, rivals)


def _opened(folder: Path, key: Path | None, chosen: Selection, diagnoses: str) -> _Opened:
    commitments = read_commitments(folder)
    if commitments.purpose == "sealed" and chosen != EVERYTHING:
        raise InputError("--half and --cases", got=f"the sealed trial {folder}", allowed="development trials")
    names = chosen.of([case.case for case in commitments.cases])
    # Recordings first: a score is worth nothing if a file is not the one that was published.
    for case in commitments.cases:
        if case.case in names:
            check_data(folder, case)
    truths = opened_truths(folder, commitments, None if key is None else read_key(key))
    outcomes, answers = {}, {}
    for name in names:
        place = folder / diagnoses / name
        outcomes[name] = _outcome(place, f"sloshlab trial run {folder}")
        answers[name] = read_answer(place / "verdict.json")
    features = [metadata_features(folder / "cases" / name) for name in names]
    return _Opened(commitments.purpose, {name: truths[name] for name in names}, answers, outcomes, features)


def _outcome(place: Path, remedy: str) -> Outcome:
    path = place / OUTCOME
    if not path.is_file():
        raise InputError(f"{place}", got="not diagnosed", allowed="all cases", remedy=remedy)
    return read_outcome(path)


def compare_diagnoses(folders: Sequence[Path]) -> dict[str, Any]:
    """Compare answers in pairs of folders, all pairs together; return the summary of the command.

    Cases that only one folder of a pair has are left out.

    Raises
    ------
    InputError
        If there are no pairs, or the folders of one share no case.
    """
    if len(folders) % 2 or not folders:
        raise InputError("trial compare", got=f"{len(folders)} folders", allowed="pairs: A B, or A B C D …")
    first: dict[str, Answer] = {}
    second: dict[str, Answer] = {}
    for a, b in zip(folders[::2], folders[1::2], strict=True):
        shared = sorted(_diagnosed_cases(a) & _diagnosed_cases(b))
        if not shared:
            raise InputError(
                f"{a} and {b}", got="no case in both", allowed="folders written by `sloshlab trial run`"
            )
        first.update({f"{a}/{name}": read_answer(a / name / "verdict.json") for name in shared})
        second.update({f"{a}/{name}": read_answer(b / name / "verdict.json") for name in shared})
    comparison = compared(first, second)
    verdicts, answers = comparison.same_verdict, comparison.same_answer
    lines = [
        f"same verdict: {_share(verdicts)}",
        f"same verdict and names: {_share(answers)}",
        *(f"{each.case}: {each.first} – {each.second}" for each in comparison.different),
    ]
    return {"lines": lines, **asdict(comparison)}


def _share(rate: Rate) -> str:
    return f"{rate.successes} of {rate.n} ({rate.value:.1%}; {rate.low:.1%} … {rate.high:.1%})"


def _diagnosed_cases(folder: Path) -> set[str]:
    return {path.parent.name for path in folder.glob(f"*/{OUTCOME}")}
