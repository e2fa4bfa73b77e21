"""What is believed of the numbers of an effect before a recording is looked at.

A size may be small or large and is believed by its logarithm; of a number that may have both signs, each is as
likely. Ranges are stated beside the equation of an effect, relative to sizes of the motion: a friction in shares
of m a, a spring in shares of m ω².
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, log
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]
_SEED: Final = 0
"""Scrambles the sequence, which in ten dimensions is a few lines if it is not; always the same one."""


def unit_scale(surroundings: Any) -> float:
    """The scale of a number without one: a ratio, or a number in its own unit."""
    del surroundings
    return 1.0


@dataclass(frozen=True)
class Range:
    """The range of a number, in multiples of a size of the motion.

    Attributes
    ----------
    low, high : float
        In multiples of the scale.
    scale : callable
        (surroundings) → what one is, in the unit of the number.
    is_log : bool
        Whether its logarithm, not the number, is believed alike everywhere.
    may_be_negative : bool
        Whether low and high are sizes of a number of either sign; for logarithmic ranges.
    """

    low: float
    high: float
    scale: Callable[[Any], float] = unit_scale
    is_log: bool = True
    may_be_negative: bool = False


@dataclass(frozen=True)
class ParameterPrior:
    """What is believed of one number in one case.

    Attributes
    ----------
    name : str
    low, high : float
        In the unit of the number; sizes, where it may have either sign.
    is_log : bool
        Uniform in the logarithm; otherwise in the number.
    may_be_negative : bool

    Raises
    ------
    InputError
        If there is nothing between its ends, or a logarithm of what is not positive.

    Examples
    --------
    >>> from math import exp
    >>> friction = ParameterPrior("force_n", 0.01, 1.0, is_log=True, may_be_negative=False)
    >>> round(friction.value(0.5), 12)
    0.1
    >>> round(exp(-friction.log_density(0.1)), 3)  # f ln(high/low)
    0.461
    """

    name: str
    low: float
    high: float
    is_log: bool
    may_be_negative: bool

    def __post_init__(self) -> None:
        is_possible = self.low < self.high and (self.low > 0 or not self.is_log)
        if not is_possible or (self.may_be_negative and not self.is_log):
            raise InputError(
                f"prior of {self.name}",
                got=f"{self.low:g} … {self.high:g}",
                allowed="rising; positive if logarithmic; either sign for logarithmic ones alone",
            )

    def value(self, share: float) -> float:
        """The number below which a share of the belief lies, 0 … 1."""
        if not self.is_log:
            return self.low + share * (self.high - self.low)
        sign = 1.0
        if self.may_be_negative:
            # the negative half runs from −high to −low, so that the number rises with the share
            sign, share = (1.0, 2.0 * share - 1.0) if share >= 0.5 else (-1.0, 1.0 - 2.0 * share)
        return sign * self.low * float((self.high / self.low) ** share)

    def log_density(self, value: float) -> float:
        """Natural logarithm of the density, per unit of the number; −∞ outside."""
        size = abs(value) if self.may_be_negative else value
        if not self.low <= size <= self.high:
            return -inf
        if not self.is_log:
            return -log(self.high - self.low)
        signs = 2.0 if self.may_be_negative else 1.0
        return -log(signs * size * log(self.high / self.low))


def prior_of(name: str, range_: Range, bounds: tuple[float, float], surroundings: Any) -> ParameterPrior:
    """The range of a number in one case, within its bounds.

    Where these leave nothing of it, as in a machine that is far larger than any rig, what they leave is believed:
    all of it, or of a logarithmic range the two decades below the largest.
    """
    unit = range_.scale(surroundings)
    low, high = range_.low * unit, range_.high * unit
    most = max(map(abs, bounds)) if range_.may_be_negative else bounds[1]
    least = low if range_.may_be_negative else max(low, bounds[0])
    high = min(high, most)
    if least >= high:
        least, high = (0.01 * most if range_.is_log else bounds[0]), most
    return ParameterPrior(name, least, high, range_.is_log, range_.may_be_negative)


def about(name: str, size: float, bounds: tuple[float, float]) -> ParameterPrior:
    """Two decades either way about a size, for a number whose effect states no range."""
    low, high = bounds
    may_be_negative = low < 0 < high
    largest = max(-low, high) if may_be_negative else high
    size = min(max(size, 1e-300), largest)
    smallest = 0.01 * size if may_be_negative else max(low, 0.01 * size)
    # an effect may start at its smallest number, or at zero
    return ParameterPrior(name, smallest, max(min(100.0 * size, largest), 1.01 * smallest), True, may_be_negative)


def drawn(priors: Sequence[ParameterPrior], n: int) -> list[dict[str, float]]:
    """Numbers that fill the prior evenly, the same ones whenever they are asked for (Halton).

    Parameters
    ----------
    priors : sequence of ParameterPrior
    n : int
    """
    points = qmc.Halton(len(priors), scramble=True, seed=_SEED).random(n)
    return [
        {prior.name: prior.value(float(share)) for prior, share in zip(priors, point, strict=True)}
        for point in points
    ]
