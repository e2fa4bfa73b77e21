"""How a simulation ended, as data whose text is the explanation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Status(IntEnum):
    """How a simulation ended.

    Examples
    --------
    >>> Status.DONE.explanation
    'simulated to the end'
    """

    DONE = 0
    UNSTABLE = 1
    FAULT = 2
    CHATTER = 3
    NO_ACCELERATION = 4

    @property
    def explanation(self) -> str:
        """One sentence for a person."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    Status.DONE: "simulated to the end",
    Status.UNSTABLE: "the motion grew beyond every bound or is no longer a number",
    Status.FAULT: "a term left the range in which it means anything",
    Status.CHATTER: "contacts or friction switched more often within one step than can be followed",
    Status.NO_ACCELERATION: "no acceleration satisfies the forces that depend on it",
}


@dataclass(frozen=True)
class Ending:
    """Status with the place and the time of whatever ended the simulation.

    Attributes
    ----------
    status : Status
    time_s : float
        End of what was simulated.
    where : str
        Term or coordinate that ended it; empty when done.

    Examples
    --------
    >>> print(Ending(Status.UNSTABLE, 0.25, "mode 1"))
    the motion grew beyond every bound or is no longer a number: mode 1 at t = 0.25 s
    """

    status: Status
    time_s: float
    where: str = ""

    def __str__(self) -> str:
        if self.status is Status.DONE:
            return self.status.explanation
        return f"{self.status.explanation}: {self.where} at t = {self.time_s:.6g} s"
