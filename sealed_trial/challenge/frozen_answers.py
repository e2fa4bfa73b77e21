"""Answers that nobody can change any more: hashes of all verdicts, published before the truths come."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sealed_trial.challenge.challenge_folder import ANSWERS, ChallengeCase
from sealed_trial.running import DIAGNOSES, OUTCOME
from sealed_trial.sealing.commitment import file_hash
from sealed_trial.sealing.trial_folder import COMMITMENTS
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError

VERDICT = "verdict.json"
_LARGEST_BYTES = 64 * 2**20


class FrozenCase(BaseModel):
    """Hashes of a case and of what was answered; `verdict` is None where there is no answer."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    files: dict[str, str]
    outcome: str
    verdict: str | None


class FrozenAnswers(BaseModel):
    """All answers of a challenge.

    Attributes
    ----------
    program : str
        Version and revision of what answered.
    commitments : str or None
        SHA-256 of the commitments that were there.
    cases : dict
        By name.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal[1] = 1
    program: str = Field(max_length=200)
    commitments: str | None
    cases: dict[str, FrozenCase]

    @property
    def digest(self) -> str:
        """SHA-256 of everything, as hexadecimal digits: publish it, and nothing can be changed unnoticed."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def answers_of(folder: Path, cases: Sequence[ChallengeCase], program: str) -> FrozenAnswers:
    """The answers as they lie in a challenge.

    Raises
    ------
    InputError
        If a case has not been diagnosed.
    """
    frozen = {}
    for case in cases:
        place = folder / DIAGNOSES / case.name
        if not (place / OUTCOME).is_file():
            raise InputError(
                f"{place}", got="not diagnosed", allowed="all cases", remedy=f"sloshlab trial run {folder}"
            )
        verdict = place / VERDICT
        frozen[case.name] = FrozenCase(
            files=case.hashes(),
            outcome=file_hash(place / OUTCOME),
            verdict=file_hash(verdict) if verdict.is_file() else None,
        )
    published = folder / COMMITMENTS
    return FrozenAnswers(
        program=program, commitments=file_hash(published) if published.is_file() else None, cases=frozen
    )


def freeze(folder: Path, cases: Sequence[ChallengeCase], program: str) -> FrozenAnswers:
    """Write `answers.json`, once; the same answers are frozen again.

    Raises
    ------
    InputError
        If a case has not been diagnosed, or other answers have been frozen.
    """
    if (folder / ANSWERS).exists():
        return require_frozen(folder, cases)
    answers = answers_of(folder, cases, program)
    document = {**answers.model_dump(mode="json"), "digest": answers.digest}
    write_bytes(folder / ANSWERS, json.dumps(document, indent=1, sort_keys=True).encode() + b"\n")
    return answers


def require_frozen(folder: Path, cases: Sequence[ChallengeCase]) -> FrozenAnswers:
    """The frozen answers, which are those that lie in the challenge.

    Raises
    ------
    InputError
        If nothing was frozen, or an answer, a recording or a commitment is not what it was then.
    """
    frozen = read_frozen(folder)
    now = answers_of(folder, cases, frozen.program)
    if now.commitments != frozen.commitments:
        raise InputError(f"{folder / COMMITMENTS}", got="another file than when the answers were given")
    for name in sorted(frozen.cases.keys() | now.cases.keys()):
        if frozen.cases.get(name) != now.cases.get(name):
            got = "a case or an answer that was changed after the freeze"
            raise InputError(f"case {name}", got=got, allowed=f"what {ANSWERS} says")
    return frozen


def read_frozen(folder: Path) -> FrozenAnswers:
    """`answers.json`, whose digest is that of its contents.

    Raises
    ------
    InputError
    """
    path = folder / ANSWERS
    remedy = f"sloshlab trial run {folder}"
    if not path.is_file():
        raise InputError(f"{path}", got="no frozen answers", allowed="answers to all cases", remedy=remedy)
    if path.stat().st_size > _LARGEST_BYTES:
        raise InputError(f"{path}", got=f"{path.stat().st_size} bytes", allowed=f"≤ {_LARGEST_BYTES}")
    try:
        document = json.loads(path.read_bytes())
        digest = document.pop("digest")
        frozen = FrozenAnswers.model_validate(document)
    except (ValidationError, ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
        raise InputError(f"{path}", got="something else", allowed="the file that `trial run` wrote") from error
    if frozen.digest != digest:
        raise InputError(f"{path}: digest", got="that of other answers", allowed="an untouched file")
    return frozen
