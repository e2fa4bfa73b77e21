"""A trial on disk: cases, commitments published before anything else, truths locked or, for development, readable.

TRIAL/commitments.json    format, purpose, for every case its commitment and the hashes of its files
TRIAL/cases/case_001/     rig.toml and recordings
TRIAL/truths.locked       salts and truths under the key; truths.json in a development trial
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sealed_trial.case_drawing import CaseDrawing, HiddenTruth, class_order
from sealed_trial.case_recording import write_case
from sealed_trial.sealing.commitment import case_hashes, commitment, salt_of
from sealed_trial.sealing.locked_truths import locked, opened
from sloshlab.atomic_file import filled_folder, write_bytes
from sloshlab.errors import AnalysisError, InputError

DOMAINS: Final = {"sealed": b"sloshlab blind trial, sealed", "development": b"sloshlab blind trial, development"}
COMMITMENTS: Final = "commitments.json"
LOCKED: Final = "truths.locked"
READABLE: Final = "truths.json"
_MOST_CASES: Final = 1000


class PublishedCase(BaseModel):
    """What is known of a case before it is opened."""

    model_config = ConfigDict(frozen=True)

    case: str = Field(pattern=r"^case_\d{3,4}$")
    commitment: str = Field(pattern=r"^[0-9a-f]{64}$")
    files: dict[str, str]


class Commitments(BaseModel):
    """The published part of a trial."""

    model_config = ConfigDict(frozen=True)

    format: Literal[1]
    purpose: Literal["sealed", "development"]
    domain: str
    seed: int
    cases: tuple[PublishedCase, ...]


def entropy(purpose: str, seed: int, secret: bytes) -> list[int]:
    """Words that all random numbers of a trial come from.

    SHA-256 of the domain of its purpose, the seed and the secret: a development trial can share none with a sealed
    one, and nobody without the key can draw a sealed one again.
    """
    digest = hashlib.sha256(DOMAINS[purpose] + b"\0" + str(seed).encode() + b"\0" + secret).digest()
    return [int.from_bytes(digest[k : k + 4], "big") for k in range(0, 32, 4)]


def seal(
    folder: Path, *, seed: int, n_cases: int, key: bytes | None, said: Callable[[str], None] = lambda step: None
) -> Commitments:
    """Draw a trial and write it, whole or not at all.

    Parameters
    ----------
    folder : Path
        Made; must be empty or absent.
    seed : int
    n_cases : int
    key : bytes or None
        Locks the truths; None makes a development trial, whose truths can be read.
    said : callable
        Told the name of every case that is done.

    Raises
    ------
    InputError
        If the folder is in use or the number of cases is impossible.
    AnalysisError
        If a case cannot be drawn from this seed.
    """
    if not 6 <= n_cases <= _MOST_CASES:
        raise InputError("--cases", got=str(n_cases), allowed=f"6 … {_MOST_CASES}")
    if folder.exists() and any(folder.iterdir()):
        raise InputError(f"{folder}", got="a folder with files in it", allowed="a new or empty one")
    purpose: Literal["sealed", "development"] = "development" if key is None else "sealed"
    words = entropy(purpose, seed, key or b"")
    secret = hashlib.sha256(b"salts" + bytes(str(words), "ascii")).digest()
    drawing = CaseDrawing(words)
    truths: dict[str, HiddenTruth] = {}
    with filled_folder(folder) as complete:
        for number, kind in enumerate(class_order(n_cases, np.random.default_rng([*words, 0]))):
            name = f"case_{number + 1:03d}"
            try:
                case = drawing.case(number, name, kind)
            except ArithmeticError as error:
                raise AnalysisError(name, got=str(error), remedy="another --seed") from error
            write_case(complete / "cases" / name, case, np.random.default_rng([*words, number, 4]))
            truths[name] = case.truth
            said(name)
        return _written(complete, truths, purpose=purpose, seed=seed, key=key, secret=secret)


def _written(
    folder: Path,
    truths: dict[str, HiddenTruth],
    *,
    purpose: Literal["sealed", "development"],
    seed: int,
    key: bytes | None,
    secret: bytes,
) -> Commitments:
    """Publish the commitments, then write the truths."""
    contents = {name: asdict(truth) for name, truth in truths.items()}
    salts = {name: salt_of(secret, name) for name in contents}
    published = tuple(
        PublishedCase(
            case=name, commitment=commitment(salts[name], truth), files=case_hashes(folder / "cases" / name)
        )
        for name, truth in contents.items()
    )
    commitments = Commitments(
        format=1, purpose=purpose, domain=DOMAINS[purpose].decode(), seed=seed, cases=published
    )
    write_bytes(folder / COMMITMENTS, commitments.model_dump_json(indent=1).encode() + b"\n")
    kept = {name: {"salt": salts[name].hex(), "truth": contents[name]} for name in contents}
    if key is None:
        write_bytes(folder / READABLE, json.dumps(kept, sort_keys=True, indent=1).encode() + b"\n")
    else:
        write_bytes(folder / LOCKED, locked(kept, key))
    return commitments


def read_commitments(folder: Path) -> Commitments:
    """The published part of a trial.

    Raises
    ------
    InputError
        If the folder is no trial.
    """
    try:
        return Commitments.model_validate_json((folder / COMMITMENTS).read_bytes())
    except OSError as error:
        got = f"no {COMMITMENTS}" if folder.is_dir() else "a file" if folder.exists() else "no such folder"
        raise InputError(f"trial {folder}", got=got, allowed="a folder made by `sloshlab trial seal`") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            f"{folder / COMMITMENTS}: {first['loc']}", got=first["msg"], allowed="an untouched file"
        ) from error


def check_data(folder: Path, case: PublishedCase) -> None:
    """Compare the files of a case with their published hashes.

    Raises
    ------
    InputError
        If one was changed, added or taken away.
    """
    found = case_hashes(folder / "cases" / case.case)
    if found != case.files:
        odd = sorted(name for name in found.keys() | case.files.keys() if found.get(name) != case.files.get(name))
        raise InputError(
            f"{case.case}: {odd[0]}",
            got="not what was published",
            allowed="the files of the sealed trial, unchanged",
        )


def opened_truths(folder: Path, commitments: Commitments, key: bytes | None) -> dict[str, dict[str, Any]]:
    """Truths by case, each checked against its commitment.

    Raises
    ------
    InputError
        If a truth is missing or not the one that was committed to, or the key is needed or wrong.
    """
    if commitments.purpose == "development":
        kept = json.loads((folder / READABLE).read_bytes())
    elif key is None:
        raise InputError(f"trial {folder}", got="no key", allowed="--key FILE, written when it was sealed")
    else:
        kept = opened(folder / LOCKED, key)
    truths = {}
    for case in commitments.cases:
        entry = kept.get(case.case)
        if entry is None or commitment(bytes.fromhex(entry["salt"]), entry["truth"]) != case.commitment:
            raise InputError(
                f"{case.case}: truth", got="not the one committed to", allowed="the truth that was sealed"
            )
        truths[case.case] = entry["truth"]
    return truths
