"""Dormand–Prince of order 5(4) with a step that follows its error, stopped exactly at every switch of a contact.

The third derivative of a base's motion jumps at the knots of its table. Where a step over a knot has failed, none
reaches over one until the next sample.

J. R. Dormand, P. J. Prince, A family of embedded Runge–Kutta formulae, J. Comput. Appl. Math. 6 (1980) 19–26.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.compiled_system import CompiledSystem, Record, Sampling, Trial
from sealed_trial.laboratory.kernel import evaluate, margins, switch

FloatArray = npt.NDArray[np.float64]

_A: Final = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_C: Final = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_ERROR: Final = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
_SHORTEST: Final = 1e-12
_MOST_EVENTS: Final = 200_000


@njit(cache=True)
def _step(t, y, h, trial, system):  # type: ignore[no-untyped-def]
    """One step of length h."""
    slopes = trial.slopes
    stage = np.empty(y.size)
    for i in range(1, 7):
        for k in range(y.size):
            total = 0.0
            for j in range(i):
                total += _A[i, j] * slopes[j, k]
            stage[k] = y[k] + h * total
        if i == 6:
            trial.end[:] = stage
        evaluate(t + _C[i] * h, stage, slopes[i], trial.seen, system)


@njit(cache=True)
def _error(h, trial, relative, scale):  # type: ignore[no-untyped-def]
    """Largest error over its tolerance; `scale` holds the largest size seen of every component."""
    slopes, end = trial.slopes, trial.end
    worst = 0.0
    for k in range(end.size):
        total = 0.0
        for i in range(7):
            total += _ERROR[i] * slopes[i, k]
        allowed = relative * max(scale[k], abs(end[k])) + 1e-13
        worst = max(worst, abs(h * total) / allowed)
    return worst


@njit(cache=True)
def _grow(scale, y, n):  # type: ignore[no-untyped-def]
    """Largest size seen of every component; of all modes together, as each moves the same tank."""
    for first, stop in ((0, n), (n, 2 * n)):
        largest = 0.0
        for k in range(first, stop):
            largest = max(largest, scale[k], abs(y[k]))
        scale[first:stop] = largest
    for k in range(2 * n, y.size):
        scale[k] = max(scale[k], abs(y[k]))


@njit(cache=True)
def _first_left(out):  # type: ignore[no-untyped-def]
    """The condition that is left, or −1."""
    for which in range(out.size):
        if out[which] < 0.0:
            return which
    return -1


@njit(cache=True)
def _note(row, seen, rates, n):  # type: ignore[no-untyped-def]
    """What is seen and the accelerations of the coordinates."""
    row[:] = 0.0
    row[: at.O_COORDINATES] = seen[: at.O_COORDINATES]
    for j in range(n):
        row[at.O_COORDINATES + j] = rates[n + j]


@njit(cache=True)
def _until_next_knot(t, spacing_s):  # type: ignore[no-untyped-def]
    """From an instant to the next knot of the table [s]."""
    return (np.floor((t + _SHORTEST) / spacing_s) + 1.0) * spacing_s - t


@njit(cache=True)
def _settle(y, trial, out, system):  # type: ignore[no-untyped-def]
    """Rates at the start; what is let go outside a margin has left it at once."""
    evaluate(0.0, y, trial.slopes[0], trial.seen, system)
    for _ in range(at.N_CONDITIONS):
        margins(y, trial.seen, system.conditions, system.p, out)
        which = _first_left(out)
        if which < 0:
            break
        switch(which, y, trial.seen, system.conditions, system.p)
        evaluate(0.0, y, trial.slopes[0], trial.seen, system)


@njit(cache=True)
def _step_to_switch(t, y, length, which, whole, part, out, system):  # type: ignore[no-untyped-def]
    """Halve a step over a switch until it ends there; returns its length and the condition that is left."""
    early, late = 0.0, length
    for _ in range(100):
        if late - early < _SHORTEST:
            break
        middle = 0.5 * (early + late)
        _step(t, y, middle, part, system)
        margins(part.end, part.seen, system.conditions, system.p, out)
        which_middle = _first_left(out)
        if which_middle >= 0:
            late, which = middle, which_middle
        else:
            early = middle
    _step(t, y, late, whole, system)
    return late, which


@njit(cache=True)
def _take_switch(t, y, which, trial, system, events, n_events):  # type: ignore[no-untyped-def]
    """Change a condition, note it where there is room, and begin anew with its rates."""
    conditions = system.conditions
    switch(which, y, trial.seen, conditions, system.p)
    evaluate(t, y, trial.slopes[0], trial.seen, system)
    if n_events < events.shape[0]:
        events[n_events, 0], events[n_events, 1], events[n_events, 2] = t, which, conditions[which]


@njit(cache=True)
def integrate(y, sampling, system, record):  # type: ignore[no-untyped-def]
    """Advance `y` sample by sample and fill the record.

    Returns the number of events, or a negative number where the integration fails.
    """
    n_samples, step, relative = sampling
    p, conditions, n = system.p, system.conditions, system.psi.size
    slopes, end, scale = np.zeros((7, y.size)), np.empty(y.size), np.abs(y)
    _grow(scale, y, n)
    seen, out = np.empty(at.N_OUTPUTS + 4), np.empty(at.N_CONDITIONS)
    whole, part = Trial(slopes, end, seen), Trial(slopes, np.empty(y.size), seen)
    n_events, t, h = 0, 0.0, 0.2 * step
    _settle(y, whole, out, system)
    _note(record.seen[0], seen, slopes[0], n)
    for sample in range(1, n_samples):
        end_s = sample * step
        stops_at_knots = False
        while t < end_s - _SHORTEST:
            now = min(h, end_s - t)
            if stops_at_knots:
                now = min(now, _until_next_knot(t, system.step))
            _step(t, y, now, whole, system)
            error = _error(now, whole, relative, scale)
            if not error <= 1.0:
                if now < 1e-11 or not np.isfinite(error):
                    return -1
                h = now * max(0.2, 0.9 * error**-0.2)
                if now > _until_next_knot(t, system.step):
                    h, stops_at_knots = now, True
                continue
            margins(end, seen, conditions, p, out)
            which = _first_left(out)
            if which >= 0:
                now, which = _step_to_switch(t, y, now, which, whole, part, out, system)
            y[:] = end
            t += now
            _grow(scale, y, n)
            slopes[0] = slopes[6]
            if which >= 0:
                _take_switch(t, y, which, whole, system, record.events, n_events)
                n_events += 1
                if n_events > _MOST_EVENTS:
                    return -2
                h = max(min(h, 0.05 * step), 1e-9)
            else:
                # what a sample or a knot cut short says nothing against the step before it
                h = max(h if now < h else 0.0, now * min(4.0, 0.9 * max(error, 1e-4) ** -0.2))
        _note(record.seen[sample], seen, slopes[0], n)
    return n_events


def integrated(
    initial: FloatArray,
    n_samples: int,
    step_s: float,
    system: CompiledSystem,
    *,
    relative_tolerance: float = 1e-9,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What is seen at the samples, the final state, and the events.

    Returns
    -------
    seen : ndarray, shape (n_samples, N_OUTPUTS)
    state : ndarray
        At the last sample.
    events : ndarray, shape (n_events, 3)
        Time [s], condition, its new value.

    Raises
    ------
    ArithmeticError
        If the motion diverges or contacts chatter.
    """
    y = initial.astype(np.float64)
    seen = np.empty((n_samples, at.N_OUTPUTS))
    events = np.empty((20_000, 3))
    status = integrate(y, Sampling(n_samples, step_s, relative_tolerance), system, Record(seen, events))
    if status < 0:
        raise ArithmeticError("the hidden laboratory diverges" if status == -1 else "contacts chatter")
    return seen, y, events[: min(status, events.shape[0])]
