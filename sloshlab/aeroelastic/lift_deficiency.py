"""Lift of a thin aerofoil in incompressible flow: Theodorsen, Wagner, Sears and Küssner functions.

Times are in semi-chords travelled, σ = Ut/b.

References
----------
T. Theodorsen: General theory of aerodynamic instability and the mechanism of flutter. NACA Report 496 (1935).
W. R. Sears: Operational methods in the theory of airfoils in non-uniform motion. J. Franklin Inst. 230 (1940).
R. T. Jones: The unsteady lift of a wing of finite aspect ratio. NACA Report 681 (1940).
R. L. Bisplinghoff, H. Ashley, R. L. Halfman: Aeroelasticity, sections 5.6 and 5.7 (1955).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.integrate import quad
from scipy.special import ive, jv, kve

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray

JONES_SHARES: Final = (0.165, 0.335)
JONES_LAGS: Final = (0.0455, 0.3)
"""Wagner function ≈ 1 − Σ share · exp(−lag σ); lags are reduced by the semi-chord."""
KUSSNER_SHARES: Final = (0.5, 0.5)
KUSSNER_LAGS: Final = (0.13, 1.0)
"""Küssner function ≈ 1 − Σ share · exp(−lag σ)."""

_SMALLEST_K: Final = 1e-12
_RELATIVE_ERROR: Final = 1e-10


def theodorsen(reduced_laplace: npt.ArrayLike) -> ComplexArray:
    """Theodorsen function C = K₁(p)/(K₀(p) + K₁(p)) at p = sb/U; p = jk for harmonic motion.

    Parameters
    ----------
    reduced_laplace : array-like of complex
        p; its real part must not be negative unless its imaginary part is not zero. C(0) = 1.

    Returns
    -------
    ndarray of complex

    Examples
    --------
    >>> complex(theodorsen(0.1j).round(4))
    (0.8319-0.1723j)
    """
    p = np.atleast_1d(np.asarray(reduced_laplace, dtype=complex))
    result = np.ones(p.shape, dtype=complex)
    moving = np.abs(p) > _SMALLEST_K
    # scaled by exp(p): the ratio keeps its digits where both functions vanish
    k0, k1 = kve(0, p[moving]), kve(1, p[moving])
    result[moving] = k1 / (k0 + k1)
    return result.reshape(np.shape(reduced_laplace))


def sears(reduced_frequency: npt.ArrayLike) -> ComplexArray:
    """Lift of a sinusoidal gust over 2πρUb w_g, phase at mid-chord: S = (J₀ − jJ₁) C + jJ₁.

    Parameters
    ----------
    reduced_frequency : array-like
        k ≥ 0.

    Returns
    -------
    ndarray of complex
    """
    k = np.asarray(reduced_frequency, dtype=float)
    j0, j1 = jv(0, k), jv(1, k)
    return np.asarray((j0 - 1j * j1) * theodorsen(1j * k) + 1j * j1, dtype=complex)


def wagner(semi_chords: npt.ArrayLike) -> FloatArray:
    """Circulatory lift after a step of the angle of attack over its final value, exactly by quadrature.

    Parameters
    ----------
    semi_chords : array-like
        σ ≥ 0.

    Returns
    -------
    ndarray
        ½ at σ = 0, 1 at infinity.

    Notes
    -----
    1 − φ = ∫₀^∞ e^{−σx} / {x² [(K₀ − K₁)² + π²(I₀ + I₁)²]} dx, the cut of Theodorsen's function along the negative
    real axis.

    Examples
    --------
    >>> wagner([1.0, 10.0]).round(4).tolist()
    [0.6006, 0.875]
    """
    flat = np.atleast_1d(np.asarray(semi_chords, dtype=float))
    values = np.array([1.0 - _wagner_deficiency(sigma) for sigma in flat.ravel()])
    return values.reshape(np.shape(semi_chords))


def _wagner_deficiency(sigma: float) -> float:
    def integrand(logarithm: float) -> float:
        x = np.exp(logarithm)
        # Bessel functions scaled by exp(±x), so that large x neither over- nor underflows
        k_part = (kve(0, x) - kve(1, x)) * np.exp(-2 * x)
        i_part = np.pi * (ive(0, x) + ive(1, x))
        return float(np.exp(-sigma * x - 2 * x) / (x * (k_part**2 + i_part**2)))

    # over ln x: the integrand has a long tail towards x = 0
    lower, _ = quad(integrand, -40.0, 0.0, epsabs=1e-11, epsrel=_RELATIVE_ERROR, limit=200)
    upper, _ = quad(integrand, 0.0, 5.0, epsabs=1e-11, epsrel=_RELATIVE_ERROR, limit=200)
    return float(lower + upper)


def wagner_of_jones(semi_chords: npt.ArrayLike) -> FloatArray:
    """Two-lag approximation of the Wagner function, 1.1 % off at most.

    Parameters
    ----------
    semi_chords : array-like
        σ ≥ 0.

    Returns
    -------
    ndarray
    """
    return _of_lags(semi_chords, JONES_SHARES, JONES_LAGS)


def kussner(semi_chords: npt.ArrayLike) -> FloatArray:
    """Lift of an aerofoil that flies into a sharp-edged gust over its final value, exactly by quadrature.

    Parameters
    ----------
    semi_chords : array-like
        σ ≥ 0, from the leading edge at the edge of the gust.

    Returns
    -------
    ndarray
        0 at σ = 0, 1 at infinity.

    Notes
    -----
    Part of the chord s < 2 is in the gust: its quasi-steady circulation grows with √(s/(2 − s))/π, and the
    apparent mass adds √(σ(2 − σ))/π as long as σ < 2. So, with the second term while σ < 2,
    ψ = (1/π) ∫₀^min(σ,2) φ(σ − s) √(s/(2 − s)) ds + (1/π) √(σ(2 − σ)).
    """
    flat = np.atleast_1d(np.asarray(semi_chords, dtype=float))
    values = np.array([_kussner_at(sigma) for sigma in flat.ravel()])
    return values.reshape(np.shape(semi_chords))


def _kussner_at(sigma: float) -> float:
    inside = min(sigma, 2.0)
    # s = 1 − cos χ takes the square root out of the integrand
    end = np.arccos(1.0 - inside)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    chi = 0.5 * end * (nodes + 1.0)
    circulatory = 0.5 * end * float(weights @ (wagner(sigma - (1 - np.cos(chi))) * (1 - np.cos(chi))))
    return float((circulatory + np.sqrt(max(inside * (2.0 - inside), 0.0))) / np.pi)


def kussner_of_two_lags(semi_chords: npt.ArrayLike) -> FloatArray:
    """Two-lag approximation of the Küssner function, 1 − ½ exp(−0.13σ) − ½ exp(−σ).

    Parameters
    ----------
    semi_chords : array-like
        σ ≥ 0.

    Returns
    -------
    ndarray
    """
    return _of_lags(semi_chords, KUSSNER_SHARES, KUSSNER_LAGS)


def _of_lags(semi_chords: npt.ArrayLike, shares: tuple[float, ...], lags: tuple[float, ...]) -> FloatArray:
    sigma = np.asarray(semi_chords, dtype=float)
    terms = [share * np.exp(-lag * sigma) for share, lag in zip(shares, lags, strict=True)]
    return np.asarray(1.0 - sum(terms), dtype=float)
