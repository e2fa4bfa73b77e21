"""A number of the baseline that retuning may change."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BaselineParameter:
    """One number of the baseline that a laboratory knows only so well.

    Attributes
    ----------
    name : str
    believed : float
    tolerance : float
        Standard deviation of what it may be, in its own unit.
    units : str
    is_reading : bool
        Whether it changes only what a channel reads, not the motion.
    most_tolerances : float
        How far it may be from what is believed of it; beyond, something else is the matter.
    channel : str
        The only one whose reading it changes; empty where it may change several.
    """

    name: str
    believed: float
    tolerance: float
    units: str = "1"
    is_reading: bool = False
    most_tolerances: float = 4.0
    channel: str = ""
