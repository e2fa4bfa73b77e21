"""The sums of a network whose regressors are past values of one signal: moments as correlations.

With φ_a(k) = x(k − a) the moment Σ_k W(k) x(k − a) x(k − a − d), W = G_i G_j, is the correlation of W with
z_d(k) = x(k) x(k − d) at lag a. Stretch by stretch both are transformed, their products add up in frequency, and
one inverse transform at the end gives the moments of all lags: for 70 delays a fifth of the time of the products
of pairs, and the same numbers to rounding.
"""

from __future__ import annotations

import os
from typing import Any, Final

import numpy as np
import scipy.fft
from array_api_compat import device

from sloshlab.reduced_order_model.array_backend import Array
from sloshlab.reduced_order_model.networks.pair_sums import PairSums

SHORTEST_LINE: Final = 24
"""With fewer delays products of pairs are as quick."""
_LENGTH: Final = 256


class DelayLineSums(PairSums):
    """`PairSums` for blocks in which row a of the regressors is row 0 shifted by a samples."""

    def _prepare(self) -> None:
        p = self._network.n_inputs
        # several times as long as the line, because every stretch repeats p − 1 samples of the one before
        self._length = max(_LENGTH, scipy.fft.next_fast_len(4 * p, real=True))
        self._has_samples = False
        self._spectra: Array = 0.0  # Σ F W conj(F z), shape (frequencies, pairs of neurons, p + 1)
        m = self._network.n_neurons
        self._neurons = [self._xp.asarray(part, device=device(self._theta)) for part in np.triu_indices(m)]
        self._upper = self._neurons[0] * m + self._neurons[1]
        self._zeroth: Array = 0.0  # Σ W

    def _add_second(self, factors: Array, extended: Array) -> None:
        xp, p = self._xp, self._network.n_inputs
        # overlap-save: so many samples of each transform are free of wrap-around
        n, step = factors.shape[1], self._length - p + 1
        stretches = -(-n // step)
        line = xp.concat([xp.flip(extended[:p, 0]), extended[0, 1:]])  # x of all samples, p − 1 earlier ones first
        line = self._lengthened(line[None, :], stretches * step + p - 1)[0, :]
        padded = xp.reshape(self._lengthened(factors, stretches * step), (-1, stretches, step))
        # time first: the transforms then run along memory for all pairs at once
        by_time = xp.permute_dims(padded, (2, 0, 1))
        by_time = xp.reshape(xp.reshape(by_time, (-1,)), by_time.shape)  # in this order in memory, too
        weights = xp.take(by_time, self._neurons[0], axis=1) * xp.take(by_time, self._neurons[1], axis=1)
        products = xp.stack(
            [self._products(line[s * step : (s + 1) * step + p - 1]) for s in range(stretches)], axis=1
        )
        # products of spectra are added up, and one inverse transform at the end gives all lags: linear in the
        # data
        found = self._transformed(weights) @ xp.conj(self._transformed(products))
        if self._has_samples:
            self._spectra += found
        else:
            self._spectra, self._has_samples = found, True
        self._zeroth = self._zeroth + xp.take(xp.reshape(factors @ factors.T, (-1,)), self._upper)

    def _lengthened(self, rows: Array, n: int) -> Array:
        xp = self._xp
        zeros = xp.zeros((rows.shape[0], n - rows.shape[1]), dtype=rows.dtype, device=device(rows))
        return xp.concat([rows, zeros], axis=1)

    def _products(self, line: Array) -> Array:
        """z_0 … z_{p−1} and x itself, shape (length of the transform, p + 1)."""
        xp, p = self._xp, self._network.n_inputs
        zeros = xp.zeros((p,), dtype=line.dtype, device=device(line))
        long = xp.concat([zeros, line])
        columns = [line * long[p - d : p - d + line.shape[0]] for d in range(p)]
        return xp.stack([*columns, line], axis=1)

    def _transformed(self, values: Array) -> Array:
        """Spectra along the first axis, which stays the slowest in memory."""
        if isinstance(values, np.ndarray):
            return scipy.fft.rfft(values, self._length, axis=0, workers=_n_threads())
        return self._xp.fft.rfft(values, n=self._length, axis=0)

    def _second_moments(self) -> Array:
        xp, p = self._xp, self._network.n_inputs
        correlations = xp.fft.irfft(xp.conj(self._spectra), n=self._length, axis=0)  # lag, pair, d
        rows, columns = (part.ravel() for part in np.indices((p, p)))
        # every moment of two delays depends on their difference and one lag only: p² moments from p + 1
        # transforms
        lag, difference = p - 1 - np.minimum(rows, columns), np.abs(rows - columns)
        flat = xp.reshape(xp.permute_dims(correlations[:p, :, :], (1, 0, 2)), (-1, p * (p + 1)))
        second = xp.reshape(self._taken(flat, lag * (p + 1) + difference), (-1, p, p))
        first = self._taken(flat, np.arange(p - 1, -1, -1) * (p + 1) + p)
        last = xp.concat([first, self._zeroth[:, None]], axis=1)
        return xp.reshape(
            xp.concat([xp.concat([second, first[:, :, None]], axis=2), last[:, None, :]], axis=1),
            (-1, (p + 1) ** 2),
        )

    def _taken(self, rows: Array, columns: Any) -> Array:
        return self._xp.take(rows, self._xp.asarray(columns, device=device(rows)), axis=1)


def _n_threads() -> int:
    """As many as the products of matrices have."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    # several trainings at once each get their share of the cores by this variable
    return int(wanted) if wanted.isdigit() and int(wanted) else os.cpu_count() or 1
