"""Integration of sampled signals between instants that are not samples.

The rule is the symmetric six-point one: the integral over one step is taken from the polynomial
through the three samples on each side of it. It has no phase error and an amplitude error of
191/60480 (ω Δt)⁶. A step cut by a boundary is integrated with the same polynomial.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt
from numba import njit

# Of the polynomial of fifth degree through six samples. A symmetric rule errs in amplitude only; a phase error
# would turn reactive power, up to forty times the dissipated one, into work.
STEP_WEIGHTS: npt.NDArray[np.float64] = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440.0
"""Weights of samples i-2 … i+3 in the integral over the step from i to i+1, in steps."""

# three for the weights of a boundary, three more for the step rule of the inner integral
MARGIN_SAMPLES = 6
"""Samples beyond a boundary that the integral of an integral may touch."""


def _lagrange_integrals() -> npt.NDArray[np.float64]:
    """Coefficients in powers of f of ∫_{-f}^{0} ℓ_j(x) dx for the nodes j = -3 … 2; shape (6, 7)."""
    nodes = range(-3, 3)
    table = np.zeros((6, 7))
    for row, node in enumerate(nodes):
        # exact fractions, rounded once: the differences of such coefficients lose digits
        polynomial = [Fraction(1)]
        for other in nodes:
            if other == node:
                continue
            shifted = [Fraction(0), *polynomial]
            scaled = [*(-other * c for c in polynomial), Fraction(0)]
            polynomial = [(a + b) / (node - other) for a, b in zip(shifted, scaled, strict=True)]
        for power, coefficient in enumerate(polynomial, start=1):
            table[row, power] = float(-coefficient * (-1) ** power / power)
    return table


def _gregory_corrections() -> npt.NDArray[np.float64]:
    """What whole steps from sample p on give to samples p-3 … p+2 beyond a weight of one from p on."""
    # As in Gregory's formula: inside, the step rules of overlapping steps add up to one; only near a boundary
    # some miss.
    cumulative = np.concatenate([[0.0], np.cumsum(STEP_WEIGHTS)[:5]])
    return np.asarray(cumulative - np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))


_PARTIAL_STEP = _lagrange_integrals()
_GREGORY = _gregory_corrections()


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def boundary_weights(fraction: float, weights: npt.NDArray[np.float64]) -> None:
    """Fill `weights` with what a boundary adds to samples p-3 … p+2 of a plain sum from p on.

    Parameters
    ----------
    fraction : float
        Distance from the boundary to the next sample p inside, in steps, 0 ≤ fraction < 1.
    weights : ndarray, shape (6,)
        Written to; in steps. For an upper boundary the same numbers hold mirrored, p being the
        last sample inside.
    """
    for j in range(6):
        value = 0.0
        # Horner's scheme; at fraction 0 only the correction of the whole steps is left
        for power in range(6, 0, -1):
            value = (value + _PARTIAL_STEP[j, power]) * fraction
        weights[j] = value + _GREGORY[j]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def integral(samples: npt.NDArray[np.float64], start: float, stop: float) -> float:
    """Integral of uniformly spaced samples between two positions, in steps.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Values at positions 0 … n-1.
    start, stop : float
        Positions; both at least three samples from the ends of `samples`.

    Returns
    -------
    float
        ∫ samples dx; multiply by the time step to get an integral over time.

    Examples
    --------
    >>> x = np.arange(20.0)
    >>> round(integral(x**5, 4.25, 12.5), 6) == round((12.5**6 - 4.25**6) / 6, 6)
    True
    """
    first, last = int(np.ceil(start)), int(np.floor(stop))
    weights = np.empty(6)
    total = 0.0
    for i in range(first, last + 1):
        total += samples[i]
    boundary_weights(first - start, weights)
    for j in range(6):
        total += weights[j] * samples[first - 3 + j]
    boundary_weights(stop - last, weights)
    for j in range(6):
        total += weights[j] * samples[last + 3 - j]
    return total
