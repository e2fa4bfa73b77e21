"""A model with feedback running free, sample by sample, with the sensitivities that training it needs.

y(k) depends on earlier ŷ, so nothing can be done for all samples at once; this is compiled. The derivative of
ŷ(k) by the parameters follows from ∂g/∂θ and from the derivatives of the ŷ that are fed back (real-time
recurrent learning, Williams & Zipser 1989).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
NORMALISED, PLAIN = 0, 1


class FeedbackModel(NamedTuple):
    """A radial basis network with its delay lines, as the compiled loops take it."""

    kind: int  # NORMALISED or PLAIN
    theta: FloatArray  # (n_parameters,)
    n_neurons: int
    input_delays: IntArray
    output_delays: IntArray
    bound: float  # of |ŷ|, beyond which it runs away


class Stretch(NamedTuple):
    """Samples `first` … `last` − 1 of a run, for which all regressors are known."""

    first: int
    last: int


class SensitivitySums(NamedTuple):
    """Sums over the samples of the sensitivities S = ∂ŷ/∂θ and errors e, added to in place."""

    matrix: FloatArray  # Σ S Sᵀ, the lower triangle
    gradient: FloatArray  # Σ S e


# distances are summed in any order, so that several differences are squared at once: 3e-16 of the output
@njit(cache=True, fastmath={"reassoc"})
def evaluate(kind, theta, phi, features, factors):  # type: ignore[no-untyped-def]
    """Output of a radial basis network for one sample; fills features (n_neurons) and G (n_neurons)."""
    p, m = phi.size, features.size
    largest = -1e300
    for i in range(m):
        squared = 0.0
        for a in range(p):
            # Σ⁻¹ = I: the spread of the neurons is that of the scaled regressors
            difference = phi[a] - theta[i * p + a]
            squared += difference * difference
        features[i] = -squared
        largest = max(largest, -squared)
    total = 0.0
    for i in range(m):
        # shares are ratios: relative to the nearest centre, far from all of them they would be 0/0
        features[i] = np.exp(features[i] - (largest if kind == NORMALISED else 0.0))
        total += features[i]
    offset = 0 if kind == NORMALISED else 1
    output = 0.0 if kind == NORMALISED else theta[m * p]
    for i in range(m):
        if kind == NORMALISED:
            features[i] /= total
        output += theta[m * p + offset + i] * features[i]
    for i in range(m):
        weight = theta[m * p + offset + i]
        factors[i] = 2 * features[i] * (weight - output if kind == NORMALISED else weight)
    return output


@njit(cache=True)
def fill_regressors(model, x, y, k, phi):  # type: ignore[no-untyped-def]
    """Write φ(k) into `phi`; y may hold model outputs."""
    n = model.input_delays.size
    for a in range(n):
        phi[a] = x[k - model.input_delays[a]]
    for b in range(model.output_delays.size):
        phi[n + b] = y[k - model.output_delays[b]]


@njit(cache=True)
def run_free(model, x, y, stretch):  # type: ignore[no-untyped-def]
    """Overwrite y of the stretch with the model's own outputs; return how far it got before |ŷ| > bound."""
    # arrays are taken out of the tuple before the loop: each access counts a reference up and down
    kind, theta, m, bound = model.kind, model.theta, model.n_neurons, model.bound
    phi = np.empty(model.input_delays.size + model.output_delays.size)
    features, factors = np.empty(m), np.empty(m)
    for k in range(stretch.first, stretch.last):
        fill_regressors(model, x, y, k, phi)
        y[k] = evaluate(kind, theta, phi, features, factors)
        # written so that NaN is caught, too
        if not abs(y[k]) <= bound:
            return k
    return stretch.last


@njit(cache=True)
def free_run_sums(model, x, y, stretch, sums):  # type: ignore[no-untyped-def]
    """Add to the sums what the errors of a free run over a stretch give; return Σ e², infinite if it runs away."""
    theta, m, output_delays = model.theta, model.n_neurons, model.output_delays
    matrix, gradient = sums.matrix, sums.gradient
    n_in, n_out = model.input_delays.size, output_delays.size
    p, n_theta = n_in + n_out, theta.size
    offset = 0 if model.kind == NORMALISED else 1
    longest = 0
    for b in range(n_out):
        longest = max(longest, output_delays[b])
    # only as many past sensitivities as are fed back; all of them would be samples times parameters
    history = np.zeros((longest + 1, n_theta))
    free = y.copy()
    phi, features, factors, slope = np.empty(p), np.empty(m), np.empty(m), np.empty(n_out)
    squares = 0.0
    for k in range(stretch.first, stretch.last):
        fill_regressors(model, x, free, k, phi)
        free[k] = evaluate(model.kind, theta, phi, features, factors)
        if not abs(free[k]) <= model.bound:
            return np.inf
        # sensitivities of as many past outputs as are fed back, in a ring
        now = history[k % (longest + 1)]
        for b in range(n_out):
            slope[b] = 0.0
            for i in range(m):
                slope[b] -= factors[i] * (phi[n_in + b] - theta[i * p + n_in + b])
        for i in range(m):
            for a in range(p):
                now[i * p + a] = factors[i] * (phi[a] - theta[i * p + a])
            now[m * p + offset + i] = features[i]
        if offset:
            now[m * p] = 1.0
        for b in range(n_out):
            before = history[(k - output_delays[b]) % (longest + 1)]
            if k - output_delays[b] >= stretch.first:  # measured outputs before it depend on no parameter
                for j in range(n_theta):
                    now[j] += slope[b] * before[j]
        error = y[k] - free[k]
        squares += error * error
        for j in range(n_theta):
            gradient[j] += error * now[j]
            # half of a symmetric matrix; the caller mirrors it
            for i in range(j + 1):
                matrix[j, i] += now[j] * now[i]
    return squares


def kind_of(network: Any) -> int:
    """Return the number of a radial basis network for the compiled loops."""
    return PLAIN if network.has_offset else NORMALISED
