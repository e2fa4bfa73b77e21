"""Whether a model with feedback forgets how it was started.

Outputs of a radial basis network are bounded whatever it is fed, so a free run cannot grow without limit; it can
still keep, or blow up, a small error of the past. That is measured by the largest Lyapunov exponent along a long
run on random input: the mean rate at which two runs that differ a little come together (negative) or part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model import free_run
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis

FloatArray = NDArray[np.float64]
_SETTLING: Final = 0.1
"""Share of the run that is left out of the mean."""


@dataclass(frozen=True)
class Stability:
    """What a model does with its own past.

    Attributes
    ----------
    exponent_per_s : float
        Largest Lyapunov exponent [1/s]; −∞ without feedback.
    output_bound : float
        Largest |output| that the network can give, in the unit of the output.
    largest_output : float
        Largest |output| in the random run.
    """

    exponent_per_s: float
    output_bound: float
    largest_output: float

    @property
    def is_stable(self) -> bool:
        """Whether starts are forgotten."""
        return self.exponent_per_s < 0

    def line(self, unit: str = "") -> str:
        """Say it in one line.

        Parameters
        ----------
        unit : str
            Of the output.

        Examples
        --------
        >>> Stability(-20.0, 9.0, 4.0).line("N")
        'stability: starts are forgotten, to 1/e in 0.05 s; outputs within ±9 N, on random input ±4 N'
        """
        suffix = f" {unit}" if unit else ""
        limits = (
            f"outputs within ±{self.output_bound:.3g}{suffix}, on random input ±{self.largest_output:.3g}{suffix}"
        )
        if math.isinf(self.exponent_per_s):
            return f"stability: no feedback; {limits}"
        if self.is_stable:
            return f"stability: starts are forgotten, to 1/e in {-1 / self.exponent_per_s:.3g} s; {limits}"
        growth_s = 1 / max(self.exponent_per_s, 1e-12)
        return f"stability: NOT STABLE, small errors grow e-fold in {growth_s:.3g} s; {limits}"


def stability(
    model: ReducedOrderModel, inputs: Sequence[ArrayLike], *, n_samples: int = 50_000, seed: int = 0
) -> Stability:
    """Run a model freely on random input with the spectrum and the size of given inputs.

    Parameters
    ----------
    model : ReducedOrderModel
        Radial basis network.
    inputs : sequence of array_like
        Such as those it was trained on; NaN where nothing is known.
    n_samples : int
        Of the random run.
    seed : int

    Raises
    ------
    AnalysisError
        If no input has two known samples that differ, or the network is of another kind with feedback.

    Notes
    -----
    The random input has the amplitudes of the spectrum of the longest input and random phases.
    """
    x = _random_like(inputs, n_samples, seed)
    if not model.has_feedback:
        simulated = model.simulate(x)
        return Stability(-math.inf, _bound(model), float(np.nanmax(np.abs(simulated))))
    run_x = (x - model.scaling.input_offset) / model.scaling.input_scale
    # no force, in the network's values
    y = np.full(n_samples, -model.scaling.output_offset / model.scaling.output_scale)
    rate = growth_rate(model.compiled(), run_x, y, round(_SETTLING * n_samples))
    largest = float(np.abs(model.scaling.output_of(y)).max())
    return Stability(rate * model.sampling_rate_hz, _bound(model), largest)


def _random_like(inputs: Sequence[ArrayLike], n: int, seed: int) -> FloatArray:
    known = [values[np.isfinite(values)] for values in (np.asarray(given, np.float64) for given in inputs)]
    longest = max(known, key=lambda values: values.size, default=np.zeros(0))
    if longest.size < 2 or not np.ptp(longest) > 0:
        raise AnalysisError("stability", got="no input that moves", allowed="inputs such as those of the training")
    mean, phases = longest.mean(), np.random.default_rng(seed).uniform(0, 2 * np.pi, longest.size // 2 + 1)
    amplitudes = np.abs(np.fft.rfft(longest - mean))
    random = np.fft.irfft(amplitudes * np.exp(1j * phases), longest.size)
    random *= np.std(longest) / np.std(random)
    repeated: FloatArray = mean + np.resize(random, n)
    return repeated


def _bound(model: ReducedOrderModel) -> float:
    """Of |output|: shares of a normalised network sum to one, other features are at most one each."""
    weights, scaling = model.theta[-model.network.n_linear :], model.scaling
    if isinstance(model.network, NormalisedRadialBasis):
        return float(np.abs(scaling.output_of(np.array([weights.min(), weights.max()]))).max())
    return float(abs(scaling.output_offset) + scaling.output_scale * np.abs(weights).sum())


@njit(cache=True)
def growth_rate(model, x, y, settling):  # type: ignore[no-untyped-def]
    """Mean growth of a small difference of the past outputs, per sample; overwrites y by the free run."""
    theta, m, input_delays, output_delays = model.theta, model.n_neurons, model.input_delays, model.output_delays
    n_in, n_out = input_delays.size, output_delays.size
    p = n_in + n_out
    first, reach = 0, 0
    for a in range(n_in):
        first = max(first, input_delays[a])
    for b in range(n_out):
        first = max(first, output_delays[b])
        reach = max(reach, output_delays[b])
    phi, features, factors = np.empty(p), np.empty(m), np.empty(m)
    difference = np.ones(reach) / np.sqrt(reach)  # of the last outputs, the latest first
    total, count = 0.0, 0
    for k in range(first, x.size):
        free_run.fill_regressors(model, x, y, k, phi)
        y[k] = free_run.evaluate(model.kind, theta, phi, features, factors)
        new = 0.0
        for b in range(n_out):
            slope = 0.0
            for i in range(m):
                slope -= factors[i] * (phi[n_in + b] - theta[i * p + n_in + b])
            # linearised about the run itself: a real second run would soon differ by too much, or not at all
            new += slope * difference[output_delays[b] - 1]
        for b in range(reach - 1, 0, -1):
            difference[b] = difference[b - 1]
        difference[0] = new
        # brought back to size 1 at every sample, so that its growth neither overflows nor vanishes
        size = np.sqrt(np.sum(difference * difference))
        if size < 1e-300:
            return -np.inf
        difference /= size
        if k >= first + settling:
            total += np.log(size)
            count += 1
    return total / max(count, 1)
