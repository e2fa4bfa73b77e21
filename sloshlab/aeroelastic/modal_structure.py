"""The structure as generalised mass, damping and stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from sloshlab.aeroelastic.arrays import FloatArray, require_shape
from sloshlab.errors import AnalysisError


@dataclass(frozen=True)
class ModalStructure:
    """M q̈ + D q̇ + K q = generalised forces.

    Attributes
    ----------
    mass, damping, stiffness : ndarray, shape (n, n)
        Mass symmetric and positive definite. Units of the coordinates are the caller's.
    names : tuple of str
        One per coordinate: what branches of a root locus are called that start at it.

    Raises
    ------
    AnalysisError
        If shapes differ or the mass is not positive definite.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = self.mass.shape[0]
        for name in ("mass", "damping", "stiffness"):
            require_shape(name, getattr(self, name), (n, n))
        if np.linalg.eigvalsh(0.5 * (self.mass + self.mass.T)).min() <= 0:
            raise AnalysisError("mass", got="a matrix that is not positive definite", allowed="positive definite")
        if not self.names:
            object.__setattr__(self, "names", tuple(f"mode {index + 1}" for index in range(n)))
        if len(self.names) != n:
            raise AnalysisError("names of modes", got=f"{len(self.names)}", allowed=f"{n}, one per coordinate")

    @property
    def natural_frequency_rad_per_s(self) -> FloatArray:
        """Of the undamped structure without flow, ascending."""
        values = eigh(self.stiffness, self.mass, eigvals_only=True)
        return np.asarray(np.sqrt(np.maximum(values, 0.0)), dtype=float)


def of_modes(
    frequency_rad_per_s: FloatArray,
    modal_mass: FloatArray | None = None,
    *,
    damping_ratio: FloatArray | float = 0.0,
    names: tuple[str, ...] = (),
) -> ModalStructure:
    """A structure in its own modes.

    Parameters
    ----------
    frequency_rad_per_s : ndarray, shape (n,)
        0 for rigid-body modes.
    modal_mass : ndarray, shape (n,), optional
        1 if not given.
    damping_ratio : float or ndarray
        Share of critical damping.
    names : tuple of str
        Of the modes.

    Returns
    -------
    ModalStructure
    """
    omega = np.asarray(frequency_rad_per_s, dtype=float)
    mass = np.ones_like(omega) if modal_mass is None else np.asarray(modal_mass, dtype=float)
    damping = 2 * np.broadcast_to(damping_ratio, omega.shape) * omega * mass
    return ModalStructure(np.diag(mass), np.diag(damping), np.diag(mass * omega**2), names)
