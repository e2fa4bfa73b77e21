"""Stiffness and mass of beams in their own axes, by their cross-sections, constant or tapered."""

from __future__ import annotations

from math import isinf
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.deck import Material, Section, TaperedSection
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]
_GAUSS: Final = np.polynomial.legendre.leggauss(12)
"""Places and weights between two stations; flexibilities of tapered beams are rational functions."""


def stiffness_of_section(section: Section | TaperedSection, material: Material, length: float) -> FloatArray:
    """Stiffness of a beam along x in its own axes, shape (12, 12).

    Notes
    -----
    From the flexibility of the beam clamped at A, loaded at B, and the equilibrium of both ends. Rows are stretch,
    deflections along y and z, torsion, rotations about y and z. The flexibility of a tapered beam is the integral
    of that of its cross-sections, which are linear between stations.
    """
    samples = _samples(section)
    at_b = np.zeros((6, 6))
    at_b[0, 0] = material.youngs_modulus * _in_series([(w, s.area) for _, w, s in samples]) / length
    at_b[3, 3] = material.shear_modulus * _in_series([(w, s.torsion) for _, w, s in samples]) / length
    at_b += _bending(samples, material, length)
    between = np.hstack([-rigid_motion([length, 0.0, 0.0]), np.eye(6)])  # motion of B, less that with A
    return np.asarray(between.T @ at_b @ between)


def _samples(section: Section | TaperedSection) -> list[tuple[float, float, Section]]:
    """Shares of the length, weights whose sum is 1, and cross-sections there."""
    if isinstance(section, Section):
        # three points make the squares of the arm exact
        places, weights = np.polynomial.legendre.leggauss(3)
        return [(0.5 * (1 + x), 0.5 * w, section) for x, w in zip(places, weights, strict=True)]
    samples = []
    for a, b in zip(section.stations[:-1], section.stations[1:], strict=True):
        for x, w in zip(*_GAUSS, strict=True):
            share = a + 0.5 * (b - a) * (1 + x)
            samples.append((float(share), 0.5 * (b - a) * float(w), section.at(float(share))))
    return samples


def _in_series(parts: list[tuple[float, float]]) -> float:
    """The constant value that is as stiff as parts one after another."""
    return 0.0 if any(value <= 0 for _, value in parts) else 1.0 / sum(w / value for w, value in parts)


def _bending(samples: list[tuple[float, float, Section]], material: Material, length: float) -> FloatArray:
    """Stiffness at B of both planes together, shape (6, 6)."""
    stiffness = np.zeros((6, 6))
    # deflections v, w and slopes v′, w′, of which the rotation about y is −w′
    planes = np.zeros((4, 6))
    planes[0, 1] = planes[1, 2] = planes[2, 5] = 1.0
    planes[3, 4] = -1.0
    bent = np.all([[s.inertia_1 > 0, s.inertia_2 > 0] for _, _, s in samples], axis=0)
    if not bent.any():
        return stiffness
    n = int(bent.sum())
    kept = np.flatnonzero(np.concatenate([bent, bent]))
    flexibility = np.zeros((2 * n, 2 * n))
    for share, weight, section in samples:
        inertia = np.array([[section.inertia_1, section.inertia_12], [section.inertia_12, section.inertia_2]])
        compliance = np.linalg.inv(inertia[np.ix_(bent, bent)]) / material.youngs_modulus
        shares = np.array([section.shear_1, section.shear_2])[bent]
        in_shear = [0.0 if isinf(k) else 1.0 / (k * section.area * material.shear_modulus) for k in shares]
        arm = (1 - share) * length
        flexibility += weight * length * np.block(
            [[arm**2 * compliance + np.diag(in_shear), arm * compliance], [arm * compliance, compliance]]
        )  # fmt: skip
    of_kept = planes[kept]
    return np.asarray(stiffness + of_kept.T @ np.linalg.inv(flexibility) @ of_kept)


def mass_of_section(
    section: Section | TaperedSection, material: Material, length: float, has_polar_inertia: bool, consistent: bool
) -> FloatArray:
    """Mass of a beam in its own axes, shape (12, 12), its mass at the ends or along it."""
    samples = [
        (
            share,
            weight * length * (material.density * s.area + s.mass_per_length),
            weight * length * (material.density * (s.inertia_1 + s.inertia_2) + s.polar_mass_per_length)
            if has_polar_inertia
            else 0.0,
        )
        for share, weight, s in _mass_samples(section)
    ]
    mass = np.zeros((12, 12))
    for share, here, polar in samples:
        a, b = 1 - share, share
        if not consistent:
            mass += np.diag([a * here] * 3 + [a * polar, 0.0, 0.0] + [b * here] * 3 + [b * polar, 0.0, 0.0])
            continue
        shapes = beam_shapes(share, length)
        mass += shapes.T @ np.diag([here, here, here, polar]) @ shapes
    return mass


def _mass_samples(section: Section | TaperedSection) -> list[tuple[float, float, Section]]:
    if isinstance(section, TaperedSection):
        return _samples(section)
    places, weights = np.polynomial.legendre.leggauss(4)  # exact for products of cubic polynomials
    return [(0.5 * (1 + x), 0.5 * w, section) for x, w in zip(places, weights, strict=True)]


def beam_shapes(share: float, length: float) -> FloatArray:
    """Stretch, deflections and twist there per motion of the ends (Archer), shape (4, 12).

    Parameters
    ----------
    share : float
        Of the length, from end A.
    length : float

    Notes
    -----
    Stretch and twist are linear, deflections cubic; the rotation about y is −w′.
    """
    x = share
    of_a, slope_a = 1 - 3 * x**2 + 2 * x**3, length * (x - 2 * x**2 + x**3)
    of_b, slope_b = 3 * x**2 - 2 * x**3, length * (x**3 - x**2)
    shapes = np.zeros((4, 12))
    shapes[0, [0, 6]] = shapes[3, [3, 9]] = 1 - x, x
    shapes[1, [1, 5, 7, 11]] = of_a, slope_a, of_b, slope_b
    shapes[2, [2, 4, 8, 10]] = of_a, -slope_a, of_b, -slope_b
    return shapes
