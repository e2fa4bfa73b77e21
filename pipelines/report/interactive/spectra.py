"""Power densities of the lines of a channel, as far up as there is anything to see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.report.interactive.contents import Line

FloatArray = npt.NDArray[np.float64]

_FEWEST_BANDS, _MOST_BANDS = 64, 512
_SHOWN_POWER: Final = 0.999
"""Share of the power of the first line, above whose frequency four times as much is still shown."""


def power_densities(lines: Sequence[Line], rate_hz: float) -> tuple[FloatArray, tuple[Line, ...]]:
    """Densities after Welch, under a Hann window, from the lowest band above zero.

    Parameters
    ----------
    lines : sequence of Line
        Of equal length; gaps are bridged by straight lines.
    rate_hz : float

    Returns
    -------
    frequency_hz : ndarray, shape (m,)
    densities : tuple of Line
        In squares of the unit of the lines over Hz; none where a line has no values.
    """
    from scipy.signal import welch

    n = lines[0].values.size if lines else 0
    if n < 2 or not all(np.isfinite(line.values).any() for line in lines):
        return np.empty(0), ()
    length = int(min(n, max(2 * _MOST_BANDS, n // 4)))
    densities = []
    for line in lines:
        known = np.isfinite(line.values)
        filled = np.interp(np.arange(n), np.flatnonzero(known), line.values[known])
        frequency_hz, density = welch(filled, rate_hz, nperseg=length)
        densities.append(density)
    power = np.cumsum(densities[0])
    top = int(np.searchsorted(power, _SHOWN_POWER * power[-1])) if power[-1] > 0 else frequency_hz.size
    # the mean is no motion
    shown = slice(1, int(min(frequency_hz.size, max(4 * top, _FEWEST_BANDS), _MOST_BANDS)))
    return np.asarray(frequency_hz[shown]), tuple(
        Line(line.label, line.role, density[shown], line.begins_hidden)
        for line, density in zip(lines, densities, strict=True)
    )
