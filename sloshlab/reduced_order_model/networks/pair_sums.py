"""Σ J Jᵀ of radial basis networks without a Jacobian.

∂ŷ/∂c_i = G_i (φ − c_i), and features Φ are the derivatives by the weights. The matrix is then made of
Σ G_i G_j φ̃ φ̃ᵀ with φ̃ = (φ, 1): one product of two matrices whose rows are products of pairs, half the work of
the symmetric product of the Jacobian, a quarter of the full one.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
from array_api_compat import device
from numpy.typing import NDArray

from sloshlab.reduced_order_model.array_backend import Array
from sloshlab.reduced_order_model.networks.network import NormalSums

_AT_ONCE: Final = 512
"""Samples; with more, the rows of the Jacobian leave the cache."""


class CentredNetwork(Protocol):
    """What these sums ask of a network."""

    @property
    def n_inputs(self) -> int:
        """Length of φ."""
        ...

    @property
    def n_neurons(self) -> int:
        """How many centres."""
        ...

    def parts(self, xp: Any, theta: Array) -> tuple[Array, Array]:
        """Centres, shape (n_neurons, n_inputs), and linear parameters."""
        ...

    def evaluated(self, xp: Any, theta: Array, phi: Array) -> tuple[Array, Array, Array]:
        """Return features Φ, ŷ, and G with ∂ŷ/∂c_i = G_i (φ − c_i)."""
        ...


class PairSums:
    """The samples are gone through once, the matrix is made at the end.

    Parameters
    ----------
    xp : module
    network : CentredNetwork
    theta : array
    """

    def __init__(self, xp: Any, network: CentredNetwork, theta: Array) -> None:
        self._xp, self._network, self._theta = xp, network, theta
        # rows are neurons j and coordinates a, columns neurons i, and last the error: Σ G_j φ̃_a (Φ_i, e)
        self._mixed: Array = 0.0
        self._weights: Array = 0.0  # Σ Φ_i (Φ_j, e)
        self._squares = 0.0
        self._prepare()

    def add(self, phi: Array, target: Array) -> None:
        """Take some samples."""
        xp = self._xp
        features, output, factors = self._network.evaluated(xp, self._theta, phi)
        error = target - output
        extended = xp.concat([phi, xp.ones_like(phi[:1, :])], axis=0)
        # φ̃ = (φ, 1) carries first and zeroth moments along with the second ones
        self._add_second(factors, extended)
        # the error as one more column: the gradient comes with the same product
        columns = xp.concat([features, error[None, :]], axis=0)
        for first in range(0, phi.shape[1], _AT_ONCE):
            part = slice(first, min(first + _AT_ONCE, phi.shape[1]))
            # coordinates of the centres have more rows than all pairs of neurons have columns
            rows = factors[:, None, part] * extended[None, :, part]
            self._mixed = self._mixed + xp.reshape(rows, (-1, rows.shape[2])) @ columns[:, part].T
        self._weights = self._weights + features @ columns.T
        self._squares += float(xp.sum(error * error))

    def sums(self) -> NormalSums:
        """Return the sums."""
        xp = self._xp
        centres, _ = self._network.parts(xp, self._theta)
        by_centre = self._centre_rows(centres)
        mixed = by_centre[:, :-1]
        upper = xp.concat([self._centre_block(centres), mixed], axis=1)
        matrix = xp.concat([upper, xp.concat([mixed.T, self._weights[:, :-1]], axis=1)], axis=0)
        gradient = xp.concat([by_centre[:, -1], self._weights[:, -1]])
        return NormalSums(matrix, gradient, self._squares)

    def _prepare(self) -> None:
        self._second: Array = 0.0  # Σ G_i G_j φ̃_a φ̃_b, a row per pair of neurons, a column per pair of inputs

    def _add_second(self, factors: Array, extended: Array) -> None:
        xp = self._xp
        self._second = self._second + _pair_products(xp, factors) @ _pair_products(xp, extended).T

    def _second_moments(self) -> Array:
        """Σ G_i G_j φ̃_a φ̃_b, a row per pair of neurons, a column per (a, b)."""
        xp, p = self._xp, self._network.n_inputs
        return xp.take(self._second, xp.asarray(places(p + 1), device=device(self._theta)), axis=1)

    def _centre_block(self, centres: Array) -> Array:
        """Σ G_i G_j (φ − c_i)(φ − c_j)ᵀ for all pairs of neurons."""
        xp, (m, p) = self._xp, centres.shape
        # sums over samples do not know the centres: (φ − c_i)(φ − c_j)ᵀ is expanded here, once
        moments = xp.take(self._second_moments(), xp.asarray(places(m), device=device(centres)), axis=0)
        moments = xp.reshape(moments, (m, m, p + 1, p + 1))
        second, first, zeroth = moments[:, :, :-1, :-1], moments[:, :, :-1, -1], moments[:, :, -1, -1]
        block = (
            second
            - first[:, :, :, None] * centres[None, :, None, :]
            - centres[:, None, :, None] * first[:, :, None, :]
            + zeroth[:, :, None, None] * centres[:, None, :, None] * centres[None, :, None, :]
        )
        return xp.reshape(xp.permute_dims(block, (0, 2, 1, 3)), (m * p, m * p))

    def _centre_rows(self, centres: Array) -> Array:
        """Σ G_j (φ − c_j) (Φ_i, e): a row per coordinate of a centre, a column per weight and one for e."""
        xp, (m, p) = self._xp, centres.shape
        moments = xp.reshape(self._mixed, (m, p + 1, -1))
        return xp.reshape(moments[:, :-1, :] - centres[:, :, None] * moments[:, -1:, :], (m * p, -1))


def _pair_products(xp: Any, rows: Array) -> Array:
    """Rows i ≤ j multiplied, in the order of `numpy.triu_indices`."""
    n = rows.shape[0]
    found = xp.empty((n * (n + 1) // 2, rows.shape[1]), dtype=rows.dtype, device=device(rows))
    end = 0
    for i in range(n):
        start, end = end, end + n - i
        found[start:end, :] = rows[i, :] * rows[i:, :]
    return found


def places(n: int) -> NDArray[np.int64]:
    """Where element (i, j) of a symmetric matrix, row by row, stands among its upper triangle.

    Parameters
    ----------
    n : int

    Examples
    --------
    >>> places(2).tolist()
    [0, 1, 1, 2]
    """
    found = np.zeros((n, n), np.int64)
    found[np.triu_indices(n)] = np.arange(n * (n + 1) // 2)
    return np.maximum(found, found.T).ravel()
