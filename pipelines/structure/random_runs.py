"""The stages of a random run: spectra, modal fit of H₁, and the first mode from the response alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.structure.results import ModeFit, RandomResponse
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError
from sloshlab.modal.output_only_fit import DensityFit, fit_density
from sloshlab.modal.rig_modes import ModeNames
from sloshlab.modal.single_mode_fit import fit_single_mode
from sloshlab.modal.spectra import Spectra, random_spectra

FloatArray = npt.NDArray[np.float64]

TANK: Final = "tank"
"""Name of the tank's acceleration among the outputs: the mean of its accelerometers."""
FIT_RANGE: Final = (0.65, 1.5)
"""Lines that the first mode is fitted to, over its believed frequency."""
_HIGHER_FIT_RANGE: Final = (0.85, 1.18)
"""The same of every other mode."""


def random_response(
    root: FloatArray,
    tank: FloatArray,
    outputs: Mapping[str, FloatArray],
    modes: ModeNames,
    *,
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
        root_rms_g=rms(root) / GRAVITY_M_PER_S2,
        tank_rms_g=rms(tank) / GRAVITY_M_PER_S2,
        tank_peak_g=float(np.nanmax(np.abs(tank))) / GRAVITY_M_PER_S2,
        fits=tuple(_fitted(spectra, modes, mode) for mode in range(len(modes.names))),
        density_fit=density_fit,
        density_reason=reason,
    )


def rms(values: FloatArray) -> float:
    """Root of the mean square of what is not lost."""
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
    low, high = FIT_RANGE if mode == 0 else _HIGHER_FIT_RANGE
    believed = modes.frequency_hz[mode]
    output = spectra.output_names.index(modes.names[mode])
    try:
        return ModeFit(mode, fit_single_mode(spectra, output, (low * believed, high * believed)))
    except AnalysisError as error:
        return ModeFit(mode, None, str(error))
