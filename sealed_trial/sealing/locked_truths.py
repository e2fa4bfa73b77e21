"""Truths under AES-256-GCM: unreadable without the key, and unchangeable."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sloshlab.errors import InputError, MissingExtraError

MAGIC: Final = b"sloshlab-trial-truths-1\n"
_NONCE_BYTES: Final = 12
_LARGEST_BYTES: Final = 64 * 2**20


def locked(truths: Mapping[str, Any], key: bytes) -> bytes:
    """Truths as bytes that only the key opens.

    Raises
    ------
    MissingExtraError
        If `cryptography` is not installed.
    """
    plain = json.dumps(truths, sort_keys=True, allow_nan=False).encode()
    # a nonce must not repeat for two texts under one key: derived from the text it does so for equal texts only
    nonce = hashlib.sha256(b"nonce" + key + plain).digest()[:_NONCE_BYTES]
    return MAGIC + nonce + bytes(_cipher(key).encrypt(nonce, plain, MAGIC))


def opened(path: Path, key: bytes) -> dict[str, Any]:
    """Truths from a file.

    Raises
    ------
    InputError
        If the file was changed, or the key is another trial's.
    """
    if path.stat().st_size > _LARGEST_BYTES:
        raise InputError(f"{path}", got=f"{path.stat().st_size} bytes", allowed=f"≤ {_LARGEST_BYTES}")
    content = path.read_bytes()
    body = content.removeprefix(MAGIC)
    if len(body) == len(content) or len(body) < _NONCE_BYTES + 16:
        raise InputError(f"{path}", got="another kind of file", allowed="truths locked by `sloshlab trial seal`")
    from cryptography.exceptions import InvalidTag

    try:
        plain = _cipher(key).decrypt(body[:_NONCE_BYTES], body[_NONCE_BYTES:], MAGIC)
    except InvalidTag as error:
        raise InputError(
            f"{path}",
            got="truths that this key does not open",
            allowed="the key of this trial, and an unchanged file",
        ) from error
    truths = json.loads(plain)
    assert isinstance(truths, dict)
    return truths


def _cipher(key: bytes) -> Any:
    try:
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM
    except ImportError as error:
        raise MissingExtraError("cryptography", extra="trial", purpose="sealing the truths of a trial") from error
    return AESGCM(key)
