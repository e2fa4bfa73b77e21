"""Least squares of one decaying sine, y = c + e^{−st}(A cos ωt + B sin ωt).

Gauss–Newton on s and ω; A, B and c are linear and solved for in every step. Time counts from the middle of the
stretch, where amplitude and decay are nearly uncorrelated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

N_PARAMETERS = 5
"""s, ω, A, B and c."""
_N_STEPS = 12
_LARGEST_STEP = 0.2
"""Largest change of s and ω in one step, over ω."""


@dataclass(frozen=True)
class DecayingSine:
    """A fitted decaying sine.

    Attributes
    ----------
    decay_per_s, omega_rad_per_s : float
        s, positive = decaying, and ω.
    amplitude : float
        √(A² + B²), in the middle of the stretch, in the units of the signal.
    unit_std : ndarray, shape (3,)
        Standard errors of s, ω and the amplitude for white noise of standard deviation 1.
    residual : ndarray, shape (n,)
        Signal minus fit.
    jacobian : ndarray, shape (n, 5)
        Derivatives of the fit by s, ω, A, B and c: the directions in which it takes up noise.
    """

    decay_per_s: float
    omega_rad_per_s: float
    amplitude: float
    unit_std: FloatArray
    residual: FloatArray
    jacobian: FloatArray

    @property
    def noise_std(self) -> float:
        """Standard deviation of white noise that leaves this residual."""
        return float(np.sqrt((self.residual**2).sum() / max(self.residual.size - N_PARAMETERS, 1)))


def fit_decaying_sine(
    signal: FloatArray, sampling_rate_hz: float, *, frequency_hz: float, decay_per_s: float = 0.0
) -> DecayingSine:
    """Fit one decaying sine to a stretch of at least one cycle.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        n > 5.
    sampling_rate_hz : float
        Samples per second.
    frequency_hz, decay_per_s : float
        Where the search starts; the frequency within about a third of a cycle over the stretch.

    Returns
    -------
    DecayingSine

    Examples
    --------
    >>> t = np.arange(400) / 100.0
    >>> fit = fit_decaying_sine(np.exp(-0.3 * t) * np.cos(9.0 * t), 100.0, frequency_hz=1.4)
    >>> round(fit.decay_per_s, 6), round(fit.omega_rad_per_s, 6)
    (0.3, 9.0)
    """
    # from the middle, where amplitude and decay are nearly uncorrelated
    time: FloatArray = np.linspace(-0.5, 0.5, signal.size) * ((signal.size - 1) / sampling_rate_hz)
    nonlinear: FloatArray = np.array([decay_per_s, 2 * np.pi * frequency_hz])
    largest = _LARGEST_STEP * nonlinear[1]
    for _ in range(_N_STEPS):
        basis = _basis(time, nonlinear)
        linear = _solved(basis, signal)
        jacobian = _jacobian(time, basis, linear)
        # Gauss–Newton on all five; only s and ω are kept, as the others are solved for exactly in the next round
        step = np.linalg.lstsq(jacobian, signal - basis @ linear, rcond=None)[0][:2]
        nonlinear = np.asarray(nonlinear + np.clip(step, -largest, largest), dtype=np.float64)
        if np.abs(step).max() <= 1e-8 * nonlinear[1]:
            break
    basis = _basis(time, nonlinear)
    linear = _solved(basis, signal)
    return _result(nonlinear, linear, _jacobian(time, basis, linear), np.asarray(signal - basis @ linear))


def _solved(basis: FloatArray, signal: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(basis, signal, rcond=None)[0], dtype=np.float64)


def _basis(time: FloatArray, nonlinear: FloatArray) -> FloatArray:
    # an exponent of 50 is beyond any decay that can be read and keeps a step that goes too far finite
    decay = np.exp(np.clip(-nonlinear[0] * time, -50, 50))
    return np.stack(
        [decay * np.cos(nonlinear[1] * time), decay * np.sin(nonlinear[1] * time), np.ones_like(time)], axis=1
    )


def _jacobian(time: FloatArray, basis: FloatArray, linear: FloatArray) -> FloatArray:
    in_phase = basis[:, 0] * linear[0] + basis[:, 1] * linear[1]
    quadrature = -basis[:, 1] * linear[0] + basis[:, 0] * linear[1]
    return np.column_stack([-time * in_phase, time * quadrature, basis])


def _result(nonlinear: FloatArray, linear: FloatArray, jacobian: FloatArray, residual: FloatArray) -> DecayingSine:
    amplitude = float(np.hypot(linear[0], linear[1]))
    # pseudo-inverse: less than a cycle leaves constant and cosine undetermined
    covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-20)
    # error of √(A² + B²) to first order: along (A, B) only
    direction = linear[:2] / amplitude if amplitude > 0 else np.zeros(2)
    variances = [covariance[0, 0], covariance[1, 1], direction @ covariance[2:4, 2:4] @ direction]
    unit_std = np.sqrt(np.maximum(variances, 0.0))
    return DecayingSine(float(nonlinear[0]), float(nonlinear[1]), amplitude, unit_std, residual, jacobian)
