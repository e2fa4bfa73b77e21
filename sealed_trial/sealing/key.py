"""The key of a sealed trial: a file of its own, outside the trial, readable by its owner only."""

from __future__ import annotations

import os
import re
import secrets
from pathlib import Path
from typing import Final

from sloshlab.errors import InputError

PREFIX: Final = "sloshlab-trial-key-1:"
_KEY_BYTES: Final = 32
_PATTERN = re.compile(re.escape(PREFIX) + r"([0-9a-f]{64})\s*")


def made_or_read_key(path: Path, trial: Path) -> bytes:
    """The key in a file; a new one is drawn where there is no file.

    Raises
    ------
    InputError
        If the file would lie within the trial, or is no key.
    """
    place, folder = path.resolve(), trial.resolve()
    if place == folder or folder in place.parents:
        raise InputError("--key", got=f"{path}, within the trial", allowed="a file outside the trial's folder")
    if path.exists():
        return read_key(path)
    key = secrets.token_bytes(_KEY_BYTES)
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(f"{PREFIX}{key.hex()}\n")
    return key


def read_key(path: Path) -> bytes:
    """The key in a file.

    Raises
    ------
    InputError
        If there is none, or others may read it.
    """
    try:
        text = path.read_text(encoding="ascii")
        mode = path.stat().st_mode
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"key {path}", got=str(error), allowed="the key file written when sealing") from error
    found = _PATTERN.fullmatch(text)
    if found is None:
        raise InputError(f"key {path}", got="something else", allowed=f"a line that begins with {PREFIX}")
    if mode & 0o077:
        raise InputError(
            f"key {path}", got=f"mode {mode & 0o777:o}", allowed="600", remedy=f"chmod 600 {path.name}"
        )
    return bytes.fromhex(found[1])


def is_key(text: str) -> bool:
    """Whether a text holds a key."""
    return _PATTERN.search(text) is not None
