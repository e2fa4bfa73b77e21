"""A mass, spring and damper under a harmonic force: amplitude, phase and work per cycle (Appendix A)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def dynamic_amplification(frequency_ratio: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """|B| k/A = 1/√((1 − r²)² + 4ζ²r²) (A.8): displacement over that of the force at rest.

    Parameters
    ----------
    frequency_ratio : array_like
        r = Ω/ω_n.
    damping_ratio : float
        ζ.

    Examples
    --------
    >>> dynamic_amplification([0.0, 1.0], 0.05).tolist()
    [1.0, 10.0]
    """
    r = np.asarray(frequency_ratio, np.float64)
    return np.asarray(1 / np.sqrt((1 - r**2) ** 2 + 4 * damping_ratio**2 * r**2))


def phase_rad(frequency_ratio: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """χ of x = |B| sin(Ωt + χ) under A sin Ωt, 0 … −π (A.6, A.7).

    The printed (A.8) has the arctangent, which jumps at resonance; sine and cosine do not.

    Examples
    --------
    >>> (phase_rad([0.0, 1.0], 0.05) / np.pi).tolist()
    [0.0, -0.5]
    """
    r = np.asarray(frequency_ratio, np.float64)
    return np.asarray(np.arctan2(-2 * damping_ratio * r, 1 - r**2)) + 0.0


def work_per_cycle(frequency_ratio: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """W k/A² = −π |B| sin χ k/A (A.10): work of the force in a cycle, over A²/k; positive = dissipated.

    Examples
    --------
    >>> round(float(work_per_cycle(1.0, 0.05)), 6)  # π/(2ζ)
    31.415927
    """
    amplification = dynamic_amplification(frequency_ratio, damping_ratio)
    return np.asarray(-np.pi * amplification * np.sin(phase_rad(frequency_ratio, damping_ratio)))
