"""Networks of Gaussian radial basis functions (B.5–B.7): plain, and normalised.

Σ⁻¹ = I throughout. Of both the derivative by the centre of neuron i is a number times (φ − c_i), and the
outputs are linear in the weights. The matrix Σ J Jᵀ is then made of Σ G_i G_j φ̃ φ̃ᵀ with φ̃ = (φ, 1), one
product of two matrices whose rows are products of pairs: half the work of the symmetric product of the
Jacobian, a quarter of the full one.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from array_api_compat import device
from numpy.typing import NDArray

from sloshlab.reduced_order_model.array_backend import Array
from sloshlab.reduced_order_model.networks.network import NormalSums, NormalSumsSoFar

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class _RadialBasisNetwork:
    """What both have in common.

    Attributes
    ----------
    n_inputs, n_neurons : int
    """

    n_inputs: int
    n_neurons: int
    kind: ClassVar[str] = ""
    has_offset: ClassVar[bool] = False

    @property
    def n_linear(self) -> int:
        """Output weights."""
        return self.n_neurons + self.has_offset

    @property
    def n_parameters(self) -> int:
        """Coordinates of the centres, then output weights."""
        return self.n_neurons * self.n_inputs + self.n_linear

    def settings(self) -> dict[str, int | str]:
        """Return what makes it again."""
        return {"n_inputs": self.n_inputs, "n_neurons": self.n_neurons}

    def initial(self, regressors: FloatArray, outputs: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Centres at samples that lie far from each other (k-means++), weights the outputs there."""
        chosen = _scattered(regressors, self.n_neurons, rng)
        weights = outputs[chosen]
        offset = np.zeros(int(self.has_offset))
        return np.concatenate([regressors[:, chosen].T.ravel(), offset, weights])

    def parts(self, xp: Any, theta: Array) -> tuple[Array, Array]:
        """Centres, shape (n_neurons, n_inputs), and linear parameters."""
        n = self.n_neurons * self.n_inputs
        return xp.reshape(theta[:n], (self.n_neurons, self.n_inputs)), theta[n:]

    @abstractmethod
    def linear_features(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return what the weights weight, shape (n_linear, m)."""

    @abstractmethod
    def _centre_factors(self, xp: Any, linear: Array, features: Array, output: Array) -> Array:
        """G: ∂ŷ/∂c_i = G_i (φ − c_i); shape (n_neurons, m)."""

    def output(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return ŷ, shape (m,)."""
        return self.parts(xp, theta)[1] @ self.linear_features(xp, theta, phi)

    def evaluated(self, xp: Any, theta: Array, phi: Array) -> tuple[Array, Array, Array]:
        """Return features, ŷ, and G with ∂ŷ/∂c_i = G_i (φ − c_i)."""
        _, linear = self.parts(xp, theta)
        features = self.linear_features(xp, theta, phi)
        output = linear @ features
        return features, output, self._centre_factors(xp, linear, features, output)

    def jacobian(self, xp: Any, theta: Array, phi: Array) -> tuple[Array, Array]:
        """Return ŷ and ∂ŷ/∂θ, shape (n_parameters, m)."""
        centres, _ = self.parts(xp, theta)
        features, output, factors = self.evaluated(xp, theta, phi)
        by_centres = factors[:, None, :] * (phi[None, :, :] - centres[:, :, None])
        rows = xp.reshape(by_centres, (self.n_neurons * self.n_inputs, phi.shape[1]))
        return output, xp.concat([rows, features], axis=0)

    def input_gradient(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return ∂ŷ/∂φ, shape (n_inputs, m): moving the sample is moving all centres the other way."""
        centres, _ = self.parts(xp, theta)
        _, _, factors = self.evaluated(xp, theta, phi)
        return centres.T @ factors - phi * xp.sum(factors, axis=0)[None, :]

    def normal_sums(self, xp: Any, theta: Array) -> NormalSumsSoFar:
        """Return an empty sum; it needs no Jacobian."""
        return _PairSums(xp, self, theta)


class NormalisedRadialBasis(_RadialBasisNetwork):
    """ŷ = Σ w_i Φ_i / Σ Φ_j with Φ_i = exp(−‖φ − c_i‖²) (B.7).

    ‖φ‖² cancels, and the exponents are shifted by the largest, so that samples far from every centre take the
    weight of the nearest instead of 0/0.

    Examples
    --------
    >>> network = NormalisedRadialBasis(n_inputs=1, n_neurons=2)
    >>> theta = np.array([-1.0, 1.0, 3.0, 5.0])
    >>> network.output(np, theta, np.array([[-40.0, 0.0, 40.0]])).tolist()
    [3.0, 4.0, 5.0]
    """

    kind = "normalised_rbf"

    def linear_features(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return shares of the neurons, shape (n_neurons, m), of which each column sums to 1."""
        centres, _ = self.parts(xp, theta)
        exponents = 2 * (centres @ phi) - xp.sum(centres * centres, axis=1)[:, None]
        shares = xp.exp(exponents - xp.max(exponents, axis=0)[None, :])
        return shares / xp.sum(shares, axis=0)[None, :]

    def _centre_factors(self, xp: Any, linear: Array, features: Array, output: Array) -> Array:
        return 2 * features * (linear[:, None] - output[None, :])


class RadialBasis(_RadialBasisNetwork):
    """ŷ = w₀ + Σ w_i exp(−‖φ − c_i‖²) (B.6).

    Examples
    --------
    >>> network = RadialBasis(n_inputs=1, n_neurons=1)
    >>> network.output(np, np.array([0.5, 1.0, 2.0]), np.array([[0.5, 50.0]])).tolist()
    [3.0, 1.0]
    """

    kind = "rbf"
    has_offset = True

    def linear_features(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return 1 and the basis functions, shape (1 + n_neurons, m)."""
        centres, _ = self.parts(xp, theta)
        squared = (
            xp.sum(centres * centres, axis=1)[:, None] - 2 * (centres @ phi) + xp.sum(phi * phi, axis=0)[None, :]
        )
        return xp.concat([xp.ones_like(phi[:1, :]), xp.exp(-squared)], axis=0)

    def _centre_factors(self, xp: Any, linear: Array, features: Array, output: Array) -> Array:
        return 2 * features[1:, :] * linear[1:, None]


class _PairSums:
    """Σ J Jᵀ from products of pairs; the samples are gone through once, the matrix is made at the end.

    Parameters
    ----------
    xp : module
    network : NormalisedRadialBasis or RadialBasis
    theta : array
    """

    def __init__(self, xp: Any, network: _RadialBasisNetwork, theta: Array) -> None:
        self._xp, self._network, self._theta = xp, network, theta
        self._neurons = [xp.asarray(part, device=device(theta)) for part in np.triu_indices(network.n_neurons)]
        self._inputs = [xp.asarray(part, device=device(theta)) for part in np.triu_indices(network.n_inputs + 1)]
        self._second: Array = 0.0  # Σ G_i G_j φ̃_a φ̃_b
        self._mixed: Array = 0.0  # Σ Φ_i G_j φ̃_a
        self._weights: Array = 0.0  # Σ Φ_i Φ_j
        self._by_centre: Array = 0.0  # Σ e G_i φ̃_a
        self._by_weight: Array = 0.0  # Σ e Φ_i
        self._squares = 0.0

    def add(self, phi: Array, target: Array) -> None:
        """Take some samples."""
        xp = self._xp
        features, output, factors = self._network.evaluated(xp, self._theta, phi)
        error = target - output
        extended = xp.concat([phi, xp.ones_like(phi[:1, :])], axis=0)
        self._second = self._second + _pair_products(xp, factors, self._neurons) @ (
            _pair_products(xp, extended, self._inputs).T
        )
        crossed = xp.reshape(features[:, None, :] * factors[None, :, :], (-1, phi.shape[1]))
        self._mixed = self._mixed + crossed @ extended.T
        self._weights = self._weights + features @ features.T
        self._by_centre = self._by_centre + (factors * error[None, :]) @ extended.T
        self._by_weight = self._by_weight + features @ error
        self._squares += float(xp.sum(error * error))

    def sums(self) -> NormalSums:
        """Return the sums."""
        xp = self._xp
        centres, _ = self._network.parts(xp, self._theta)
        mixed = self._mixed_block(centres)
        upper = xp.concat([self._centre_block(centres), mixed.T], axis=1)
        matrix = xp.concat([upper, xp.concat([mixed, self._weights], axis=1)], axis=0)
        by_centre = self._by_centre[:, :-1] - centres * self._by_centre[:, -1:]
        gradient = xp.concat([xp.reshape(by_centre, (-1,)), self._by_weight])
        return NormalSums(matrix, gradient, self._squares)

    def _centre_block(self, centres: Array) -> Array:
        """Σ G_i G_j (φ − c_i)(φ − c_j)ᵀ for all pairs of neurons."""
        xp, (m, p) = self._xp, centres.shape
        moments = xp.take(self._second, xp.asarray(_places(m), device=device(centres)), axis=0)
        moments = xp.take(moments, xp.asarray(_places(p + 1), device=device(centres)), axis=1)
        moments = xp.reshape(moments, (m, m, p + 1, p + 1))
        second, first, zeroth = moments[:, :, :-1, :-1], moments[:, :, :-1, -1], moments[:, :, -1, -1]
        block = (
            second
            - first[:, :, :, None] * centres[None, :, None, :]
            - centres[:, None, :, None] * first[:, :, None, :]
            + zeroth[:, :, None, None] * centres[:, None, :, None] * centres[None, :, None, :]
        )
        return xp.reshape(xp.permute_dims(block, (0, 2, 1, 3)), (m * p, m * p))

    def _mixed_block(self, centres: Array) -> Array:
        """Σ Φ_i G_j (φ − c_j); rows are linear parameters, columns coordinates of the centres."""
        xp, (m, p) = self._xp, centres.shape
        moments = xp.reshape(self._mixed, (-1, m, p + 1))
        return xp.reshape(moments[:, :, :-1] - moments[:, :, -1:] * centres[None, :, :], (-1, m * p))


def _pair_products(xp: Any, rows: Array, pairs: list[Array]) -> Array:
    return xp.take(rows, pairs[0], axis=0) * xp.take(rows, pairs[1], axis=0)


def _places(n: int) -> NDArray[np.int64]:
    """Where element (i, j) of a symmetric matrix, row by row, stands among its upper triangle."""
    places = np.zeros((n, n), np.int64)
    places[np.triu_indices(n)] = np.arange(n * (n + 1) // 2)
    return np.maximum(places, places.T).ravel()


def _scattered(regressors: FloatArray, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices of samples, each drawn with a chance that grows with its distance from those before."""
    m = regressors.shape[1]
    chosen = [int(rng.integers(m))]
    nearest = np.full(m, np.inf)
    for _ in range(n - 1):
        distance = np.sum((regressors - regressors[:, chosen[-1], None]) ** 2, axis=0)
        nearest = np.minimum(nearest, distance)
        total = nearest.sum()
        chosen.append(int(rng.choice(m, p=nearest / total)) if total > 0 else int(rng.integers(m)))
    return np.array(chosen)
