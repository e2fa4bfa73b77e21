"""Confidence intervals of the parameters of named effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate, EffectParameter
from sloshlab.diagnosis.explanation import Explanation

LEVEL: Final = 0.90
_NORMAL_90: Final = 1.6449
_ERRORS_OVER_STANDARD_ERRORS: Final = 1.25
"""RMS of errors over standard errors, on cases whose truth was known and where nothing but noise counts."""
_CALIBRATION: Final = 0.01
"""Relative standard error of gains and masses."""
_POWER_OF_LENGTH: Final = {"_n_per_m3": 3, "_n_per_m2": 2, "_n_s2_per_m2": 2, "_n_per_m": 1, "_n_s_per_m": 1}
"""Power of a length, or of one per time, by which a force of the unit is divided: its gain counts as often."""
_FREE_OF_GAINS: Final = ("_hz", "_s", "exponent", "loss_factor", "ratio", "beta")
"""Ends of the names of numbers that no gain of a sensor and no mass changes, but for so much per second."""


def interval(best: Explanation, candidate: Candidate, parameter: str) -> tuple[float, float, float]:
    """Estimate and 90 % interval of one parameter.

    The standard error by noise is widened by the held-out error and by the calibration on known truths, or
    replaced by the cluster-robust one, whichever is more. The uncertainty of the baseline counts once, as the
    standard error by its prior or as the spread over randomised baselines, whichever is more. Where gains or
    masses scale the parameter, it is known no better than those: a cubic spring by the gain of a force and three
    times by that of a displacement, a leak by those of two sensors.
    """
    estimate = best.fit.values[f"{candidate.key}.{parameter}"]
    width = _half_width(best, candidate, parameter)
    if width == 0:
        return estimate, estimate, estimate
    lowest, highest = candidate.bounds(_named(candidate, parameter))
    return estimate, max(estimate - width, lowest), min(estimate + width, highest)


def interval_excludes_zero(best: Explanation, candidate: Candidate) -> bool:
    """Whether the interval of a size of an effect, its bounds aside, excludes zero.

    Parameters
    ----------
    best : Explanation
    candidate : Candidate
        One of its effects.
    """
    return any(
        abs(best.fit.values[f"{candidate.key}.{name}"]) > _half_width(best, candidate, name)
        for name in candidate.sizes
    )


def _half_width(best: Explanation, candidate: Candidate, parameter: str) -> float:
    """Of the 90 % interval, bounds aside; zero of a number that was not fitted."""
    name = f"{candidate.key}.{parameter}"
    if name not in best.fit.names:
        return 0.0
    of_noise, of_belief = best.fit.standard_errors(name)
    # With 2 in place of 1.25, and few runs widened more, errors of 95 numbers of opened cases were 0.18 of the
    # half width at the median: these intervals were too wide.
    scatter = _ERRORS_OVER_STANDARD_ERRORS * of_noise * max(1.0, best.held_out_rms)
    # A liquid that damps more for a while is no noise: of 87 numbers of opened cases 72 were held without this,
    # 80 with it.
    scatter = max(scatter, best.scatter.get(name, 0.0))
    is_between = _named(candidate, parameter).is_between_readings
    # A rate per second ends like a time but scales with the reading.
    is_free = parameter.endswith(_FREE_OF_GAINS) and not parameter.endswith("_per_s") and not is_between
    power = next(
        (power for ending, power in _POWER_OF_LENGTH.items() if parameter.endswith(ending)), int(is_between)
    )
    # The recordings cannot tell an effect from the scale of the sensors that show it.
    of_gain = 0.0 if is_free else _CALIBRATION * float(np.hypot(1.0, power)) * abs(best.fit.values[name])
    elsewhere = max(best.spread.get(name, 0.0), of_belief, of_gain)
    # Noise and baseline are independent; gains are part of the baseline and must not count twice.
    return _NORMAL_90 * float(np.hypot(scatter, elsewhere))


def _named(candidate: Candidate, parameter: str) -> EffectParameter:
    return next(known for known in candidate.effect.parameters if known.name == parameter)
