"""Numbers as text: significant digits, no noise, units that suit the size."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

MISSING: Final = "–"
_PREFIXES: Final = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def text(value: float | None, digits: int = 3) -> str:
    """A number with significant digits; a dash for what is not a number.

    Examples
    --------
    >>> text(1.6543), text(float("nan")), text(-0.00012345), text(123456.0), text(30.0)
    ('1.65', '–', '−0.000123', '123456', '30.0')
    """
    if value is None or not math.isfinite(value):
        return MISSING
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    shown = f"{value:.{digits - 1}e}" if decimals > 7 else f"{value:.{max(decimals, 0)}f}"
    return shown.replace("-", "−")


def signed(value: float, decimals: int = 1) -> str:
    """A number with its sign, for changes.

    Examples
    --------
    >>> signed(-3.94), signed(0.5)
    ('−3.9', '+0.5')
    """
    return f"{value:+.{decimals}f}".replace("-", "−")


def interval(values: Iterable[float], digits: int = 3) -> str:
    """Smallest and largest finite value as ``"a … b"``.

    Examples
    --------
    >>> interval([2.0, float("nan"), 1.0])
    '1.00 … 2.00'
    """
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return MISSING
    low, high = text(min(finite), digits), text(max(finite), digits)
    return low if low == high else f"{low} … {high}"


def prefixed_unit(values: object, unit: str) -> tuple[float, str]:
    """Factor and unit that make the largest of the values a handy number.

    Examples
    --------
    >>> prefixed_unit([0.0, 0.062], "J")
    (1000.0, 'mJ')
    """
    finite = np.abs(np.asarray(values, dtype=float))
    finite = finite[np.isfinite(finite)]
    largest = float(finite.max()) if finite.size else 1.0
    for size, prefix in _PREFIXES:
        if largest >= 0.5 * size:
            return round(1 / size, 3), prefix + unit
    return 1.0, unit
