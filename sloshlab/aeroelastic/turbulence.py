"""Continuous vertical turbulence: von Kármán and Dryden spectra, response spectra, and samples in time.

Spectra are one-sided over the angular frequency: ∫₀^∞ Φ(ω) dω = σ². L is the scale of turbulence, U the speed.

References
----------
F. M. Hoblit: Gust loads on aircraft: concepts and applications. AIAA (1988), chapter 4.
MIL-HDBK-1797, appendix A (1997).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_positive
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.modal_structure import ModalStructure
from sloshlab.errors import AnalysisError

Spectrum = Callable[[FloatArray], FloatArray]

_VON_KARMAN = 1.339
"""a in (1 + (a L ω/U)²): Γ(1/3)/(√π Γ(5/6)), rounded as in the literature."""
_LARGEST_N_SAMPLES = 1 << 24


def von_karman(rms_m_per_s: float, *, scale_m: float, speed_m_per_s: float) -> Spectrum:
    """Φ = σ² (L/πU) [1 + (8/3)x²] / (1 + x²)^(11/6), x = 1.339 L ω/U.

    Parameters
    ----------
    rms_m_per_s : float
        σ.
    scale_m, speed_m_per_s : float
        L and U.

    Returns
    -------
    callable
        Takes ω in rad/s, gives m²/s² per rad/s.
    """
    require_positive(rms_m_per_s=rms_m_per_s, scale_m=scale_m, speed_m_per_s=speed_m_per_s)

    def spectrum(omega: FloatArray) -> FloatArray:
        x = _VON_KARMAN * scale_m * np.asarray(omega, dtype=float) / speed_m_per_s
        level = rms_m_per_s**2 * scale_m / (np.pi * speed_m_per_s)
        return np.asarray(level * (1 + 8 / 3 * x**2) / (1 + x**2) ** (11 / 6), dtype=float)

    return spectrum


def dryden(rms_m_per_s: float, *, scale_m: float, speed_m_per_s: float) -> Spectrum:
    """Φ = σ² (L/πU) (1 + 3x²) / (1 + x²)², x = L ω/U.

    Parameters
    ----------
    rms_m_per_s, scale_m, speed_m_per_s : float
        As for `von_karman`.

    Returns
    -------
    callable
        Takes ω in rad/s, gives m²/s² per rad/s.
    """
    require_positive(rms_m_per_s=rms_m_per_s, scale_m=scale_m, speed_m_per_s=speed_m_per_s)

    def spectrum(omega: FloatArray) -> FloatArray:
        x = scale_m * np.asarray(omega, dtype=float) / speed_m_per_s
        level = rms_m_per_s**2 * scale_m / (np.pi * speed_m_per_s)
        return np.asarray(level * (1 + 3 * x**2) / (1 + x**2) ** 2, dtype=float)

    return spectrum


def dryden_filter(
    rms_m_per_s: float, *, scale_m: float, speed_m_per_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Dryden turbulence as the output of a filter: ẋ = A x + B n, w_g = C x.

    Parameters
    ----------
    rms_m_per_s, scale_m, speed_m_per_s : float
        As for `von_karman`.

    Returns
    -------
    system, noise, output : ndarray, shapes (2, 2), (2,), (2,)
        n is white noise of one-sided density 1/π per rad/s (unit intensity in time).

    Notes
    -----
    G(s) = σ √(T) (1 + √3 T s)/(1 + T s)², T = L/U; Φ = |G|²/π.
    """
    require_positive(rms_m_per_s=rms_m_per_s, scale_m=scale_m, speed_m_per_s=speed_m_per_s)
    t = scale_m / speed_m_per_s
    system = np.array([[0.0, 1.0], [-1 / t**2, -2 / t]])
    output = rms_m_per_s * np.sqrt(t) * np.array([1.0, np.sqrt(3.0) * t]) / t**2
    return system, np.array([0.0, 1.0]), output


def turbulence_in_time(spectrum: Spectrum, *, time_step_s: float, n_samples: int, seed: int) -> FloatArray:
    """A sample of turbulence: lines of the spectrum with random amplitude and phase.

    Parameters
    ----------
    spectrum : callable
        One-sided, over ω.
    time_step_s : float
        Of the samples. Frequencies above π over it are missing.
    n_samples : int
        2 … 2²⁴; the sample repeats after them.
    seed : int
        Of the random numbers.

    Returns
    -------
    ndarray, shape (n_samples,)
        w_g in m/s with mean 0.
    """
    require_positive(time_step_s=time_step_s)
    if not 2 <= n_samples <= _LARGEST_N_SAMPLES:
        raise AnalysisError("n_samples", got=f"{n_samples}", allowed=f"2 … {_LARGEST_N_SAMPLES}")
    random = np.random.default_rng(seed)
    n_lines = n_samples // 2 + 1
    spacing = 2 * np.pi / (n_samples * time_step_s)
    omega = np.asarray(spacing * np.arange(n_lines), dtype=np.float64)
    # complex normal lines: a Gaussian process, not one of constant amplitudes
    lines = random.standard_normal(n_lines) + 1j * random.standard_normal(n_lines)
    lines = lines * np.sqrt(spectrum(omega) * spacing) * n_samples / 2
    lines[0] = 0.0
    return np.asarray(np.fft.irfft(lines, n_samples), dtype=float)


def transfer_of_gust(
    structure: ModalStructure,
    forces: GeneralisedForces,
    omega_rad_per_s: npt.ArrayLike,
    *,
    density_kg_per_m3: float,
    speed_m_per_s: float,
    travelling: bool = True,
) -> ComplexArray:
    """Coordinates over w_g of a sinusoidal gust, from the table itself without a rational function.

    Parameters
    ----------
    structure : ModalStructure
        n coordinates.
    forces : GeneralisedForces
        Of motion and gust.
    omega_rad_per_s : array-like, shape (n_omega,)
        > 0; ω b/U within the table.
    density_kg_per_m3, speed_m_per_s : float
        Of the air.
    travelling : bool
        The gust is carried along by the flow; False for one that is the same everywhere.

    Returns
    -------
    ndarray of complex, shape (n_omega, n)
        Unit of the coordinate per m/s.

    Raises
    ------
    AnalysisError
        If a frequency is beyond the table.
    """
    require_positive(density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed_m_per_s)
    omega = np.atleast_1d(np.asarray(omega_rad_per_s, dtype=float))
    k = omega * forces.semi_chord_m / speed_m_per_s
    if k.max() > forces.largest_reduced_frequency:
        raise AnalysisError(
            "reduced frequency of turbulence",
            got=f"{k.max():.4g}",
            allowed=f"≤ {forces.largest_reduced_frequency:.4g}",
        )
    gust = forces.travelling_spline if travelling else forces.uniform_spline
    pressure = 0.5 * density_kg_per_m3 * speed_m_per_s**2
    result = []
    for frequency, reduced in zip(omega, k, strict=True):
        dynamic = structure.stiffness - frequency**2 * structure.mass + 1j * frequency * structure.damping
        force = pressure / speed_m_per_s * gust(reduced)
        result.append(np.linalg.solve(dynamic - pressure * forces.at(reduced), force))
    return np.array(result)


def rms_in_turbulence(transfer: ComplexArray, spectrum: Spectrum, omega_rad_per_s: FloatArray) -> FloatArray:
    """Root mean square of responses, √∫|H|²Φ dω by the trapezoidal rule.

    Parameters
    ----------
    transfer : ndarray of complex, shape (n_omega, n)
        H, from `transfer_of_gust` times whatever turns coordinates into the response.
    spectrum : callable
        Φ.
    omega_rad_per_s : ndarray, shape (n_omega,)
        Ascending; fine enough for the resonances.

    Returns
    -------
    ndarray, shape (n,)
    """
    density = np.abs(transfer) ** 2 * spectrum(omega_rad_per_s)[:, None]
    return np.asarray(np.sqrt(np.trapezoid(density, omega_rad_per_s, axis=0)), dtype=float)
