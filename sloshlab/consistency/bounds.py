"""Results that no liquid can give.

A liquid in a tank that is shaken takes energy; what it takes in a cycle is bounded by what it can lose in two
plastic blows a cycle at the largest relative velocity, 2Ωu₀: W ≤ 2 · ½ m_l (2Ωu₀)², W̄ ≤ 4.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.consistency.finding import Finding, contradiction

LARGEST_W_BAR: Final = 4.0
BETA_RANGE: Final = (-1.5, 0.5)
"""β = −1 is a liquid that does not follow at all; blows in phase with the motion add to or take from it."""
_SIGMA: Final = 5.0
_SMALLEST: Final = 0.05
"""W̄ that remains from the calibration: 0.2 % of the apparent mass in quadrature."""


def window_findings(windows: xr.Dataset) -> list[Finding]:
    """Windows whose W̄ or β no liquid has.

    Parameters
    ----------
    windows : xarray.Dataset
        Of one run, with `w_bar`, `w_bar_std`, `beta`, `time_s`.
    """
    if "w_bar" not in windows or windows.sizes["window"] == 0:
        return []
    w_bar, std = windows["w_bar"].values, np.nan_to_num(windows["w_bar_std"].values)
    beta, time = windows["beta"].values, windows["time_s"].values
    beyond = BETA_RANGE[0] - beta, beta - BETA_RANGE[1]
    checks = (
        (w_bar < -_SIGMA * std - _SMALLEST, "W̄ is negative, {:.3g}: the liquid would give energy", w_bar),
        (w_bar > LARGEST_W_BAR + _SIGMA * std, "W̄ is {:.3g}, more than two plastic blows a cycle take", w_bar),
        (np.maximum(*beyond) > 0, "β is {:.3g}, which no liquid has", beta),
    )
    return [_finding(wrong, what, values, time) for wrong, what, values in checks if wrong.any()]


def _finding(
    wrong: npt.NDArray[np.bool_], what: str, values: npt.NDArray[np.float64], time: npt.NDArray[np.float64]
) -> Finding:
    at = np.flatnonzero(wrong)
    worst = values[at[np.abs(values[at]).argmax()]]
    text = f"in {at.size} of {wrong.size} windows {what.format(worst)}"
    return contradiction("bounds", text, time_s=(float(time[at[0]]), float(time[at[-1]])))
