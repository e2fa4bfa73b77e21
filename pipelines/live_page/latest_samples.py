"""The last seconds of one source, sample by sample, in their places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class LatestSamples:
    """A ring of values; what did not arrive is NaN.

    Parameters
    ----------
    n_samples, n_channels : int
    """

    def __init__(self, n_samples: int, n_channels: int) -> None:
        self._values = np.full((n_samples, n_channels), np.nan, np.float32)
        self.end = 0

    def put(self, place: int, values: NDArray[np.floating], members: Sequence[int]) -> None:
        """Values of channels `members`, shape (n, n_members), the first at `place`."""
        n_kept = len(self._values)
        end = place + len(values)
        if end > self.end:
            n_new = min(end - self.end, n_kept)
            self._values[np.arange(end - n_new, end) % n_kept] = np.nan
            self.end = end
        skipped = max(0, self.end - n_kept - place)
        if skipped < len(values):
            rows = np.arange(place + skipped, end) % n_kept
            self._values[rows[:, np.newaxis], np.asarray(members)] = values[skipped:]

    def last(self, n_samples: int, channels: Sequence[int]) -> tuple[int, FloatArray]:
        """Place of the first and the values of the last samples that all channels have, (n, n_channels), a copy.

        Messages of a CAN device do not arrive together: places at the end that only some have are left out.
        """
        n = min(n_samples, len(self._values), self.end)
        rows = np.arange(self.end - n, self.end) % len(self._values)
        values = self._values[rows[:, np.newaxis], np.asarray(channels)].astype(np.float64)
        seen = np.flatnonzero(np.isfinite(values).all(axis=1))
        n_complete = int(seen[-1]) + 1 if seen.size else 0
        return self.end - n, values[:n_complete]
