"""Commitments of a challenger: truths fixed before anybody answered, without a secret of ours.

The commitment of a case is SHA-256(salt ‖ truth) as in `sealing.commitment`; the truth is the document of a
`StatedTruth`, which holds what its owner wrote, not what a vocabulary of ours makes of it.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sealed_trial.challenge.challenge_folder import MOST_CASES, NAME_PATTERN, PURPOSE, ChallengeCase
from sealed_trial.challenge.stated_truth import StatedTruth
from sealed_trial.challenge.truths_file import KeptTruth
from sealed_trial.sealing.commitment import SALT_BYTES, commitment
from sealed_trial.sealing.trial_folder import COMMITMENTS
from sloshlab.errors import InputError

_RULE = "SHA-256 of 32 bytes of salt, then the truth as JSON with sorted keys, no spaces, ASCII"
_LARGEST_BYTES = 64 * 2**20


class CommittedCase(BaseModel):
    """What is published of a case before its truth."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    case: str = Field(pattern=f"^{NAME_PATTERN}$")
    commitment: str = Field(pattern=r"^[0-9a-f]{64}$")
    files: dict[str, str]


class ChallengeCommitments(BaseModel):
    """The published part of a challenge."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal[1] = 1
    purpose: Literal["challenge"] = PURPOSE  # type: ignore[assignment]
    rule: str = Field(default=_RULE, max_length=500)
    cases: tuple[CommittedCase, ...] = Field(min_length=1, max_length=MOST_CASES)


def committed(
    cases: Sequence[ChallengeCase], truths: Mapping[str, StatedTruth]
) -> tuple[ChallengeCommitments, dict[str, KeptTruth]]:
    """Commitments to truths, and truths with the salts that prove them.

    Parameters
    ----------
    cases : sequence of ChallengeCase
    truths : mapping
        By case.

    Raises
    ------
    InputError
        If a case has no truth, or a truth no case.
    """
    require_same_cases([case.name for case in cases], list(truths))
    kept = {case.name: KeptTruth(truths[case.name], secrets.token_bytes(SALT_BYTES)) for case in cases}
    published = tuple(
        CommittedCase(case=case.name, commitment=commitment_of(case.name, kept[case.name]), files=case.hashes())
        for case in cases
    )
    return ChallengeCommitments(cases=published), kept


def commitment_of(case: str, kept: KeptTruth) -> str:
    """SHA-256(salt ‖ truth) of a case as hexadecimal digits."""
    return commitment(kept.salt, kept.truth.document(case))


def require_same_cases(cases: Sequence[str], truths: Sequence[str]) -> None:
    """Refuse truths of other cases than there are.

    Raises
    ------
    InputError
    """
    for case in truths:
        if case not in cases:
            raise InputError(f"truth of {case}", got="no such case", allowed="names of the folders in cases/")
    for case in cases:
        if case not in truths:
            raise InputError(f"case {case}", got="no truth", allowed="one for every case")


def read_challenge_commitments(folder: Path) -> ChallengeCommitments | None:
    """The commitments of a challenge; None where it has none.

    Raises
    ------
    InputError
        If the file is something else.
    """
    path = folder / COMMITMENTS
    if not path.exists():
        return None
    allowed = "the file that `sloshlab trial commit` wrote"
    if path.stat().st_size > _LARGEST_BYTES:
        raise InputError(f"{path}", got=f"{path.stat().st_size} bytes", allowed=f"≤ {_LARGEST_BYTES}")
    try:
        found = ChallengeCommitments.model_validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{path}: {place}"[:200], got=first["msg"], allowed=allowed) from error
    names = [case.case for case in found.cases]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: cases", got="a case twice", allowed=allowed)
    return found


def commitment_defects(
    cases: Sequence[ChallengeCase], commitments: ChallengeCommitments | None
) -> tuple[InputError, ...]:
    """Cases and files that are not those which were committed to."""
    if commitments is None:
        return ()
    published = {case.case: case for case in commitments.cases}
    present = {case.name: case for case in cases}
    defects = [
        InputError(f"case {name}", got=got, allowed=f"the cases of {COMMITMENTS}")
        for name in sorted(published.keys() ^ present.keys())
        for got in ["no such case" if name in published else "no commitment"]
    ]
    for name in sorted(published.keys() & present.keys()):
        found, told = present[name].hashes(), published[name].files
        for path in sorted(found.keys() | told.keys()):
            if found.get(path) != told.get(path):
                got = "a file that was changed, added or taken away"
                what = f"case {name}: {ascii(path)[1:-1][:80]}"
                defects.append(InputError(what, got=got, allowed=f"the files of {COMMITMENTS}"))
    return tuple(defects)


def matches(case: str, kept: KeptTruth, commitments: ChallengeCommitments) -> bool:
    """Whether a truth is the one that was committed to."""
    published = {each.case: each.commitment for each in commitments.cases}
    return case in published and hmac.compare_digest(commitment_of(case, kept), published[case])
