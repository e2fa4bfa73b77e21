"""Flutter by the p-k method: forces of harmonic motion at the frequency of the root, by speed and mode.

    s² M + s D + K − q_D [Q_R + (sb/U) Q_I/k] = 0,   k = Im(s) b/U

References
----------
H. J. Hassig: An approximate true damping solution of the flutter equation by determinant iteration.
Journal of Aircraft 8, 885–889 (1971).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_positive
from sloshlab.aeroelastic.modal_structure import ModalStructure
from sloshlab.errors import AnalysisError

_MOST_ITERATIONS = 60
_SMALLEST_K = 1e-4
_CHANGE_OF_K = 1e-8

Forces = Callable[[float], ComplexArray]
Flow = tuple[float, float, float]


@dataclass(frozen=True)
class PkRoots:
    """Roots over the speed.

    Attributes
    ----------
    speed_m_per_s : ndarray, shape (n_speeds,)
        Speeds.
    pole_rad_per_s : ndarray of complex, shape (n_speeds, n_modes)
        Roots of each mode, by its frequency without flow.
    converged : ndarray of bool, shape (n_speeds, n_modes)
        Whether the frequency of forces and root agree, and no other mode ended on the same root.
    """

    speed_m_per_s: FloatArray
    pole_rad_per_s: ComplexArray
    converged: np.ndarray


def p_k_roots(
    structure: ModalStructure, forces: Forces, *, semi_chord_m: float, density_kg_per_m3: float, speeds: FloatArray
) -> PkRoots:
    """Follow the oscillatory roots of every mode over the speed.

    Parameters
    ----------
    structure : ModalStructure
        Mass, damping, stiffness.
    forces : callable
        Q(k), shape (n, n), at every k that occurs.
    semi_chord_m : float
        b of k.
    density_kg_per_m3 : float
        Of the air.
    speeds : ndarray
        Ascending, > 0.

    Returns
    -------
    PkRoots
    """
    require_positive(semi_chord_m=semi_chord_m, density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speeds.min())
    previous = 1j * structure.natural_frequency_rad_per_s
    slope = np.zeros_like(previous)
    poles, converged = [], []
    for index, speed in enumerate(speeds):
        step = speed - speeds[index - 1] if index else 0.0
        found = [
            _root(structure, forces, guess, (semi_chord_m, density_kg_per_m3, float(speed)))
            for guess in previous + slope * step
        ]
        roots = np.array([root for root, _ in found])
        if index:
            slope = (roots - previous) / step
        previous = roots
        poles.append(roots)
        converged.append([done and _is_alone(root, roots) for root, done in found])
    return PkRoots(np.asarray(speeds, dtype=float), np.array(poles), np.array(converged))


def p_k_flutter(
    structure: ModalStructure,
    forces: Forces,
    *,
    semi_chord_m: float,
    density_kg_per_m3: float,
    speeds: FloatArray,
    tolerance_m_per_s: float = 1e-3,
) -> tuple[float, float, int]:
    """Lowest speed at which an oscillatory root crosses into growth.

    Parameters
    ----------
    structure, forces, semi_chord_m, density_kg_per_m3, speeds
        As for `p_k_roots`.
    tolerance_m_per_s : float
        Of the bisection.

    Returns
    -------
    speed_m_per_s, frequency_rad_per_s : float
        The flutter point.
    mode : int
        From 0, by frequency without flow.

    Raises
    ------
    AnalysisError
        If no root crosses between the first and the last speed.
    """
    roots = p_k_roots(
        structure, forces, semi_chord_m=semi_chord_m, density_kg_per_m3=density_kg_per_m3, speeds=speeds
    )
    real = roots.pole_rad_per_s.real
    crossing = (real[:-1] <= 0) & (real[1:] > 0) & (roots.pole_rad_per_s.imag[1:] > 0)
    if not crossing.any():
        raise AnalysisError(
            "flutter",
            got=f"no crossing from {speeds[0]:.6g} to {speeds[-1]:.6g} m/s",
            allowed="a range with a flutter point",
            remedy="search a wider range",
        )
    step, mode = (int(found[0]) for found in np.nonzero(crossing))
    low, high = float(speeds[step]), float(speeds[step + 1])
    root_low, root_high = roots.pole_rad_per_s[step, mode], roots.pole_rad_per_s[step + 1, mode]
    while high - low > tolerance_m_per_s:
        middle = 0.5 * (low + high)
        root, _ = _root(structure, forces, 0.5 * (root_low + root_high), (semi_chord_m, density_kg_per_m3, middle))
        if root.real > 0:
            high, root_high = middle, root
        else:
            low, root_low = middle, root
    return 0.5 * (low + high), float(0.5 * (root_low + root_high).imag), mode


def _root(structure: ModalStructure, forces: Forces, guess: complex, flow: Flow) -> tuple[complex, bool]:
    """The root whose frequency is that of the forces, from a guess."""
    semi_chord, _, speed = flow
    root, k = complex(guess), max(guess.imag * semi_chord / speed, _SMALLEST_K)
    for _ in range(_MOST_ITERATIONS):
        root = _nearest(_roots_at(structure, forces, k, flow), root)
        new = max(abs(root.imag) * semi_chord / speed, _SMALLEST_K)
        if abs(new - k) <= _CHANGE_OF_K * max(1.0, k):
            return root, True
        k = new
    return root, False


def _roots_at(structure: ModalStructure, forces: Forces, k: float, flow: Flow) -> ComplexArray:
    semi_chord, density, speed = flow
    pressure, matrix, n = 0.5 * density * speed**2, forces(k), structure.mass.shape[0]
    stiffness = structure.stiffness - pressure * matrix.real
    damping = structure.damping - pressure * semi_chord / speed * matrix.imag / k
    state = np.zeros((2 * n, 2 * n))
    state[:n, n:] = np.eye(n)
    state[n:] = np.linalg.solve(structure.mass, -np.hstack([stiffness, damping]))
    roots = np.linalg.eigvals(state)
    return np.asarray(roots[roots.imag >= 0], dtype=complex)


def _is_alone(root: complex, roots: ComplexArray) -> bool:
    return int(np.count_nonzero(np.abs(roots - root) <= 1e-6 * np.abs(roots).max())) == 1


def _nearest(roots: ComplexArray, guess: complex) -> complex:
    return complex(roots[np.argmin(np.abs(roots - guess))])
