"""One mode of a random run in its own range of frequencies, or why it cannot be told."""

from __future__ import annotations

from typing import Final

import numpy as np

from sloshlab.errors import AnalysisError
from sloshlab.modal.modal_fit import ModalFit, modal_fit_of_spectra
from sloshlab.modal.spectra import Spectra

_SMALLEST_COHERENCE: Final = 0.6
_LARGEST_RELATIVE_ERROR: Final = 0.5
_LARGEST_DAMPING: Final = 0.5


def fit_single_mode(spectra: Spectra, output: int, frequency_range_hz: tuple[float, float]) -> ModalFit:
    """Fit one mode to H₁ of one output.

    Parameters
    ----------
    spectra : Spectra
        From `sloshlab.modal.spectra.random_spectra`.
    output : int
        Row of the output, such as a modal acceleration.
    frequency_range_hz : tuple of float
        Lines that are used; the pole must lie among them, too.

    Returns
    -------
    ModalFit
        Of one mode.

    Raises
    ------
    AnalysisError
        If there is no line, the input does not excite the mode, or what was fitted is no mode: a pole outside the
        lines, without a peak, or with an error as large as itself.
    """
    low, high = frequency_range_hz
    lines = (spectra.frequency_hz >= low) & (spectra.frequency_hz <= high)
    if not lines.any():
        raise AnalysisError(f"no line between {low:.4g} and {high:.4g} Hz")
    # the largest within the range: it falls between modes and where the liquid answers by itself
    coherence = float(spectra.coherence[output, lines].max())
    if coherence < _SMALLEST_COHERENCE:
        raise AnalysisError(
            f"the root does not excite it: coherence at most {coherence:.2f} from {low:.4g} to {high:.4g} Hz"
        )
    fit = modal_fit_of_spectra(spectra.of_outputs([output]), n_modes=1, frequency_range_hz=frequency_range_hz)
    _refuse_what_is_no_mode(fit, low, high)
    return fit


def _refuse_what_is_no_mode(fit: ModalFit, low_hz: float, high_hz: float) -> None:
    frequency, damping = float(fit.frequency_hz[0]), float(fit.damping_ratio[0])
    if not low_hz <= frequency <= high_hz or not 0 < damping < _LARGEST_DAMPING:
        raise AnalysisError(f"the pole found, {frequency:.4g} Hz with ζ = {damping:.3g}, is no mode in this range")
    # |R/(jω − p)| at ω = |p| is |R|/(ζ|p|); the constant of the fit is what modes outside the range leave
    peak = abs(complex(fit.residues[0, 0])) / (damping * 2 * np.pi * frequency)
    if peak < abs(float(fit.fit.constant[0])):
        raise AnalysisError(f"no peak near {frequency:.4g} Hz stands out of what other modes leave there")
    error = float(fit.damping_ratio_std[0])
    if error > _LARGEST_RELATIVE_ERROR * damping:
        raise AnalysisError(f"ζ = {damping:.3g} with a standard error of {error:.2g}: not told")
