"""ζ₁ of an ensemble of networks: mean, scatter and interval, and whether it holds what was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student_t

from pipelines.report.numbers import MISSING, text
from pipelines.report.tables import Table
from sloshlab.modal.instantaneous_damping import CONFIDENCE

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class UncertainDamping:
    """ζ₁ of one motion by every member.

    Attributes
    ----------
    motion : str
        Amplitude of a decay, or level of a random run.
    measured : float
        Of the recordings.
    members : ndarray, shape (n_members,)
        Those that gave a value.
    """

    motion: str
    measured: float
    members: FloatArray

    @property
    def mean(self) -> float:
        """Over the members."""
        return float(self.members.mean())

    @property
    def std(self) -> float:
        """Standard deviation between members; NaN with one."""
        return float(self.members.std(ddof=1)) if self.members.size > 1 else float("nan")

    @property
    def half_width(self) -> float:
        """Half of the 90 % interval of one network more, trained as these were (Student)."""
        n = self.members.size
        if n < 2:
            return float("nan")
        return float(student_t.ppf(0.5 + CONFIDENCE / 2, n - 1) * self.std * np.sqrt(1 + 1 / n))

    @property
    def holds_measured(self) -> bool:
        """Whether the measured value is within that interval."""
        return abs(self.measured - self.mean) <= self.half_width


@dataclass(frozen=True)
class NetworkUncertainty:
    """ζ₁ of an ensemble in all sloshing recordings.

    Attributes
    ----------
    name : str
        Of its file.
    n_members : int
    dampings : tuple of UncertainDamping
    ran_away : tuple of str
        Member and run of every simulation that ended because the network said what no training can have meant.
    """

    name: str
    n_members: int
    dampings: tuple[UncertainDamping, ...]
    ran_away: tuple[str, ...] = ()

    def summary(self) -> dict[str, dict[str, float]]:
        """Numbers by motion, for a machine."""
        return {
            each.motion: {
                "measured": each.measured,
                "mean": each.mean,
                "std": each.std,
                "half_width": each.half_width,
            }
            for each in self.dampings
        }


def uncertainty_table(uncertain: NetworkUncertainty) -> Table:
    """Measured, and what the ensemble says with its interval."""
    rows = tuple(
        (
            each.motion,
            text(100 * each.measured),
            text(100 * each.mean),
            text(100 * each.std, 2) if each.members.size > 1 else MISSING,
            str(each.members.size),
            f"{text(100 * (each.mean - each.half_width))} … {text(100 * (each.mean + each.half_width))}"
            if np.isfinite(each.half_width)
            else MISSING,
            "yes" if each.holds_measured else "no",
        )
        for each in uncertain.dampings
    )
    held = sum(each.holds_measured for each in uncertain.dampings)
    caption = (
        f"{uncertain.n_members} networks of {uncertain.name}, each in the tank. The interval is that of one "
        f"network more, trained as these were (Student); {held} of {len(rows)} measured values are in it. It "
        "tells what the runs of the training leave open, not what a network of this kind cannot say, nor how "
        "releases differ."
        + (f" Ran away and left out: {', '.join(uncertain.ran_away)}." if uncertain.ran_away else "")
    )
    header = (
        "motion",
        "ζ₁ measured [%]",
        "mean [%]",
        "standard deviation [%]",
        "networks",
        "90 % interval [%]",
        "holds measured",
    )
    return Table("Uncertainty of the network in ζ₁", header, rows, caption)
