"""Intervals of rates, scores of probabilities, and where detection sets in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize

LEAST_PROBABILITY: Final = 1e-3
"""Probabilities below count as this one in the logarithmic score, which one careless zero would make infinite."""


_QUANTILE: Final = 1.959964
"""Of the standard normal distribution at 97.5 %: intervals are at 95 %."""


@dataclass(frozen=True)
class Rate:
    """Successes of trials and Wilson's score interval at 95 %.

    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212; recommended by L. D. Brown, T. T. Cai, A. DasGupta,
    Stat. Sci. 16 (2001) 101–133.
    """

    successes: int
    n: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """Share of successes; NaN without trials."""
        return self.successes / self.n if self.n else math.nan


def rate(successes: int, n: int) -> Rate:
    """A rate with its interval.

    Examples
    --------
    >>> detected = rate(1, 20)
    >>> round(detected.low, 4), round(detected.high, 4)
    (0.0089, 0.2361)
    """
    if not n:
        return Rate(successes, n, 0.0, 1.0)
    share, widening = successes / n, _QUANTILE**2 / n
    centre = (share + widening / 2) / (1 + widening)
    half = math.sqrt(widening * (share * (1 - share) + widening / 4)) / (1 + widening)
    # exactly, where the two terms are equal but for their last digits
    low = 0.0 if successes == 0 else centre - half
    return Rate(successes, n, low, 1.0 if successes == n else centre + half)


def brier(probabilities: Mapping[str, float], truths: Sequence[str]) -> float:
    """Σ (p − y)² over all labels, 0 to 2; labels in `truths` count as one.

    Examples
    --------
    >>> round(brier({"none": 0.7, "coulomb_friction": 0.3}, ["none"]), 6)
    0.18
    """
    given = normalised(probabilities)
    right = sum(given.get(label, 0.0) for label in truths)
    return (1 - right) ** 2 + sum(value**2 for label, value in given.items() if label not in truths)


def logarithmic(probabilities: Mapping[str, float], truths: Sequence[str]) -> float:
    """−ln of the probability of the truth, at most −ln LEAST_PROBABILITY."""
    given = normalised(probabilities)
    return -math.log(max(sum(given.get(label, 0.0) for label in truths), LEAST_PROBABILITY))


def normalised(probabilities: Mapping[str, float]) -> dict[str, float]:
    """Without negative ones, and with a sum of at most one; what is missing belongs to nobody."""
    positive = {label: max(value, 0.0) for label, value in probabilities.items()}
    total = sum(positive.values())
    return {label: value / total for label, value in positive.items()} if total > 1 else positive


@dataclass(frozen=True)
class DetectionCurve:
    """Logistic curve of detection over ln strength.

    Attributes
    ----------
    half : float
        Strength at which one in two is detected.
    slope : float
        Of the logit per unit of ln strength.
    """

    half: float
    slope: float

    def at(self, strength: float) -> float:
        """Probability of detection."""
        return 1 / (1 + math.exp(-self.slope * math.log(strength / self.half)))


def detection_curve(strengths: Sequence[float], detected: Sequence[bool]) -> DetectionCurve | None:
    """Fit by maximum likelihood with a weak prior on the slope; None where all or none were detected."""
    x, y = np.log(np.asarray(strengths, dtype=float)), np.asarray(detected, dtype=float)
    if x.size < 4 or y.min() == y.max():
        return None

    def cost(parameters: np.ndarray) -> float:
        logit = np.exp(parameters[1]) * (x - parameters[0])
        return float(np.sum(np.logaddexp(0.0, logit) - y * logit) + 0.5 * (parameters[1] - 0.7) ** 2)

    best = minimize(cost, [float(x.mean()), 0.7], method="Nelder-Mead").x
    return DetectionCurve(math.exp(best[0]), math.exp(best[1]))
