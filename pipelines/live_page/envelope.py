"""Envelopes: the lowest and the highest value in each of many short spans, so that no peak is left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

COLUMNS: Final = 600
"""Spans of a window: about as many as a curve has pixels."""

FloatArray = NDArray[np.float64]


class Envelope:
    """Lowest and highest values of the last part of a signal.

    Column c holds places ``c * n_per_column`` … ``(c + 1) * n_per_column - 1``. What was not seen is NaN.

    Parameters
    ----------
    n_channels : int
    n_per_column : int
        Samples of a column.
    n_columns : int
        Kept; older ones are forgotten.
    """

    def __init__(self, n_channels: int, n_per_column: int, n_columns: int = COLUMNS) -> None:
        self.n_per_column, self.n_columns = n_per_column, n_columns
        self.newest = -1
        self._low = np.full((n_columns, n_channels), np.nan)
        self._high = np.full((n_columns, n_channels), np.nan)

    def update(self, place: int, values: FloatArray, members: Sequence[int]) -> None:
        """Take values into account, shape (n_samples, n_members), the first of them at `place`.

        Parameters
        ----------
        place : int
            ≥ 0; late values are as good as others while their column is kept.
        values : ndarray
            NaN where there is no reading.
        members : sequence of int
            Channels that the columns of `values` belong to.
        """
        if not len(values):
            return
        last = (place + len(values) - 1) // self.n_per_column
        self._forget_up_to(last)
        oldest = max(0, self.newest - self.n_columns + 1)
        skipped = max(0, oldest * self.n_per_column - place)
        values, place = values[skipped:], place + skipped
        if not len(values):
            return
        columns = np.arange(place // self.n_per_column, last + 1)
        starts = np.maximum(columns * self.n_per_column - place, 0)
        rows = (columns % self.n_columns)[:, np.newaxis], np.asarray(members)
        # fmin and fmax pass over NaN, which is no reading and no value
        self._low[rows] = np.fmin(self._low[rows], np.fmin.reduceat(values, starts, axis=0))
        self._high[rows] = np.fmax(self._high[rows], np.fmax.reduceat(values, starts, axis=0))

    def since(self, column: int) -> tuple[int, FloatArray, FloatArray]:
        """First column kept from `column` on; lowest and highest values from there, (n_columns, n_channels)."""
        first = max(column, self.newest - self.n_columns + 1, 0)
        rows = np.arange(first, self.newest + 1) % self.n_columns
        return first, self._low[rows], self._high[rows]

    def _forget_up_to(self, column: int) -> None:
        if column <= self.newest:
            return
        n_new = min(column - self.newest, self.n_columns)
        rows = np.arange(column - n_new + 1, column + 1) % self.n_columns
        self._low[rows], self._high[rows] = np.nan, np.nan
        self.newest = column
