"""What training asks of a network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.array_backend import Array

FloatArray = NDArray[np.float64]
LARGEST_PARAMETERS: Final = 12_000
"""The matrix of the least-squares problem has this many rows: 1.2 GB."""


@dataclass(frozen=True)
class NormalSums:
    """Sums of the least-squares problem J Δθ ≈ e over some samples, e = target − output.

    Attributes
    ----------
    matrix : array, shape (n_parameters, n_parameters)
        Σ J Jᵀ.
    gradient : array, shape (n_parameters,)
        Σ J e.
    squares : float
        Σ e².
    scale : array, shape (n_parameters,), optional
        By which parameters are damped; the diagonal of the matrix if not given.
    """

    matrix: Array
    gradient: Array
    squares: float
    scale: Array | None = None


class NormalSumsSoFar(Protocol):
    """Takes block after block of samples at one θ, and gives the sums of all."""

    def add(self, phi: Array, target: Array) -> None:
        """Take regressors, shape (n_inputs, m), and wanted outputs, shape (m,)."""
        ...

    def sums(self) -> NormalSums:
        """Return the sums of all that was added."""
        ...


class Network(Protocol):
    """A static map from regressors to one output.

    Parameters are one vector θ; regressors φ have one column per sample. What enters linearly comes last in
    θ, so that it can be solved for.
    """

    kind: ClassVar[str]

    @property
    def n_inputs(self) -> int:
        """Length of φ."""
        ...

    @property
    def n_parameters(self) -> int:
        """Length of θ."""
        ...

    @property
    def n_linear(self) -> int:
        """How many of the last parameters enter linearly."""
        ...

    def initial(self, regressors: FloatArray, outputs: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return parameters to start from, given some samples."""
        ...

    def output(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return outputs, shape (m,), of regressors, shape (n_inputs, m)."""
        ...

    def linear_features(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return what the linear parameters weight, shape (n_linear, m)."""
        ...

    def jacobian(self, xp: Any, theta: Array, phi: Array) -> tuple[Array, Array]:
        """Return outputs, shape (m,), and their derivatives, shape (n_parameters, m)."""
        ...

    def squares_and_gradient(self, xp: Any, theta: Array, phi: Array, target: Array) -> tuple[float, Array]:
        """Return Σ e² of wanted outputs, shape (m,), and its derivative by θ, shape (n_parameters,)."""
        ...

    def input_gradient(self, xp: Any, theta: Array, phi: Array) -> Array:
        """Return the derivatives of the outputs by the regressors, shape (n_inputs, m)."""
        ...

    def normal_sums(self, xp: Any, theta: Array, *, is_delay_line: bool = False) -> NormalSumsSoFar:
        """Return an empty sum for these parameters.

        `is_delay_line` promises that within a block φ_a(k) = φ_0(k − a): past values of one signal, in order.
        """
        ...

    def settings(self) -> dict[str, int | str]:
        """Return what `of_settings` needs to make it again."""
        ...

    @classmethod
    def of_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Make the network from what `settings` gave, or a person did.

        Raises
        ------
        InputError
            If a setting is missing or impossible.
        """
        ...


def positive_integer(what: str, value: object) -> int:
    """A size of a network, checked; `what` it is of is for the message."""
    try:
        number = int(str(value))
    except ValueError:
        number = 0
    if not 1 <= number <= LARGEST_PARAMETERS:
        raise InputError(f"network: {what}", got=repr(value), allowed=f"a whole number 1 … {LARGEST_PARAMETERS}")
    return number


class SumsOfJacobian:
    """The sums by way of the whole Jacobian; works for every network.

    Parameters
    ----------
    xp : module
    network : Network
    theta : array
    """

    def __init__(self, xp: Any, network: Network, theta: Array) -> None:
        self._xp, self._network, self._theta = xp, network, theta
        self._matrix: Array = 0.0
        self._gradient: Array = 0.0
        self._squares = 0.0

    def add(self, phi: Array, target: Array) -> None:
        """Take some samples."""
        output, jacobian = self._network.jacobian(self._xp, self._theta, phi)
        error = target - output
        # it begins as the number 0, so that library and device are those of the first block
        self._matrix = self._matrix + jacobian @ jacobian.T
        self._gradient = self._gradient + jacobian @ error
        self._squares += float(self._xp.sum(error * error))

    def sums(self) -> NormalSums:
        """Return the sums."""
        return NormalSums(self._matrix, self._gradient, self._squares)
