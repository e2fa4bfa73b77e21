"""Intervals of the numbers that were found."""

from __future__ import annotations

from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation

LEVEL: Final = 0.90
_NORMAL_90: Final = 1.6449
_ERRORS_OVER_STANDARD_ERRORS: Final = 3.0
"""On cases whose truth was known."""
_CALIBRATION: Final = 0.01
_IN_UNITS_OF_THE_CHANNEL: Final = ("amplitude", "rate", "limit")


def interval(best: Explanation, candidate: Candidate, parameter: str) -> tuple[float, float, float]:
    """Estimate and 90 % interval of one parameter.

    The standard error of the fit knows noise alone; it is widened by what the fit leaves, by how far estimates
    were off where the truth was known, and by the calibration of a channel in whose unit the number is.
    """
    name = f"{candidate.key}.{parameter}"
    estimate = best.fit.values[name]
    if name not in best.fit.names:
        return estimate, estimate, estimate
    scatter = _ERRORS_OVER_STANDARD_ERRORS * best.fit.standard_error(name) * max(1.0, best.held_out_rms)
    of_gain = _CALIBRATION * abs(estimate) if parameter in _IN_UNITS_OF_THE_CHANNEL else 0.0
    width = _NORMAL_90 * float(np.hypot(scatter, of_gain))
    chosen = next(one for one in candidate.effect.parameters if one.name == parameter)
    lowest, highest = candidate.bounds(chosen)
    return estimate, max(estimate - width, lowest), min(estimate + width, highest)
