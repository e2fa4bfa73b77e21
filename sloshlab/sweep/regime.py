"""What the liquid does in a window: quiet, Faraday waves, impacts, or chaos.

The dynamic force d of a window is split by power into what repeats every cycle at Ω, what repeats
at the harmonics 2Ω … 5Ω, what repeats every second cycle (Ω/2 and 3Ω/2), and the rest, which does
not repeat. The label is the largest of the last three shares; no threshold is needed between them.
Two rules come before it.
A window is quiet if everything in d but its inertial part, which is in phase with the acceleration,
is small against the inertia of the liquid. A window that dissipates smoothly, with nothing but the
fundamental, is counted with the waves, whatever its largest share: nothing hits and nothing breaks, and
Faraday waves answer synchronously with the tank as well as at a half and three halves of its frequency (1.4.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

QUIET, FARADAY, IMPACTS, CHAOTIC = "quiet", "Faraday", "impacts", "chaotic"
REGIMES = (QUIET, FARADAY, IMPACTS, CHAOTIC)

QUIET_FORCE_RATIO = 0.05
"""A window is quiet if the RMS of d without its inertial part is below this part of the liquid's inertia."""


@dataclass(frozen=True)
class Regime:
    """Label of one window and the numbers that decide it.

    Attributes
    ----------
    label : str
        One of `REGIMES`.
    force_ratio : float
        RMS of d without its inertial part (at Ω in phase with the acceleration), over the RMS of the
        reference force.
    subharmonic_share, harmonic_share, unrepeated_share : float
        Shares of the power of d without its fundamental; they add up to one.
    crest_factor : float
        Largest |d| over the RMS of d, mean over cycles.
    """

    label: str
    force_ratio: float
    subharmonic_share: float
    harmonic_share: float
    unrepeated_share: float
    crest_factor: float


def classify(
    dynamic_phasor: ComplexArray,
    subharmonic_phasor: ComplexArray,
    dynamic_power: FloatArray,
    dynamic_peak: FloatArray,
    *,
    reference_force_n: float,
    noise_power: float = 0.0,
) -> Regime:
    """Label a window of consecutive cycles.

    Parameters
    ----------
    dynamic_phasor : ndarray, shape (n_pairs, 5)
        Amplitudes of d at Ω … 5Ω relative to the phase of the acceleration, each the mean over two
        consecutive cycles [N].
    subharmonic_phasor : ndarray, shape (n_pairs, 2)
        Amplitudes of d at Ω/2 and 3Ω/2, each the mean over two consecutive cycles [N].
    dynamic_power : ndarray, shape (n_cycles,)
        Mean square of d [N²].
    dynamic_peak : ndarray, shape (n_cycles,)
        Largest |d| [N].
    reference_force_n : float
        Amplitude of the inertia of the liquid m_l a₀ [N], or of the whole force where there is no tank.
    noise_power : float
        Mean square of d that sensor noise alone would give [N²].

    Returns
    -------
    Regime
    """
    # the mean of complex amplitudes: what keeps no phase against the motion averages out
    repeated = dynamic_phasor.mean(axis=0)
    # sensor noise does not repeat and would count as chaos
    total = max(float(dynamic_power.mean()) - noise_power, 0.0)
    others = max(total - 0.5 * abs(repeated[0]) ** 2, 0.0)
    # the mean over n phasors keeps 1/n of the power of what does not repeat; take it out again
    harmonic = _unbiased_power(dynamic_phasor[:, 1:])
    subharmonic = _unbiased_power(subharmonic_phasor)
    explained = harmonic + subharmonic
    # Shares add up to one also where rounding explains more than there is; never divided by zero.
    scale = max(others, explained, np.finfo(float).tiny)
    shares = (subharmonic / scale, harmonic / scale, max(scale - explained, 0.0) / scale)
    # Only the part in phase with the acceleration is left out, which is β. The part in quadrature is dissipation
    # and keeps a window from being quiet.
    not_inertial = max(total - 0.5 * float(repeated[0].real) ** 2, 0.0)
    force_ratio = (
        float(np.sqrt(not_inertial) / (reference_force_n / np.sqrt(2))) if reference_force_n > 0 else np.nan
    )
    rms = np.sqrt(np.maximum(dynamic_power, np.finfo(float).tiny))
    beside_fundamental = np.sqrt(2 * others) / reference_force_n if reference_force_n > 0 else np.nan
    if force_ratio < QUIET_FORCE_RATIO:
        label = QUIET
    # of a smooth response that dissipates the shares are rounding, which must not decide
    elif beside_fundamental < QUIET_FORCE_RATIO:
        label = FARADAY
    else:
        label = (FARADAY, IMPACTS, CHAOTIC)[int(np.argmax(shares))]
    return Regime(label, force_ratio, *shares, crest_factor=float((dynamic_peak / rms).mean()))


def _unbiased_power(phasor: ComplexArray) -> float:
    """Power of the part of phasors that repeats, its own scatter removed; shape (n, k) → scalar."""
    n = phasor.shape[0]
    # a single pair cannot tell what repeats from what does not
    if n < 2:
        return 0.0
    mean = np.abs(phasor.mean(axis=0)) ** 2
    # NumPy's variance of complex numbers is that of both parts together, as |mean|² needs it
    scatter = phasor.var(axis=0, ddof=1) / n
    return float(0.5 * np.maximum(mean - scatter, 0.0).sum())
