"""How long a computation still takes, from what is done of it and from what such computations usually take.

Within one step the pace so far goes on. Where a computation goes through stages of which nobody knows beforehand
how many there are, a plan says what share of the whole is usually over in each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

LONGEST_S: Final = 100 * 86400.0
Plan = Sequence[tuple[str, float]]
"""Beginnings of notes in the order of the stages, each with the share of the whole that is usually over in it; one
may come twice."""


class TimeLeft:
    """Follows a computation.

    Parameters
    ----------
    began_s : float
        When it began, by the clock of `at`.
    plan : Plan
        Stages may be left out, and never come back. Empty for one step after the other, each of which tells how
        much there is to do.

    Examples
    --------
    >>> time_left = TimeLeft(0.0)
    >>> time_left.at(10.0, 1, 4)
    >>> time_left.seconds(10.0)
    30.0
    >>> of_stages = TimeLeft(0.0, [("reading", 0.1), ("fitting", 0.5)])
    >>> of_stages.at(5.0, 0, 1, "fitting the liquid")
    >>> of_stages.seconds(5.0)
    5.0
    """

    def __init__(self, began_s: float, plan: Plan = ()) -> None:
        self._plan = tuple(plan)
        self._began_s = self._last_s = began_s
        self._everything = 0.0
        self._stage = 0
        self._whole_s: float | None = None

    @property
    def is_of_everything(self) -> bool:
        """Whether it tells the time to the end, and not to the end of a step."""
        return bool(self._plan)

    def at(self, now_s: float, done: float, everything: float, note: str = "") -> None:
        """Take what is done of what there is to do.

        Parameters
        ----------
        now_s : float
        done, everything : float
            In any unit; another amount in all, or none of it done, is another step.
        note : str
            By which the plan knows the stage.
        """
        if self._plan:
            self._stage = next((k for k in self._may_be() if note.startswith(self._plan[k][0])), self._stage)
            self._whole_s = (now_s - self._began_s) / self._plan[self._stage][1]
            return
        if done == 0 or everything != self._everything:
            # the first part of a step is known once it is done; it began when the step before was left
            self._began_s = now_s if done == 0 else self._last_s
        self._everything, self._last_s = everything, now_s
        spent_s = now_s - self._began_s
        self._whole_s = spent_s * everything / done if done > 0 and spent_s > 0 else None

    def _may_be(self) -> list[int]:
        """This stage and later ones; one that repeats a beginning only from the stage right before it."""
        starts = [start for start, _ in self._plan]
        return [k for k in range(self._stage, len(starts)) if k <= self._stage + 1 or starts.index(starts[k]) == k]

    def seconds(self, now_s: float) -> float | None:
        """Time left [s]; None where nothing tells yet, or it has taken longer than it usually takes."""
        if not self._whole_s:
            return None
        left_s = self._whole_s - (now_s - self._began_s)
        return None if left_s < 0 else min(left_s, LONGEST_S)


class WeightedSteps:
    """Amounts of work of single steps, for steps that are not alike.

    Parameters
    ----------
    weights : sequence of float
        Of each step, for example the size of the file that it reads.

    Examples
    --------
    >>> WeightedSteps([1.0, 3.0]).done(1), WeightedSteps([1.0, 3.0]).done(2), WeightedSteps([0.0, 0.0]).done(1)
    (1.0, 4.0, 1.0)
    """

    def __init__(self, weights: Sequence[float]) -> None:
        total = sum(weights)
        # nothing is known of what weighs nothing: all alike
        self._weights = list(weights) if total > 0 else [1.0] * len(weights)

    @property
    def everything(self) -> float:
        """Of all steps."""
        return sum(self._weights)

    def done(self, n_steps: int) -> float:
        """Of so many steps."""
        return sum(self._weights[:n_steps])
