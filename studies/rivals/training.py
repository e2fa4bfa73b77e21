"""Development cases with their truths: all that a rival may learn from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sealed_trial.sealing.commitment import commitment
from sealed_trial.sealing.key import read_key
from sealed_trial.sealing.trial_folder import READABLE, opened_truths, read_commitments
from sloshlab.errors import InputError
from studies.rivals.said import Named
from studies.rivals.seen import Seen

Truth = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Known:
    """A case of which the truth is known.

    Attributes
    ----------
    seen : Seen
    truth : dict
    """

    seen: Seen
    truth: Truth

    @property
    def kind(self) -> str:
        """Class of the case."""
        return str(self.truth["kind"])

    @property
    def effects(self) -> tuple[Named, ...]:
        """Block and name of what is hidden, sorted."""
        return tuple(sorted((effect["block"], effect["name"]) for effect in self.truth["effects"]))

    @property
    def strength(self) -> float:
        """Of the strongest effect in noise floors; zero where nothing is missing."""
        return max((float(effect["strength"]) for effect in self.truth["effects"]), default=0.0)


def opened(trial: Path, truths: Path | None = None, key: Path | None = None) -> dict[str, Truth]:
    """Truths of an opened trial by case, checked against its commitments.

    Parameters
    ----------
    trial : Path
    truths : Path, optional
        File with salts and truths, as the key of a sealed trial opens them; by default that of a development
        trial.
    key : Path, optional
        Of a sealed trial, in place of its truths.

    Raises
    ------
    InputError
        If the file cannot be read, or a truth is not the one that was committed to.
    """
    if key is not None:
        return opened_truths(trial, read_commitments(trial), read_key(key))
    file = truths or trial / READABLE
    try:
        kept = json.loads(file.read_bytes())
        pairs = {name: (bytes.fromhex(entry["salt"]), entry["truth"]) for name, entry in kept.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        got = str(error) or type(error).__name__
        raise InputError(f"truths {file}", got=got, allowed="salts and truths of an opened trial") from error
    for case in read_commitments(trial).cases:
        if case.case not in pairs or commitment(*pairs[case.case]) != case.commitment:
            raise InputError(f"truths {file}: {case.case}", got="not the truth committed to", allowed="its own")
    return {name: truth for name, (_, truth) in pairs.items()}


def require_apart(training: Sequence[Path], judged: Path) -> None:
    """Refuse to learn from anything but development trials of other seeds.

    Parameters
    ----------
    training : sequence of Path
    judged : Path

    Raises
    ------
    InputError
        If a trial is sealed, shares a case with the judged one, or there is none.
    """
    if not training:
        raise InputError("--training", got="no trial", allowed="at least one development trial")
    judged_cases, judged_runs = _cases_and_recordings(judged)
    for trial in training:
        cases, runs = _cases_and_recordings(trial)
        got = ""
        if read_commitments(trial).purpose != "development":
            got = "a sealed trial"
        elif judged_cases & cases:
            got = "cases that are judged"
        elif judged_runs & runs:
            got = "recordings that are judged"
        if got:
            remedy = "draw one with `sloshlab trial seal --development`"
            raise InputError(f"--training {trial}", got=got, allowed="trials of other seeds", remedy=remedy)


def _cases_and_recordings(trial: Path) -> tuple[set[str], set[str]]:
    """Commitments of all cases of a trial, and hashes of all their recordings."""
    cases = read_commitments(trial).cases
    runs = {sum_ for case in cases for name, sum_ in case.files.items() if name.endswith(".nc")}
    return {case.commitment for case in cases}, runs
