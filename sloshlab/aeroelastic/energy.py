"""Energy that a mode of vibration takes from the air and loses to dampers in a cycle.

Motion is q = Re(w a e^{jωt}) with a real amplitude a; work on the structure is positive.

    L_aero = π a² q_D Im(wᴴ Q w),   L_damp = −π a² ω wᴴ D w

The source prints wᵀ in place of wᴴ (3.16), which is no work unless w is real.
"""

from __future__ import annotations

import numpy as np

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray


def work_of_forces(shape: ComplexArray, forces: ComplexArray) -> float:
    """Work in a cycle of forces that are linear in the motion, at unit amplitude [J/m²].

    Parameters
    ----------
    shape : ndarray of complex, shape (n,)
        w.
    forces : ndarray of complex, shape (n, n)
        Generalised forces per coordinate at this frequency, q_D Q.

    Returns
    -------
    float
        π Im(wᴴ F w); times a² it is the work.
    """
    return float(np.pi * np.imag(shape.conj() @ forces @ shape))


def work_of_dampers(shape: ComplexArray, damping: FloatArray, omega_rad_per_s: float) -> float:
    """Work in a cycle of viscous dampers, at unit amplitude [J/m²]; ≤ 0 where they damp.

    Parameters
    ----------
    shape : ndarray of complex, shape (n,)
    damping : ndarray, shape (n, n)
    omega_rad_per_s : float

    Returns
    -------
    float
        −π ω wᴴ D w; times a² it is the work.
    """
    return float(-np.pi * omega_rad_per_s * np.real(shape.conj() @ damping @ shape))


def energy_of_mode(shape: ComplexArray, mass: FloatArray, omega_rad_per_s: float) -> float:
    """Energy of the vibration at unit amplitude [J/m²], ½ ω² wᴴ M w.

    Parameters
    ----------
    shape : ndarray of complex, shape (n,)
    mass : ndarray, shape (n, n)
    omega_rad_per_s : float

    Returns
    -------
    float
        ¼ ω² wᴴMw is the mean kinetic energy, and as much the mean potential one where the mode neither grows nor
        decays: their sum.
    """
    return float(0.5 * omega_rad_per_s**2 * np.real(shape.conj() @ mass @ shape))
