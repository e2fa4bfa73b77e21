"""Networks of Gaussian radial basis functions (B.5–B.7): plain, and normalised.

Σ⁻¹ = I throughout. Of both the derivative by the centre of neuron i is a number times (φ − c_i), and the
outputs are linear in the weights.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sloshlab.reduced_order_model.array_backend import Array
from sloshlab.reduced_order_model.networks.delay_line_sums import SHORTEST_LINE, DelayLineSums
from sloshlab.reduced_order_model.networks.network import NormalSumsSoFar, positive_integer
from sloshlab.reduced_order_model.networks.pair_sums import PairSums

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

    @classmethod
    def of_settings(cls, settings: Mapping[str, Any]) -> Self:
        """See `Network`."""
        n_inputs = positive_integer("inputs", settings.get("n_inputs"))
        return cls(n_inputs, positive_integer("neurons", settings.get("n_neurons")))

    def initial(self, regressors: FloatArray, outputs: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Centres at samples that lie far from each other (k-means++), weights the outputs there."""
        chosen = _scattered(regressors, self.n_neurons, rng)
        # a start that already says what was measured there; the weights are solved for in the first step anyway
        weights = outputs[chosen]
        offset = np.zeros(int(self.has_offset))
        return np.concatenate([regressors[:, chosen].T.ravel(), offset, weights])

    def parts(self, xp: Any, theta: Array) -> tuple[Array, Array]:
        """Centres, shape (n_neurons, n_inputs), and linear parameters."""
        n = self.n_neurons * self.n_inputs
        return xp.reshape(theta[:n], (self.n_neurons, self.n_inputs)), theta[n:]

    def along(self, n_directions: int) -> Self:
        """The network of so many regressors, with as many neurons."""
        return replace(self, n_inputs=n_directions)

    def lifted(self, theta: FloatArray, basis: FloatArray) -> FloatArray:
        """Parameters for all regressors out of those along a basis, shape (n_inputs, n_directions).

        Distances stay the same but for what lies across the basis, which all centres have in common.
        """
        centres, linear = self.along(basis.shape[1]).parts(np, theta)
        return np.concatenate([(centres @ basis.T).ravel(), linear])

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

    def squares_and_gradient(self, xp: Any, theta: Array, phi: Array, target: Array) -> tuple[float, Array]:
        """Return Σ e² and its derivative by θ, without the Jacobian."""
        centres, _ = self.parts(xp, theta)
        features, output, factors = self.evaluated(xp, theta, phi)
        error = output - target
        weighted = factors * error[None, :]
        by_centres = weighted @ phi.T - xp.sum(weighted, axis=1)[:, None] * centres
        gradient = xp.concat([xp.reshape(by_centres, (-1,)), features @ error])
        return float(xp.sum(error * error)), 2 * gradient

    def input_gradient(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return ∂ŷ/∂φ, shape (n_inputs, m): moving the sample is moving all centres the other way."""
        centres, _ = self.parts(xp, theta)
        _, _, factors = self.evaluated(xp, theta, phi)
        return centres.T @ factors - phi * xp.sum(factors, axis=0)[None, :]

    def normal_sums(self, xp: Any, theta: Array, *, is_delay_line: bool = False) -> NormalSumsSoFar:
        """Return an empty sum; it needs no Jacobian."""
        if is_delay_line and self.n_inputs >= SHORTEST_LINE:
            return DelayLineSums(xp, self, theta)
        return PairSums(xp, self, theta)


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
        # ‖φ‖² is common to all neurons and cancels in the shares; left out, it costs no digits
        exponents = (2 * centres) @ phi
        # in place: fresh memory for every step of this costs a third of it
        exponents -= xp.sum(centres * centres, axis=1)[:, None]
        exponents -= xp.max(exponents, axis=0)[None, :]
        shares = xp.exp(exponents)
        shares /= xp.sum(shares, axis=0)[None, :]
        return shares

    def _centre_factors(self, xp: Any, linear: Array, features: Array, output: Array) -> Array:
        # derivative of a share: moving one centre takes from all others
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


def _scattered(regressors: FloatArray, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices of samples, each drawn with a chance that grows with its distance from those before."""
    m = regressors.shape[1]
    chosen = [int(rng.integers(m))]
    nearest = np.full(m, np.inf)
    for _ in range(n - 1):
        distance = np.sum((regressors - regressors[:, chosen[-1], None]) ** 2, axis=0)
        nearest = np.minimum(nearest, distance)
        total = nearest.sum()
        # k-means++: centres drawn evenly would crowd where the slow run stays long
        chosen.append(int(rng.choice(m, p=nearest / total)) if total > 0 else int(rng.integers(m)))
    return np.array(chosen)
