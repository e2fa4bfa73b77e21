"""Samples about the instants at which dry friction turns: each the mean of its interval.

Dry friction makes an acceleration jump where a velocity turns. Taken at instants, a sample beside the jump is the
one or the other side of it, and a likelihood jumps with every parameter that moves the instant past a sample: no
slope leads a fit from there. The filter before a converter averages over about an interval, too; a recorder
without one reads up to half a jump beside that, which belongs to the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sloshlab.twin.motion import Motion
from sloshlab.twin.terms import PLACES

FloatArray = NDArray[np.float64]
_AT_REST: Final = 1e-9
"""Of the largest acceleration: what is left of a place that sticks is rounding."""


def averaged_where_friction_turns(rows: Sequence[FloatArray], motion: Motion) -> list[FloatArray]:
    """Rows of a motion whose accelerations and forces are means of an interval where one has a jump.

    A sample less than half an interval from a reversal has its share of the jump there. Where nothing turns the
    samples are those of the instants.

    Parameters
    ----------
    rows : sequence of ndarray, shape (n,)
        As of `sloshlab.twin.simulated_channels.rows_of`.
    motion : Motion
        Of them.
    """
    averaged = list(rows)
    n_modes = motion.modes.shape[2]
    # q̈ of all modes, and the force of the terms on the tank
    jumping = [*range(2 * n_modes, 3 * n_modes), 3 * n_modes + 3]
    for place in sorted({PLACES.index(term.place) for term in motion.twin.terms if term.kind.dry_friction}):
        velocity, acceleration = motion.place(place, 1), motion.place(place, 2)
        sticks = np.abs(acceleration) <= _AT_REST * np.abs(acceleration).max()
        shares = _shares(velocity, acceleration, sticks, motion.sampling_rate_hz)
        if shares.any():
            for i in jumping:
                averaged[i] = _averaged(np.ascontiguousarray(averaged[i]), velocity, sticks, shares)
    return averaged


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _shares(
    velocity: FloatArray, acceleration: FloatArray, sticks: NDArray[np.bool_], rate_hz: float
) -> FloatArray:
    """Share of the interval of every sample that is beyond a jump; negative where that comes before it."""
    shares = np.zeros(velocity.size)
    for k in range(1, velocity.size - 1):
        # In samples, since a place has turned or stopped: velocities are linear on either side of that.
        if not sticks[k]:
            since = velocity[k] / acceleration[k] * rate_hz
        elif not sticks[k - 1]:
            since = max(1.0 + velocity[k - 1] / acceleration[k - 1] * rate_hz, 0.0)
        else:
            continue
        # What begins to slip does so without a jump.
        if 0.0 <= since < 0.5 and not sticks[k - 1] and (sticks[k] or velocity[k] * velocity[k - 1] < 0.0):
            shares[k] = -(0.5 - since)
        elif -0.5 < since < 0.0 and (sticks[k + 1] or velocity[k] * velocity[k + 1] < 0.0):
            shares[k] = 0.5 + since
    return shares


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _averaged(row: FloatArray, velocity: FloatArray, sticks: NDArray[np.bool_], shares: FloatArray) -> FloatArray:
    """A row with its share of every jump: what lies between two samples beyond the slopes on either side."""
    found = row.copy()
    for k in range(1, row.size - 1):
        if shares[k] == 0.0:
            continue
        way = 1 if shares[k] > 0.0 else -1
        near = k + way
        smooth, n = 0.0, 0
        for first, second in ((k - way, k), (near, near + way)):
            if first >= 0 and 0 <= second < row.size and _on_one_side(velocity, sticks, first, second):
                smooth, n = smooth + row[second] - row[first], n + 1
        found[k] += abs(shares[k]) * (row[near] - row[k] - smooth / max(n, 1))
    return found


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _on_one_side(velocity: FloatArray, sticks: NDArray[np.bool_], i: int, j: int) -> bool:
    return bool(sticks[i] == sticks[j] and (sticks[i] or velocity[i] * velocity[j] > 0.0))
