"""Fewer regressors while a network is trained: the directions in which those of the training runs vary.

Past values of a smooth signal hardly fill their space: of 70 delays at 512 Hz, on a shaker that sweeps below
20 Hz, 12 directions hold all but 2·10⁻⁶ of the mean square, 21 all but 10⁻⁷. A radial basis network sees distances
alone. An orthonormal basis keeps them, and what lies across it is next to nothing and common to all centres, so
that centres found along the basis are centres of the network of all regressors, with the same output.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sloshlab.reduced_order_model.regressors import Delays, Run, blocks, regressors, segments

FloatArray = NDArray[np.float64]
NEGLECTED: Final = 1e-7
"""Share of the mean square of the regressors that may lie across the directions."""
_BLOCK: Final = 8192


@runtime_checkable
class NetworkOfDistances(Protocol):
    """A network that can be trained along fewer directions."""

    def along(self, n_directions: int) -> Self:
        """The network of so many regressors, with as many neurons."""
        ...

    def lifted(self, theta: FloatArray, basis: FloatArray) -> FloatArray:
        """Parameters for all regressors out of those along a basis."""
        ...


def principal_directions(runs: Sequence[Run], delays: Delays, *, galilean: bool = False) -> FloatArray:
    """Orthonormal directions of the largest mean squares, of which all others hold less than `NEGLECTED`.

    Parameters
    ----------
    runs : sequence of Run
        Scaled to mean zero.
    delays : Delays
    galilean : bool
        Whether all directions shall be across the one of equal past inputs, so that no constant that is added to
        the input shows along them.

    Returns
    -------
    ndarray, shape (n_regressors, n_directions)
        Eigenvectors of Σ φ φᵀ, the largest first (Karhunen–Loève); with `galilean` of Σ Pφ φᵀP, where P takes the
        mean from the past inputs.
    """
    moments: Any = np.zeros((delays.n_regressors, delays.n_regressors))
    for phi, _ in blocks(runs, delays, _BLOCK):
        moments += phi @ phi.T
    if galilean:
        moments = _without_mean(_without_mean(moments, delays).T, delays)
    values, vectors = np.linalg.eigh(moments)
    across = np.cumsum(np.maximum(values, 0.0)) < NEGLECTED * values.sum()
    kept = vectors[:, ~across][:, ::-1]
    # once more: eigenvectors are across each other to rounding over the distance of their values only
    return np.ascontiguousarray(_without_mean(kept, delays) if galilean else kept)


def _without_mean(columns: FloatArray, delays: Delays) -> FloatArray:
    """Columns of regressors without the mean of their past inputs; states stay as they are."""
    found, n = columns.copy(), len(delays.inputs)
    found[:n] -= columns[:n].mean(axis=0)
    return found


def along(basis: FloatArray, run: Run, delays: Delays) -> Run:
    """The run with its regressors along a basis as states, NaN where they are not known.

    Parameters
    ----------
    basis : ndarray, shape (n_regressors, n_directions)
    run : Run
    delays : Delays
        Of the run as it is; those of the result are ``Delays((), n_states=n_directions)``.
    """
    states = np.full((basis.shape[1], run.x.size), np.nan)
    for first, last in segments(run, delays):
        for start in range(first, last, _BLOCK):
            stop = min(start + _BLOCK, last)
            states[:, start:stop] = basis.T @ regressors(run, delays, start, stop)
    return replace(run, states=states)
