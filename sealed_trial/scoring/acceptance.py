"""What the diagnosis must reach, and whether as many cases as there are can tell that it does."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from sealed_trial.scoring.calibration import Calibration
from sealed_trial.scoring.statistics import Rate, rate

Standing = Literal["met", "not met", "cannot tell"]

FALSE_ALARMS: Final = "false alarms where nothing is missing"
CLEAR_SINGLES: Final = "clear single effects named in the right block"
PAIRS: Final = "pairs with both names"
LOOK_ALIKES: Final = "look-alikes answered by the set"
OUTSIDE: Final = "outside the vocabulary, unknown with the right block"
WRONG_NAMES: Final = "wrong names anywhere"
INTERVALS: Final = "intervals that hold the truth"

ASKED: Final = {
    FALSE_ALARMS: (0.0, 0.02),
    CLEAR_SINGLES: (0.95, 1.0),
    PAIRS: (0.80, 1.0),
    LOOK_ALIKES: (0.90, 1.0),
    OUTSIDE: (0.90, 1.0),
    WRONG_NAMES: (0.0, 0.01),
    INTERVALS: (0.87, 0.93),
}
"""Least and largest share; of intervals at 90 %."""

LARGEST_CALIBRATION_ERROR: Final = 0.05
"""Of probabilities, expected over bins of equal mass."""


@dataclass(frozen=True)
class Aim:
    """One aim and what was reached.

    Attributes
    ----------
    name : str
    least, most : float
        What is asked.
    reached, low, high : float
        The share or error and its interval; NaN without cases.
    n : int
        What it was counted over.
    within : bool
        Whether the reached number itself is what is asked.
    standing : str
        Whether the whole interval is, none of it is, or neither.
    """

    name: str
    least: float
    most: float
    reached: float
    low: float
    high: float
    n: int
    within: bool
    standing: Standing


def acceptance(rates: Mapping[str, Rate], calibrations: Mapping[str, Calibration]) -> tuple[Aim, ...]:
    """Every aim against what was reached."""
    shares = [_of_rate(name, rates[name], *asked) for name, asked in ASKED.items()]
    return (*shares, *(_of_calibration(name, its) for name, its in calibrations.items()))


def _of_rate(name: str, its: Rate, least: float, most: float) -> Aim:
    standing: Standing = "cannot tell"
    if its.n and least <= its.low and its.high <= most:
        standing = "met"
    elif its.n and (its.high < least or its.low > most):
        standing = "not met"
    within = bool(its.n) and least <= its.value <= most
    return Aim(name, least, most, its.value, its.low, its.high, its.n, within, standing)


def _of_calibration(kind: str, its: Calibration) -> Aim:
    most = LARGEST_CALIBRATION_ERROR
    standing: Standing = "cannot tell"
    # where cases are few the interval is too narrow: what chance makes of right probabilities must fit in, too,
    # and a share of errors none of which was seen; chance must not explain what is called an error
    if max(its.error, its.high, its.by_chance, rate(0, its.n_cases).high) <= most:
        standing = "met"
    elif its.low > most and its.error > its.by_chance_high:
        standing = "not met"
    name = f"calibration error, {kind}"
    within = not math.isnan(its.error) and its.error <= most
    return Aim(name, 0.0, most, its.error, its.low, its.high, its.n_cases, within, standing)
