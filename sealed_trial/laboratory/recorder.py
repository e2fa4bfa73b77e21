"""What a recorder does to all channels alike: a filter before the converter, and when it begins to record."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import bessel, cont2discrete, lfilter

FloatArray = npt.NDArray[np.float64]

ORDER: Final = 4
CORNER: Final = 0.35
"""Of the filter against aliasing [sampling rates], where it passes 1/√2."""
_FILTERS, _BEGINS_EARLY = 0.4, 0.4
_LONGEST_LEAD: Final = 12.0
"""Samples before a release."""


@dataclass(frozen=True)
class Recorder:
    """A recorder.

    Attributes
    ----------
    filters : bool
        Whether a Bessel filter of order 4 stands before the converter of every channel.
    lead_samples : float
        By which it begins to record before a release; a fraction, as nobody releases at a sample.
    """

    filters: bool = False
    lead_samples: float = 0.0

    @property
    def n_held(self) -> int:
        """Samples at which a tank is still held."""
        return int(np.ceil(self.lead_samples))

    @property
    def first_s_in_samples(self) -> float:
        """From the release to the first sample after it [samples], 0 … 1."""
        return self.n_held - self.lead_samples

    def passed(self, values: FloatArray, before: float) -> FloatArray:
        """What comes out of the filter for values that were constant before.

        Parameters
        ----------
        values : ndarray, shape (n,)
        before : float
            What was there until the first sample.
        """
        if not self.filters:
            return values
        return np.asarray(lfilter(*_filter(), np.asarray(values) - before) + before)


@cache
def _filter() -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator, exact for what is straight between samples; in samples, one for all rates."""
    continuous = bessel(ORDER, 2 * np.pi * CORNER, analog=True, output="ba", norm="mag")
    numerator, denominator, _ = cont2discrete(continuous, 1.0, method="foh")
    return numerator.ravel(), denominator


def drawn_recorder(generator: np.random.Generator) -> Recorder:
    """A recorder of a laboratory; nothing of it depends on what is hidden."""
    filters, early = generator.random(2) < (_FILTERS, _BEGINS_EARLY)
    lead = float(generator.uniform(0.0, _LONGEST_LEAD))
    return Recorder(bool(filters), lead if early else 0.0)
