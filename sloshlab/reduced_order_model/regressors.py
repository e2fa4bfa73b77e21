"""Tapped delay lines: which past values a model sees, and the samples of a run for which all of them are known.

Runs stay apart: a window never reaches from one run into another, nor over a gap.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]
MOST_DELAYS = 2000


@dataclass(frozen=True)
class Delays:
    """Which past values make up the regressors φ(k), in samples (2.23).

    Attributes
    ----------
    inputs : tuple of int
        x(k − d) for each d ≥ 0; may be empty where there are states.
    outputs : tuple of int
        y(k − d) for each d ≥ 1; empty for a model without feedback.
    n_states : int
        Slow states of the run, and its fill level, that are seen beside them, without delay; only without
        feedback.
    """

    inputs: tuple[int, ...]
    outputs: tuple[int, ...] = ()
    n_states: int = 0

    def __post_init__(self) -> None:
        for what, delays, least in (("input delays", self.inputs, 0), ("output delays", self.outputs, 1)):
            wrong = [delay for delay in delays if not least <= delay <= MOST_DELAYS]
            if wrong or len(set(delays)) != len(delays):
                got = f"{wrong[0]}" if wrong else "a delay twice"
                raise InputError(what, got=got, allowed=f"different whole numbers {least} … {MOST_DELAYS}")
        if not self.inputs and not self.n_states:
            raise InputError("input delays", got="none", allowed="at least one")
        if not 0 <= self.n_states <= MOST_DELAYS or (self.n_states and self.outputs):
            got = f"{self.n_states} states, {len(self.outputs)} output delays"
            raise InputError("delays", got=got, allowed="states without output delays")

    @classmethod
    def tapped(cls, n_inputs: int, n_outputs: int = 0, *, with_present: bool = False) -> Delays:
        """The usual delay lines: x(k−1) … x(k−n), y(k−1) … y(k−m).

        Parameters
        ----------
        n_inputs, n_outputs : int
        with_present : bool
            Whether x(k) belongs to it.

        Examples
        --------
        >>> Delays.tapped(2, 1)
        Delays(inputs=(1, 2), outputs=(1,), n_states=0)
        """
        # delays start at 1 as in (2.23): the force at t_k is then known before the motion it makes
        first = 0 if with_present else 1
        return cls(tuple(range(first, n_inputs + 1)), tuple(range(1, n_outputs + 1)))

    @property
    def n_regressors(self) -> int:
        """Length of φ."""
        return len(self.inputs) + len(self.outputs) + self.n_states

    @property
    def is_one_line(self) -> bool:
        """Whether φ is a stretch of past inputs without holes, and nothing else."""
        # only the moments of a line without holes are correlations of one signal
        if self.outputs or self.n_states:
            return False
        return self.inputs == tuple(range(self.inputs[0], self.inputs[0] + len(self.inputs)))

    @property
    def longest(self) -> int:
        """Samples that a model must have seen."""
        return max((*self.inputs, *self.outputs), default=0)


@dataclass(frozen=True)
class Run:
    """One recording as input and output on one grid of time.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        Input and output; NaN where nothing is known.
    name : str
        For messages.
    states : ndarray, shape (n_states, n), optional
        Slow states for the regressors; NaN where nothing is known.
    fill_level : float, optional
        Of the tank, for models that see it.
    """

    x: FloatArray
    y: FloatArray
    name: str = "run"
    states: FloatArray | None = None
    fill_level: float | None = None

    @classmethod
    def of(cls, x: ArrayLike, y: ArrayLike, name: str = "run") -> Run:
        """Make a run of anything that is like an array.

        Raises
        ------
        InputError
            If lengths differ, there is no sample, or a value is infinite.
        """
        run = cls(np.asarray(x, np.float64), np.asarray(y, np.float64), name)
        if run.x.ndim != 1 or run.x.shape != run.y.shape or not run.x.size:
            raise InputError(
                name, got=f"input {run.x.shape}, output {run.y.shape}", allowed="one dimension, equal lengths"
            )
        if np.isinf(run.x).any() or np.isinf(run.y).any():
            raise InputError(name, got="an infinite value", allowed="finite numbers, NaN where nothing is known")
        return run


def segments(run: Run, delays: Delays) -> list[tuple[int, int]]:
    """Return the stretches [first, last) of samples whose regressors and output are all known.

    Parameters
    ----------
    run : Run
    delays : Delays

    Examples
    --------
    >>> run = Run.of([0, 1, 2, np.nan, 4, 5, 6], np.zeros(7))
    >>> segments(run, Delays((1, 2)))
    [(2, 4), (6, 7)]
    """
    n = run.x.size
    known = np.isfinite(run.y)
    if delays.n_states:
        known &= np.isfinite(states_of(run, delays)).all(axis=0)
    x_known, y_known = np.isfinite(run.x), np.isfinite(run.y)
    for of, ds in ((x_known, delays.inputs), (y_known, delays.outputs)):
        for delay in ds:
            # before the first samples nothing is known; zeros would be a motion that was not there
            known[:delay] = False
            known[delay:] &= of[: max(n - delay, 0)]  # none where the run is shorter
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def n_samples(runs: Sequence[Run], delays: Delays) -> int:
    """Return how many samples of some runs can be used."""
    return sum(last - first for run in runs for first, last in segments(run, delays))


def blocks(runs: Sequence[Run], delays: Delays, size: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield regressors and outputs of all runs, never more than `size` samples at once.

    Parameters
    ----------
    runs : sequence of Run
    delays : Delays
    size : int

    Yields
    ------
    regressors : ndarray, shape (n_regressors, m)
        One column per sample.
    outputs : ndarray, shape (m,)
    """
    for run in runs:
        for first, last in segments(run, delays):
            for start in range(first, last, size):
                stop = min(start + size, last)
                yield regressors(run, delays, start, stop), run.y[start:stop]


def regressors(run: Run, delays: Delays, start: int, stop: int) -> FloatArray:
    """Return φ for the samples start … stop − 1, one column each.

    Parameters
    ----------
    run : Run
    delays : Delays
    start, stop : int
    """
    # one column per sample, so that row a of a delay line is row 0 shifted: correlations rely on this order
    rows = [run.x[start - delay : stop - delay] for delay in delays.inputs]
    rows += [run.y[start - delay : stop - delay] for delay in delays.outputs]
    if delays.n_states:
        rows += list(states_of(run, delays)[:, start:stop])
    return np.stack(rows)


def states_of(run: Run, delays: Delays) -> FloatArray:
    """Return the slow states of a run.

    Raises
    ------
    InputError
        If it has others than the delays speak of.
    """
    shape = (delays.n_states, run.x.size)
    if run.states is None or run.states.shape != shape:
        got = "none" if run.states is None else f"{run.states.shape}"
        raise InputError(f"{run.name}: states", got=got, allowed=f"{shape}")
    return run.states
