"""How well a simulated output fits a measured one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sloshlab.errors import InputError


@dataclass(frozen=True)
class FitQuality:
    """Numbers of one comparison, over the samples where both are known.

    Attributes
    ----------
    rms_error : float
        Root mean square of measured − simulated, in the unit of the output.
    fit_percent : float
        100 (1 − ‖y − ŷ‖/‖y − mean y‖), the usual one; 100 is perfect, 0 is the mean.
    fit_percent_as_printed : float
        100 (1 − ‖y − ŷ‖/‖y − mean ŷ‖), as (2.24) is printed.
    n_samples : int
    """

    rms_error: float
    fit_percent: float
    fit_percent_as_printed: float
    n_samples: int


def fit_quality(measured: ArrayLike, simulated: ArrayLike) -> FitQuality:
    """Compare two outputs on one grid of time.

    Parameters
    ----------
    measured, simulated : array_like, shape (n,)
        NaN where nothing is known.

    Raises
    ------
    InputError
        If lengths differ, or no sample is known in both.

    Examples
    --------
    >>> fit_quality([1.0, -1.0, 1.0, -1.0], [0.5, -0.5, 0.5, -0.5]).fit_percent
    50.0
    """
    y, of_model = np.asarray(measured, float), np.asarray(simulated, float)
    if y.shape != of_model.shape:
        raise InputError("fit", got=f"{y.shape} and {of_model.shape} samples", allowed="equal lengths")
    known = np.isfinite(y) & np.isfinite(of_model)
    if not known.any():
        raise InputError("fit", got="no sample known in both", allowed="at least one")
    y, of_model = y[known], of_model[known]
    error = float(np.linalg.norm(y - of_model))
    # (2.24) is printed with the mean of the model's output; both are given
    usual, printed = (float(np.linalg.norm(y - mean)) for mean in (y.mean(), of_model.mean()))
    return FitQuality(error / np.sqrt(y.size), _percent(error, usual), _percent(error, printed), int(y.size))


def _percent(error: float, spread: float) -> float:
    return 100 * (1 - error / spread) if spread > 0 else (100.0 if error == 0 else -np.inf)
