"""One case with its truth sealed beside it.

FOLDER/case/              rig.toml and recordings: all that a diagnosis gets
FOLDER/commitment.json    name, commitment to the truth, hashes of the files of the case
FOLDER/truth.locked       salt and truth under the key
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sealed_trial.case_drawing import DrawnCase
from sealed_trial.case_recording import write_case
from sealed_trial.sealing.commitment import case_hashes, commitment, salt_of
from sealed_trial.sealing.locked_truths import locked, opened
from sloshlab.atomic_file import filled_folder, write_bytes
from sloshlab.errors import InputError

CASE: Final = "case"
COMMITMENT: Final = "commitment.json"
LOCKED: Final = "truth.locked"


class PublishedCase(BaseModel):
    """What is known of a case before its truth is opened."""

    model_config = ConfigDict(frozen=True)

    format: Literal[1] = 1
    name: str = Field(min_length=1, max_length=100)
    commitment: str = Field(pattern=r"^[0-9a-f]{64}$")
    files: dict[str, str]


def key_of(domain: bytes, name: str, seed: int) -> bytes:
    """The key of a case that whoever knows its seed may open.

    It keeps a truth from eyes, and from programs that are not told the seed; a trial has a key of its own.
    """
    return hashlib.sha256(b"key\0" + domain + b"\0" + name.encode() + b"\0" + str(seed).encode()).digest()


def seal_case(folder: Path, name: str, case: DrawnCase, key: bytes, noise: np.random.Generator) -> PublishedCase:
    """Record a case, publish the commitment to its truth and lock the truth; whole or not at all.

    Parameters
    ----------
    folder : Path
        Made if missing.
    name : str
        What is published as the name of the case.
    case : DrawnCase
    key : bytes, 32
    noise : numpy.random.Generator
        Of all sensors.

    Raises
    ------
    MissingExtraError
        If `cryptography` is not installed.
    """
    truth = asdict(case.truth)
    salt = salt_of(key, name)
    with filled_folder(folder) as complete:
        write_case(complete / CASE, case, noise)
        published = PublishedCase(
            name=name, commitment=commitment(salt, truth), files=case_hashes(complete / CASE)
        )
        write_bytes(complete / COMMITMENT, published.model_dump_json(indent=1).encode() + b"\n")
        write_bytes(complete / LOCKED, locked({name: {"salt": salt.hex(), "truth": truth}}, key))
    return published


def read_published(folder: Path) -> PublishedCase:
    """What is published of a sealed case, checked against the files of the case.

    Raises
    ------
    InputError
        If the folder is no sealed case, or a file of the case is not the one that was published.
    """
    try:
        published = PublishedCase.model_validate_json((folder / COMMITMENT).read_bytes())
    except OSError as error:
        raise InputError(f"{folder}", got=f"no {COMMITMENT}", allowed="a sealed case") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            f"{folder / COMMITMENT}: {first['loc']}", got=first["msg"], allowed="an untouched file"
        ) from error
    found = case_hashes(folder / CASE)
    if found != published.files:
        names = found.keys() | published.files.keys()
        odd = min(name for name in names if found.get(name) != published.files.get(name))
        raise InputError(
            f"{folder / CASE / odd}",
            got="not what was published",
            allowed="the files of the sealed case, unchanged",
            remedy="draw it anew with --seed, or check the folder out again",
        )
    return published


def opened_truth(folder: Path, published: PublishedCase, key: bytes) -> dict[str, Any]:
    """The truth of a case, checked against the commitment that was published before.

    Raises
    ------
    InputError
        If it is missing, locked under another key, or not the one that was committed to.
    """
    try:
        kept = opened(folder / LOCKED, key).get(published.name)
    except OSError as error:
        raise InputError(f"{folder}", got=f"no {LOCKED}", allowed="a sealed case") from error
    if kept is None or commitment(bytes.fromhex(kept["salt"]), kept["truth"]) != published.commitment:
        raise InputError(
            f"{folder / LOCKED}", got="not the truth committed to", allowed="the truth that was sealed"
        )
    truth: dict[str, Any] = kept["truth"]
    return truth
