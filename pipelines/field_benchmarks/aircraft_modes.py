"""Real modes of a structure that one force drives, from its frequency responses, and the twin that they make.

    A_o(s)/F(s) = Σ_m φ_om φ_dm s²/(s² + 2 ζ_m ω_m s + ω_m²) + r_o

with the drive point d among the outputs o, which gives the scale of every mode; r_o stands for modes above.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sloshlab.errors import AnalysisError
from sloshlab.user_twin import Compared, MechanicalTwin, Mechanism, Parameter, Reading, TwinRun

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
FREQUENCY, DAMPING = "frequency of the nonlinear mode", "damping ratio of the nonlinear mode"
_FIRST_DAMPING: Final = 0.007
_SCALES: Final = (0.01, 0.001)
"""Of frequencies [Hz] and damping ratios in the fit."""


@dataclass(frozen=True, eq=False)
class RealModes:
    """Modes of unit modal mass.

    Attributes
    ----------
    frequency_hz, damping_ratio : ndarray, shape (n_modes,)
    shape : ndarray, shape (n_outputs, n_modes)
        [kg^−½]; the first output is the drive point.
    residual_per_kg : ndarray, shape (n_outputs,)
        Acceleration per force of what lies above the band.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shape: FloatArray
    residual_per_kg: FloatArray


def real_modes(frequency_hz: FloatArray, response: ComplexArray, starts_hz: Sequence[float]) -> RealModes:
    """Least-squares fit of real modes.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n_lines,)
    response : ndarray of complex, shape (n_outputs, n_lines)
        Acceleration per force [1/kg]; the first output is the drive point.
    starts_hz : sequence of float
        Near the modes.

    Raises
    ------
    AnalysisError
        If a mode does not move the drive point with the force.
    """
    n = len(starts_hz)
    start = np.concatenate([starts_hz, np.full(n, _FIRST_DAMPING)])
    scale = np.repeat(_SCALES, n)
    found = least_squares(lambda x: _misfit(frequency_hz, response, x[:n], x[n:])[1], start, x_scale=scale).x
    products, _ = _misfit(frequency_hz, response, found[:n], found[n:])
    if not (products[0, :n] > 0).all():
        raise AnalysisError("modes of the structure", got="a drive point that moves against its force")
    return RealModes(found[:n], found[n:], products[:, :n] / np.sqrt(products[0, :n]), products[:, n])


def _misfit(
    frequency_hz: FloatArray, response: ComplexArray, modes_hz: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Products of shapes (n_outputs, n_modes + 1), linear least squares, and what is left of all responses."""
    s, omega = 2j * np.pi * frequency_hz[:, None], 2 * np.pi * modes_hz
    basis = np.hstack([s**2 / (s**2 + 2 * damping * omega * s + omega**2), np.ones_like(s)])
    stacked = np.vstack([basis.real, basis.imag])
    right = np.hstack([response.real, response.imag]).T
    products = np.linalg.lstsq(stacked, right, rcond=None)[0]
    return products.T, (stacked @ products - right).ravel()


def modal_twin(modes: RealModes, outputs: Sequence[str], force: str, nonlinear: int) -> MechanicalTwin:
    """A twin whose added forces act on one mode, along the motion that the second output has in it.

    Parameters
    ----------
    modes : RealModes
    outputs : sequence of str
        Channels, the drive point first.
    force : str
        Channel of the driving force.
    nonlinear : int
        Number of the mode; its frequency and damping are parameters.
    """

    def mechanism(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
        omega, damping = 2 * np.pi * modes.frequency_hz, modes.damping_ratio.copy()
        omega[nonlinear], damping[nonlinear] = 2 * np.pi * values[FREQUENCY], values[DAMPING]
        driving = run.channels[force]
        along = np.zeros(omega.size)
        along[nonlinear] = modes.shape[1, nonlinear]
        return Mechanism(
            mass_kg=np.eye(omega.size),
            stiffness_n_per_m=np.diag(omega**2),
            damping_n_s_per_m=np.diag(2 * damping * omega),
            driving_force_n=driving,
            driven_along=modes.shape[0],
            acts_along=along,
            readings={
                name: Reading(acceleration=modes.shape[k], plus=modes.residual_per_kg[k] * driving)
                for k, name in enumerate(outputs)
            },
        )

    return MechanicalTwin(
        parameters=(
            Parameter(FREQUENCY, float(modes.frequency_hz[nonlinear]), 0.15, "Hz"),
            Parameter(DAMPING, float(modes.damping_ratio[nonlinear]), 0.004),
        ),
        driving=(force,),
        compared={name: Compared("m s-2", gain_tolerance=0.0) for name in outputs},
        mechanism=mechanism,
    )
