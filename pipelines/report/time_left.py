"""How long a computation still takes, from what is done of it and from what such computations usually take.

Within one step the pace so far goes on. Where a computation goes through stages of which nobody knows beforehand
how many there are, a plan says what share of the whole is usually over when a stage begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

LONGEST_S = 100 * 86400.0


class TimeLeft:
    """Follows a computation.

    Parameters
    ----------
    began_s : float
        When it began, by the clock of `at`.
    plan : mapping of str to float
        Beginnings of notes, in the order of the stages, with the share of the whole time that is usually over when
        the stage begins; stages may be left out or come again. Empty for one step after the other, each of which
        tells how much there is to do.

    Examples
    --------
    >>> time_left = TimeLeft(0.0)
    >>> time_left.at(10.0, 1, 4)
    >>> time_left.seconds(10.0)
    30.0
    >>> of_stages = TimeLeft(0.0, {"reading": 0.0, "fitting": 0.25})
    >>> of_stages.at(5.0, 0, 1, "fitting the liquid")
    >>> of_stages.seconds(5.0)
    15.0
    """

    def __init__(self, began_s: float, plan: Mapping[str, float] | None = None) -> None:
        self._plan = dict(plan or {})
        self._shares = [*self._plan.values(), 1.0]
        self._began_s = self._step_began_s = self._last_s = began_s
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
            self._at_stage(now_s, done, everything, note)
            return
        if done == 0 or everything != self._everything:
            # the first part of a step is known once it is done; it began when the step before was left
            self._step_began_s = now_s if done == 0 else self._last_s
        self._everything, self._last_s = everything, now_s
        spent_s = now_s - self._step_began_s
        self._whole_s = spent_s * everything / done if done > 0 and spent_s > 0 else None

    def seconds(self, now_s: float) -> float | None:
        """Time left [s]; None where nothing tells yet."""
        if self._whole_s is None:
            return None
        began_s = self._began_s if self._plan else self._step_began_s
        spent_s = now_s - began_s
        if self._plan:
            # a stage that takes longer than usual: its end moves away, ever more slowly
            return min(max(self._whole_s - spent_s, (1 - self._shares[self._stage]) * spent_s / 4), LONGEST_S)
        return min(max(self._whole_s - spent_s, 0.0), LONGEST_S)

    def _at_stage(self, now_s: float, done: float, everything: float, note: str) -> None:
        found = next((k for k, start in enumerate(self._plan) if note.startswith(start)), self._stage)
        here, after = self._shares[found], self._shares[found + 1]
        part = min(max(done / everything, 0.0), 1.0) if everything > 0 else 0.0
        is_new = found != self._stage
        if is_new:
            self._stage, self._step_began_s = found, now_s if done == 0 else self._last_s
        self._last_s = now_s
        share = here + part * (after - here)
        if share > 0 and (is_new or self._whole_s is None or part > 0):
            spent_s = now_s - self._began_s
            pace_s = spent_s / share
            own_s = (now_s - self._step_began_s) * (1 - part) / part if part > 0 else (after - here) * pace_s
            self._whole_s = spent_s + own_s + (1 - after) * pace_s


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
