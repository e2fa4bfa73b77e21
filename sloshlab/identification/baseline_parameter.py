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
    most_below, most_above : float
        Bounds of its deviation below and above in tolerances; beyond them something else is wrong.
    channel : str
        The only one whose reading it changes; empty where it may change several.
    """

    name: str
    believed: float
    tolerance: float
    units: str = "1"
    is_reading: bool = False
    most_below: float = 4.0
    most_above: float = 4.0
    channel: str = ""

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        low = self.believed - self.most_below * self.tolerance
        return low, self.believed + self.most_above * self.tolerance
