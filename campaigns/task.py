"""What is to be done, as any other process or computer can be told it, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from sloshlab.errors import SloshlabError

Status = Literal["done", "failed", "timed_out", "died", "full", "stopped"]
HOW_IT_ENDED: Final[dict[Status, str]] = {
    "done": "there is a result",
    "failed": "its function refused or raised; it would again",
    "timed_out": "it took longer than its limit",
    "died": "its process ended, as often as it was tried",
    "full": "there was no space for its result",
    "stopped": "it was told to stop, and has saved what it can",
}
MOST_WORKERS: Final = 256
"""Processes on one machine, or jobs of a queue."""


@dataclass(frozen=True)
class Task:
    """A function and its arguments.

    Attributes
    ----------
    name : str
        For people.
    function : str
        ``module:function``, which takes the arguments and a function to be told the share that is done; what it
        returns can be written as JSON.
    arguments : mapping
        As JSON can hold them; files by their paths.
    time_limit_s : float, optional
        By the clock, from its start on.
    """

    name: str
    function: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    time_limit_s: float | None = None


@dataclass(frozen=True)
class Ending:
    """How a task ended.

    Attributes
    ----------
    status : str
        One of `HOW_IT_ENDED`.
    result : object
        What the function returned; None where there is no result.
    line : str
        Why there is no result, in one line; empty if there is one.
    seconds : float
        By the clock, of the last attempt.
    attempts : int
        How often it was begun.
    """

    status: Status
    result: Any = None
    line: str = ""
    seconds: float = 0.0
    attempts: int = 1


class ClusterError(SloshlabError, ConnectionError):
    """A cluster cannot be reached, or is not as it must be.

    The message says so in one line, and what to do.
    """


class StoppedError(KeyboardInterrupt):
    """Work was stopped by a signal, after every process has saved what it can.

    Parameters
    ----------
    number : int
        Of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"stopped by signal {number}")
        self.number = number
