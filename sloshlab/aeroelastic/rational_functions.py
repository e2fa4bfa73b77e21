"""Unsteady forces as rational functions of the Laplace variable, which time simulations and root loci need.

    Q(p) = A₀ + pA₁ + p²A₂ + pC(pI + P)⁻¹B,   p = sb/U,   P diagonal and positive

In time, with ȧ = −(U/b) P a + B q̇:  e = q_D [A₀ q + (b/U) A₁ q̇ + (b/U)² A₂ q̈ + C a].
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_positive, require_shape
from sloshlab.errors import AnalysisError


@dataclass(frozen=True)
class FitQuality:
    """How well a rational function reproduces the forces it was fitted to.

    Attributes
    ----------
    rms : float
        Root of the sum of squared errors over all entries and k, over that of the forces.
    largest : ndarray, shape (n, m)
        Largest error of each entry over its own largest value.
    """

    rms: float
    largest: FloatArray


@dataclass(frozen=True)
class RationalForces:
    """Forces of n coordinates by m inputs.

    Attributes
    ----------
    a0, a1, a2 : ndarray, shape (n, m)
        Stiffness-, damping- and mass-like parts.
    lag_output, lags, lag_input : ndarray, shapes (n, n_lags), (n_lags,), (n_lags, m)
        C, diagonal of P, and B.
    semi_chord_m : float
        b in p = sb/U.
    largest_reduced_frequency : float
        Beyond it the fit has seen no data.
    quality : FitQuality, optional
        None for forms that no fit was needed for.
    """

    a0: FloatArray
    a1: FloatArray
    a2: FloatArray
    lag_output: FloatArray
    lags: FloatArray
    lag_input: FloatArray
    semi_chord_m: float
    largest_reduced_frequency: float = np.inf
    quality: FitQuality | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        require_positive(semi_chord_m=self.semi_chord_m)
        rows, columns = self.a0.shape
        n_lags = self.lags.size
        for name, shape in (("a0", (rows, columns)), ("a1", (rows, columns)), ("a2", (rows, columns))):
            require_shape(name, getattr(self, name), shape)
        require_shape("lag_output", self.lag_output, (rows, n_lags))
        require_shape("lag_input", self.lag_input, (n_lags, columns))
        if np.any(self.lags <= 0):
            raise AnalysisError("lags", got=f"{self.lags.min():.4g}", allowed="> 0, or the lag states grow")

    def at(self, reduced_laplace: complex) -> ComplexArray:
        """Q(p).

        Parameters
        ----------
        reduced_laplace : complex
            p = sb/U, jk for harmonic motion.

        Returns
        -------
        ndarray of complex, shape (n, m)
        """
        p = complex(reduced_laplace)
        lagged = p * (self.lag_output / (p + self.lags)) @ self.lag_input
        return np.asarray(self.a0 + p * self.a1 + p**2 * self.a2 + lagged, dtype=complex)

    def transferred(self, motion: FloatArray) -> RationalForces:
        """The same forces on and by other coordinates.

        Parameters
        ----------
        motion : ndarray, shape (n, n_new)
            Old coordinates per new one.
        """
        require_shape("motion", motion, (self.a0.shape[0], -1))
        of_motion = {name: motion.T @ getattr(self, name) @ motion for name in ("a0", "a1", "a2")}
        return replace(
            self,
            **of_motion,
            lag_output=motion.T @ self.lag_output,
            lag_input=self.lag_input @ motion,
            quality=None,
        )


def quality_of(forces: RationalForces, reduced_frequency: FloatArray, table: ComplexArray) -> FitQuality:
    """Compare a rational function with the table it was fitted to.

    Parameters
    ----------
    forces : RationalForces
        The fit.
    reduced_frequency : ndarray, shape (n_k,)
        k of the table.
    table : ndarray of complex, shape (n_k, n, m)
        Q(k).

    Returns
    -------
    FitQuality
    """
    error = np.abs(np.array([forces.at(1j * k) for k in reduced_frequency]) - table)
    size = np.abs(table).max(axis=0)
    # entries that are zero by symmetry have no error of their own
    floor = 1e-12 * max(float(size.max()), np.finfo(float).tiny)
    largest = np.where(size > floor, error.max(axis=0) / np.maximum(size, floor), 0.0)
    return FitQuality(float(np.linalg.norm(error) / np.linalg.norm(table)), largest)
