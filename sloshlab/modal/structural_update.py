"""Structural update: tip mass and bending stiffness of the beam model fitted to measured frequencies."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.optimize import least_squares
from scipy.stats import norm
from scipy.stats import t as student_t

from sloshlab.errors import AnalysisError
from sloshlab.modal.beam_elements import element_modes
from sloshlab.modal.cantilever import Cantilever
from sloshlab.modal.instantaneous_damping import CONFIDENCE
from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class UpdatedBeam:
    """A beam model that meets measured frequencies as well as it can.

    Attributes
    ----------
    beam : Cantilever
        With updated Young's modulus and tip mass.
    tip_mass_kg_std, youngs_modulus_pa_std : float
        Standard errors; NaN with two frequencies of unknown error, which the two parameters meet exactly.
    coverage_factor : float
        Half width of the 90 % interval in standard errors.
    measured_hz, modelled_hz : ndarray, shape (n_modes,)
        Frequencies that were to be met, and those of the updated model.
    """

    beam: Cantilever
    tip_mass_kg_std: float
    youngs_modulus_pa_std: float
    coverage_factor: float
    measured_hz: FloatArray
    modelled_hz: FloatArray

    def to_dataset(self) -> xr.Dataset:
        """Parameters with standard errors, and both sets of frequencies over ``mode_number``."""
        variables = {
            "tip_mass_kg": ((), self.beam.tip_mass_kg),
            "tip_mass_kg_std": ((), self.tip_mass_kg_std),
            "youngs_modulus_pa": ((), self.beam.youngs_modulus_pa),
            "youngs_modulus_pa_std": ((), self.youngs_modulus_pa_std),
            "measured_frequency_hz": ("mode_number", self.measured_hz),
            "natural_frequency_hz": ("mode_number", self.modelled_hz),
        }
        return described(xr.Dataset(variables, {"mode_number": np.arange(1, self.measured_hz.size + 1)}))


def update_beam(
    beam: Cantilever,
    measured_hz: FloatArray,
    *,
    measured_std_hz: FloatArray | None = None,
    n_elements: int = 20,
) -> UpdatedBeam:
    """Fit tip mass and bending stiffness to the measured frequencies of the first modes.

    Parameters
    ----------
    beam : Cantilever
        Where the search starts; dimensions and density stay.
    measured_hz : ndarray, shape (n_modes,)
        Frequencies of modes 1, 2, …; at least two.
    measured_std_hz : ndarray, shape (n_modes,), optional
        Their standard errors; default: equal relative errors, estimated from what the model leaves.
    n_elements : int
        Of the finite-element model.

    Returns
    -------
    UpdatedBeam

    Raises
    ------
    AnalysisError
        If there are fewer than two frequencies, or they do not rise.

    Examples
    --------
    >>> start = Cantilever(0.74, 0.1, 0.01, 70e9, 2700.0, 0.3)
    >>> goal = element_modes(dataclasses.replace(start, tip_mass_kg=0.44), n_modes=2).frequency_hz
    >>> round(update_beam(start, goal).beam.tip_mass_kg, 6)
    0.44
    """
    measured = np.asarray(measured_hz, dtype=np.float64)
    std = np.full(measured.size, np.nan) if measured_std_hz is None else np.asarray(measured_std_hz)
    known = measured_std_hz is not None
    rising = measured.size >= 2 and measured[0] > 0 and bool((np.diff(measured) > 0).all())
    if not rising or std.shape != measured.shape or (known and not (std > 0).all()):
        raise AnalysisError(
            "structural update",
            got=f"frequencies {measured.tolist()}",
            allowed="at least two rising frequencies > 0, standard errors > 0",
        )
    relative = std / measured if known else np.ones(measured.size)
    beam_mass = beam.mass_per_length_kg_per_m * beam.length_m

    def model(parameters: FloatArray) -> Cantilever:
        return dataclasses.replace(
            beam,
            # by its logarithm, which keeps it positive and makes both parameters of size one
            youngs_modulus_pa=beam.youngs_modulus_pa * float(np.exp(parameters[0])),
            tip_mass_kg=beam_mass * max(float(parameters[1]), 0.0),
        )

    def misfit(parameters: FloatArray) -> FloatArray:
        modelled = element_modes(model(parameters), n_modes=measured.size, n_elements=n_elements).frequency_hz
        # relative errors: the third frequency is twenty times the first one
        return np.asarray(np.log(modelled / measured) / relative)

    # away from the bound at zero, where a step to one side only is left
    start = np.array([0.0, max(beam.tip_mass_kg / beam_mass, 1e-3)])
    found = least_squares(misfit, start, bounds=([-5, 0], [5, 1e3]), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    n_free = measured.size - 2
    if known:
        factor = float(norm.ppf(0.5 + CONFIDENCE / 2))
    elif n_free:
        covariance = covariance * 2 * found.cost / n_free
        factor = float(student_t.ppf(0.5 + CONFIDENCE / 2, n_free))
    else:
        # two parameters meet two frequencies exactly: nothing is left to tell an error from
        covariance, factor = covariance * np.nan, float("nan")
    updated = model(found.x)
    return UpdatedBeam(
        beam=updated,
        tip_mass_kg_std=float(np.sqrt(covariance[1, 1])) * beam_mass,
        youngs_modulus_pa_std=float(np.sqrt(covariance[0, 0])) * updated.youngs_modulus_pa,
        coverage_factor=factor,
        measured_hz=measured,
        modelled_hz=element_modes(updated, n_modes=measured.size, n_elements=n_elements).frequency_hz,
    )
