"""Numbers as a page carries them: 16 bits each, written as text that no page can take for markup."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

_MISSING: Final = 65535
"""Code of what is not finite."""
_ESCAPED: Final = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}


def packed(values: npt.ArrayLike) -> dict[str, Any]:
    """Values in 65 535 steps of their range.

    Parameters
    ----------
    values : array_like, shape (n,)

    Returns
    -------
    dict
        ``low`` and ``step``: a value is ``low + step code``; ``codes``: 16-bit little-endian codes in base64,
        65 535 for what is not finite. A value is off by at most half a step.
    """
    numbers = np.asarray(values, np.float64).ravel()
    known = np.isfinite(numbers)
    low, high = (float(numbers[known].min()), float(numbers[known].max())) if known.any() else (0.0, 0.0)
    # halves first: the range of the largest numbers that there are is none
    step = (0.5 * high - 0.5 * low) / (0.5 * (_MISSING - 1)) or 1.0
    codes = np.full(numbers.size, _MISSING, np.uint16)
    codes[known] = np.round((0.5 * numbers[known] - 0.5 * low) / (0.5 * step))
    return {"low": low, "step": step, "codes": _text(codes)}


def packed_steps(samples: npt.NDArray[np.intp]) -> dict[str, Any]:
    """Ascending numbers of samples, exactly: their count where they are all, else the steps between them."""
    n = int(samples.size)
    if n and samples[0] == 0 and samples[-1] == n - 1:
        return {"count": n}
    steps = np.diff(samples, prepend=0)
    is_short = n == 0 or int(steps.max()) <= np.iinfo(np.uint16).max
    codes = steps.astype(np.uint16 if is_short else np.uint32)
    return {"steps": _text(codes), "bits": 16 if is_short else 32}


def _text(codes: npt.NDArray[Any]) -> str:
    return base64.b64encode(codes.astype(codes.dtype.newbyteorder("<")).tobytes()).decode("ascii")


def safe_json(content: Mapping[str, Any]) -> str:
    """JSON that stays text within a script element, whatever names it holds; NaN and infinity become null.

    Examples
    --------
    >>> safe_json({"run": "</script>", "rate": float("nan")})
    '{"run":"\\\\u003c/script\\\\u003e","rate":null}'
    """
    text = json.dumps(_finite(content), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    # names of files need not be Unicode
    text = text.encode("utf-8", errors="replace").decode("utf-8")
    return "".join(_ESCAPED.get(character, character) for character in text) if _needs_escape(text) else text


def _needs_escape(text: str) -> bool:
    return any(character in text for character in _ESCAPED)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _finite(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
