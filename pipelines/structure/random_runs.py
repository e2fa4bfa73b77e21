"""The stages of a random run: spectra, modal fit of H₁, and the first mode from the response alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.structure.results import ModeFit, RandomResponse
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError
from sloshlab.modal.modal_fit import ModalFit, modal_fit_of_spectra
from sloshlab.modal.output_only_fit import DensityFit, fit_density
from sloshlab.modal.rig_modes import ModeNames
from sloshlab.modal.spectra import Spectra, random_spectra

FloatArray = npt.NDArray[np.float64]

TANK: Final = "tank"
"""Name of the tank's acceleration among the outputs: the mean of its accelerometers."""
FIT_RANGE: Final = (0.65, 1.5)
"""Lines that the first mode is fitted to, over its believed frequency."""
_HIGHER_FIT_RANGE: Final = (0.85, 1.18)
_SMALLEST_COHERENCE: Final = 0.6
_LARGEST_RELATIVE_ERROR: Final = 0.5


def random_response(
    root: FloatArray,
    tank: FloatArray,
    outputs: Mapping[str, FloatArray],
    modes: ModeNames,
    segment_s: float,
    sampling_rate_hz: float,
) -> RandomResponse:
    """Spectra and fits of one random run.

    Parameters
    ----------
    root, tank : ndarray, shape (n,)
        Absolute accelerations [m/s²].
    outputs : mapping of str to ndarray
        Everything whose response to the root is wanted; modal accelerations under the names of the modes.
    modes : ModeNames
        Where modes are looked for.
    segment_s : float
        Length of the segments.
    sampling_rate_hz : float
        Samples per second.

    Returns
    -------
    RandomResponse
        A mode that cannot be fitted has the reason instead.
    """
    named = {TANK: tank, **outputs}
    spectra = random_spectra(
        root,
        np.stack(list(named.values())),
        sampling_rate_hz,
        segment_length=round(segment_s * sampling_rate_hz),
        output_names=tuple(named),
    )
    density_fit, reason = _first_mode_alone(spectra, modes.frequency_hz[0])
    return RandomResponse(
        spectra=spectra,
        root_rms_g=_rms(root) / GRAVITY_M_PER_S2,
        tank_rms_g=_rms(tank) / GRAVITY_M_PER_S2,
        tank_peak_g=float(np.nanmax(np.abs(tank))) / GRAVITY_M_PER_S2,
        fits=tuple(_fitted(spectra, modes, mode) for mode in range(len(modes.names))),
        density_fit=density_fit,
        density_reason=reason,
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _first_mode_alone(spectra: Spectra, believed_hz: float) -> tuple[DensityFit | None, str]:
    try:
        fit = fit_density(
            spectra.frequency_hz,
            spectra.output_psd[0],
            frequency_range_hz=(FIT_RANGE[0] * believed_hz, FIT_RANGE[1] * believed_hz),
            n_effective_averages=spectra.normalisation.n_effective_averages,
        )
    except AnalysisError as error:
        return None, str(error)
    return fit, ""


def _fitted(spectra: Spectra, modes: ModeNames, mode: int) -> ModeFit:
    shares = FIT_RANGE if mode == 0 else _HIGHER_FIT_RANGE
    low, high = (share * modes.frequency_hz[mode] for share in shares)
    lines = (spectra.frequency_hz >= low) & (spectra.frequency_hz <= high)
    if not lines.any():
        return ModeFit(mode, None, f"no line between {low:.4g} and {high:.4g} Hz")
    row = spectra.output_names.index(modes.names[mode])
    coherence = float(spectra.coherence[row, lines].max())
    if coherence < _SMALLEST_COHERENCE:
        reason = f"the root does not excite it: coherence at most {coherence:.2f} from {low:.4g} to {high:.4g} Hz"
        return ModeFit(mode, None, reason)
    try:
        fit = modal_fit_of_spectra(spectra.of_outputs([row]), n_modes=1, frequency_range_hz=(low, high))
    except AnalysisError as error:
        return ModeFit(mode, None, str(error))
    return ModeFit(mode, *_checked(fit, low, high))


def _checked(fit: ModalFit, low_hz: float, high_hz: float) -> tuple[ModalFit | None, str]:
    """A pole outside the lines, without a peak, or with an error as large as itself is no mode found."""
    frequency, damping = float(fit.frequency_hz[0]), float(fit.damping_ratio[0])
    if not low_hz <= frequency <= high_hz or not 0 < damping < 0.5:
        return None, f"the pole found, {frequency:.4g} Hz with ζ = {damping:.3g}, is no mode in this range"
    peak = abs(complex(fit.residues[0, 0])) / (damping * 2 * np.pi * frequency)
    if peak < abs(float(fit.fit.constant[0])):
        return None, f"no peak near {frequency:.4g} Hz stands out of what other modes leave there"
    if float(fit.damping_ratio_std[0]) > _LARGEST_RELATIVE_ERROR * damping:
        return None, f"ζ = {damping:.3g} with a standard error of {float(fit.damping_ratio_std[0]):.2g}: not told"
    return fit, ""
