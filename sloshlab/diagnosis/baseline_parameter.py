"""A parameter of the baseline with its prior."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BaselineParameter:
    """One parameter of the baseline that a laboratory knows within a tolerance.

    Attributes
    ----------
    name : str
    believed : float
        Mean of its Gaussian prior.
    tolerance : float
        Standard deviation of the prior, in its own unit.
    units : str
    is_reading : bool
        Whether it changes only what a channel reads, not the motion.
    most_tolerances : float
        Bound of its deviation in tolerances; beyond it something else is wrong.
    channel : str
        The only one whose reading it changes; empty where it may change several.
    """

    name: str
    believed: float
    tolerance: float
    units: str = "1"
    is_reading: bool = False
    # What belongs to one run or one sensor may be far off; masses, frequencies, losses and gains have a closer
    # bound.
    most_tolerances: float = 4.0
    channel: str = ""
