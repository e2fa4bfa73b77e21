"""Ticks of axes as people read them."""

from __future__ import annotations

import math
from typing import Any


def plain_log_ticks(axis: Any) -> None:
    """Ticks of a logarithmic axis as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(value)))
    axis.set_minor_formatter(NullFormatter())


def power_of_ten(value: float) -> str:
    """A tick as a plain number, or as a power of ten where that would be long.

    Examples
    --------
    >>> power_of_ten(0.01), power_of_ten(1e-5), power_of_ten(100.0)
    ('0.01', '10⁻⁵', '100')
    """
    if 1e-3 <= abs(value) < 1e5 or value <= 0:
        return f"{value:g}".replace("-", "−")
    exponent = f"{round(math.log10(value)):d}".translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{exponent}"
