"""Whether the half wave that a network has just seen crosses zero."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def lacks_crossing(values: FloatArray) -> NDArray[np.bool_]:
    """Whether the last half wave, from one extreme to the next, has no change of sign, at every sample.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN counts as zero.

    Returns
    -------
    ndarray of bool, shape (n,)
        Of the half wave that holds the sample before; False before the first and behind the last extreme.

    Examples
    --------
    >>> lacks_crossing(np.array([0.0, 2.0, 1.0, 3.0, -1.0, 0.0])).tolist()
    [False, False, True, True, False, False]
    """
    known = np.nan_to_num(values)
    slope = np.diff(known)
    turns = np.flatnonzero(slope[1:] * slope[:-1] < 0) + 1
    found = np.zeros(known.size, bool)
    for first, last in itertools.pairwise(turns):
        # a sample later, as the model sees it
        found[first + 1 : last + 1] = known[first] * known[last] > 0
    return found
