"""Commitments: what was true, fixed before anybody diagnosed, and checked when it is opened.

A commitment is SHA-256(salt ‖ truth), the truth as JSON with sorted keys. It tells nothing without the salt.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

SALT_BYTES: Final = 32


def truth_text(truth: Mapping[str, Any]) -> bytes:
    """A truth as the bytes that are committed to.

    Examples
    --------
    >>> truth_text({"b": 1, "a": [0.1]})
    b'{"a":[0.1],"b":1}'
    """
    return json.dumps(truth, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def commitment(salt: bytes, truth: Mapping[str, Any]) -> str:
    """SHA-256(salt ‖ truth) as hexadecimal digits."""
    return hashlib.sha256(salt + truth_text(truth)).hexdigest()


def salt_of(secret: bytes, case: str) -> bytes:
    """Salt of a case, from the secret of its trial."""
    return hmac.new(secret, b"salt of " + case.encode(), hashlib.sha256).digest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def case_hashes(folder: Path) -> dict[str, str]:
    """Hashes of all files of a case, by their paths within it."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): file_hash(path) for path in files}
