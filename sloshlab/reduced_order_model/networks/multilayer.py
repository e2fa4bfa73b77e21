"""Feedforward network of several hidden layers (Appendix C: seven of 35 neurons with radial functions)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.array_backend import Array
from sloshlab.reduced_order_model.networks.network import NormalSumsSoFar, SumsOfJacobian, positive_integer

FloatArray = NDArray[np.float64]
ACTIVATIONS: Final = ("tanh", "radial")


@dataclass(frozen=True)
class Multilayer:
    """ŷ = W_L a_{L−1} + b_L with a_l = h(W_l a_{l−1} + b_l).

    Attributes
    ----------
    n_inputs : int
    layers : tuple of int
        Neurons of the hidden layers.
    activation : {"tanh", "radial"}
        h(x): tanh x, or exp(−x²).

    Examples
    --------
    >>> network = Multilayer(1, (1,), "tanh")
    >>> theta = np.array([2.0, 0.0, 3.0, 1.0])  # 3 tanh(2 φ) + 1
    >>> network.output(np, theta, np.array([[0.0, 50.0]])).tolist()
    [1.0, 4.0]
    """

    n_inputs: int
    layers: tuple[int, ...]
    activation: str = "tanh"
    kind: ClassVar[str] = "multilayer"

    def __post_init__(self) -> None:
        if not self.layers or min(self.layers) < 1:
            raise InputError("hidden layers", got=str(self.layers), allowed="at least one neuron in each")
        if self.activation not in ACTIVATIONS:
            raise InputError("activation", got=repr(self.activation), allowed=", ".join(ACTIVATIONS))

    @property
    def _sizes(self) -> tuple[int, ...]:
        return (self.n_inputs, *self.layers, 1)

    @property
    def n_parameters(self) -> int:
        """Weights and biases, layer by layer."""
        return sum((before + 1) * after for before, after in zip(self._sizes, self._sizes[1:], strict=False))

    @property
    def n_linear(self) -> int:
        """Weights and bias of the output."""
        return self.layers[-1] + 1

    def settings(self) -> dict[str, int | str]:
        """Return what makes it again."""
        return {
            "n_inputs": self.n_inputs,
            "layers": " ".join(str(size) for size in self.layers),
            "activation": self.activation,
        }

    @classmethod
    def of_settings(cls, settings: Mapping[str, Any]) -> Self:
        """See `Network`."""
        n_inputs = positive_integer("inputs", settings.get("n_inputs"))
        layers = tuple(positive_integer("neurons", size) for size in str(settings.get("layers", "")).split())
        return cls(n_inputs, layers, str(settings.get("activation", "tanh")))

    def initial(self, regressors: FloatArray, outputs: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Random weights that neither saturate nor vanish, whatever the number of inputs."""
        parts = []
        for before, after in zip(self._sizes[:-1], self._sizes[1:], strict=True):
            # sums of n inputs have √n of their size
            parts += [rng.normal(size=before * after) / np.sqrt(before), rng.normal(scale=0.5, size=after)]
        return np.concatenate(parts)

    def _weights(self, xp: Any, theta: Array) -> list[tuple[Array, Array]]:
        found, place = [], 0
        for before, after in zip(self._sizes[:-1], self._sizes[1:], strict=True):
            matrix = xp.reshape(theta[place : place + before * after], (after, before))
            place += before * after
            found.append((matrix, theta[place : place + after]))
            place += after
        return found

    def _forward(self, xp: Any, theta: Array, phi: Array) -> tuple[list[Array], list[Array]]:
        """Values of all layers, inputs first, and slopes of the hidden ones."""
        values, slopes = [phi], []
        weights = self._weights(xp, theta)
        for matrix, bias in weights[:-1]:
            excited = matrix @ values[-1] + bias[:, None]
            if self.activation == "tanh":
                values.append(xp.tanh(excited))
                slopes.append(1 - values[-1] * values[-1])
            else:
                values.append(xp.exp(-excited * excited))
                slopes.append(-2 * excited * values[-1])
        return values, slopes

    def linear_features(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return the last hidden layer and 1, shape (n_linear, m)."""
        values, _ = self._forward(xp, theta, phi)
        return xp.concat([values[-1], xp.ones_like(values[-1][:1, :])], axis=0)

    def output(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return ŷ, shape (m,)."""
        return theta[-self.n_linear :] @ self.linear_features(xp, theta, phi)

    def _sensitivities(self, xp: Any, theta: Array, slopes: list[Array]) -> list[Array]:
        """∂ŷ/∂(W a + b) of the hidden layers, first layer first."""
        weights = self._weights(xp, theta)
        # backwards from the output: one pass gives ∂ŷ/∂θ for all layers
        found = [weights[-1][0].T * slopes[-1]]
        for (matrix, _), slope in zip(weights[-2:0:-1], slopes[-2::-1], strict=True):
            found.append((matrix.T @ found[-1]) * slope)
        return found[::-1]

    def jacobian(self, xp: Any, theta: Array, phi: Array) -> tuple[Array, Array]:
        """Return ŷ and ∂ŷ/∂θ, shape (n_parameters, m)."""
        values, slopes = self._forward(xp, theta, phi)
        features = xp.concat([values[-1], xp.ones_like(values[-1][:1, :])], axis=0)
        rows = []
        for sensitivity, before in zip(self._sensitivities(xp, theta, slopes), values[:-1], strict=True):
            rows.append(xp.reshape(sensitivity[:, None, :] * before[None, :, :], (-1, phi.shape[1])))
            rows.append(sensitivity)
        return theta[-self.n_linear :] @ features, xp.concat([*rows, features], axis=0)

    def squares_and_gradient(self, xp: Any, theta: Array, phi: Array, target: Array) -> tuple[float, Array]:
        """Return Σ e² and its derivative by θ, by one pass backwards and without the Jacobian."""
        values, slopes = self._forward(xp, theta, phi)
        weights = self._weights(xp, theta)
        error = (weights[-1][0] @ values[-1])[0, :] + weights[-1][1] - target
        excess, parts = 2 * error[None, :], list[Array]()
        for layer in range(len(weights) - 1, -1, -1):
            by_matrix = xp.reshape(excess @ values[layer].T, (-1,))
            parts = [by_matrix, xp.sum(excess, axis=1), *parts]
            if layer:
                excess = (weights[layer][0].T @ excess) * slopes[layer - 1]
        return float(xp.sum(error * error)), xp.concat(parts)

    def input_gradient(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return ∂ŷ/∂φ, shape (n_inputs, m)."""
        _, slopes = self._forward(xp, theta, phi)
        first, _ = self._weights(xp, theta)[0]
        return first.T @ self._sensitivities(xp, theta, slopes)[0]

    def normal_sums(self, xp: Any, theta: Array, *, is_delay_line: bool = False) -> NormalSumsSoFar:
        """Return an empty sum."""
        return SumsOfJacobian(xp, self, theta)
