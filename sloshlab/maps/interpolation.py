"""Radial basis functions through scattered windows, with uncertainty and cross-validation.

SciPy's interpolator is linear in the data. It is therefore applied once to the unit vectors, and
the weights so obtained give the values, their standard errors and every cross-validation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RBFInterpolator

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

KERNEL = "thin_plate_spline"
SMOOTHINGS = (0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Candidates for the smoothing; the one with the smallest cross-validated error is taken."""
_LARGEST_NUMBER_OF_POINTS = 20_000


@dataclass(frozen=True)
class ScatteredField:
    """Values with standard errors at scattered points of the plane.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Coordinates, scaled so that one unit means about the same in both.
    values, std : ndarray, shape (n,)
        Values and their standard errors.
    group : ndarray of int, shape (n,)
        Points of one group come from one run; cross-validation leaves whole runs out.
    """

    points: FloatArray
    values: FloatArray
    std: FloatArray
    group: npt.NDArray[np.intp]

    def __post_init__(self) -> None:
        if not 3 <= self.values.size <= _LARGEST_NUMBER_OF_POINTS:
            raise AnalysisError(
                "map",
                got=f"{self.values.size} windows",
                allowed=f"3 … {_LARGEST_NUMBER_OF_POINTS}",
                remedy="give more runs, or fewer windows (--m)",
            )


@dataclass(frozen=True)
class CrossValidation:
    """Errors of a map at points that were left out.

    Attributes
    ----------
    left_out_windows_rms : float
        RMS error when every tenth window is left out, in the units of the map.
    left_out_runs_rms : float
        RMS error when whole runs are left out and their surroundings must predict them; NaN for one run.
    smoothing : float
        The smoothing that was chosen.
    """

    left_out_windows_rms: float
    left_out_runs_rms: float
    smoothing: float


def interpolated(field: ScatteredField, at: FloatArray, smoothing: float) -> tuple[FloatArray, FloatArray]:
    """Values and standard errors of a field at other points.

    Parameters
    ----------
    field : ScatteredField
        The data.
    at : ndarray, shape (m, 2)
        Where to evaluate, in the coordinates of the field.
    smoothing : float
        0 passes through every point.

    Returns
    -------
    values, std : ndarray, shape (m,)
        The standard errors are those of the data carried through the weights; they do not contain the
        error of the interpolation itself, which `cross_validation` estimates.
    """
    weights = _weights(field.points, at, smoothing)
    return weights @ field.values, np.sqrt(weights**2 @ field.std**2)


def cross_validation(field: ScatteredField, *, n_folds: int = 10) -> CrossValidation:
    """Choose the smoothing and estimate the error of the map at points not measured.

    Whole runs are left out where there are at least three, otherwise every tenth window. The error
    reported belongs to the smoothing chosen by it and is therefore slightly optimistic; six
    candidates leave little to choose from.
    """
    window_folds = [np.arange(field.values.size) % n_folds == fold for fold in range(n_folds)]
    run_folds = _inner_runs(field)
    judging = run_folds or window_folds
    errors = [_left_out_rms(field, judging, smoothing) for smoothing in SMOOTHINGS]
    smoothing = SMOOTHINGS[int(np.nanargmin(errors))]
    return CrossValidation(
        left_out_windows_rms=_left_out_rms(field, window_folds, smoothing),
        left_out_runs_rms=min(errors) if run_folds else float("nan"),
        smoothing=smoothing,
    )


def _inner_runs(field: ScatteredField) -> list[npt.NDArray[np.bool_]]:
    """Runs that have others on both sides in the second coordinate: no extrapolation is judged."""
    groups = np.unique(field.group)
    if groups.size < 3:
        return []
    level = np.array([np.median(field.points[field.group == group, 1]) for group in groups])
    inner = groups[(level > level.min()) & (level < level.max())]
    return [field.group == group for group in inner]


def _left_out_rms(field: ScatteredField, folds: list[npt.NDArray[np.bool_]], smoothing: float) -> float:
    squares, count = 0.0, 0
    for left_out in folds:
        kept = ~left_out
        if kept.sum() < 3 or not left_out.any():
            continue
        interpolator = _interpolator(field.points[kept], field.values[kept], smoothing)
        error = interpolator(field.points[left_out]) - field.values[left_out]
        squares, count = squares + float(error @ error), count + int(left_out.sum())
    return float(np.sqrt(squares / count)) if count else float("nan")


def _weights(points: FloatArray, at: FloatArray, smoothing: float) -> FloatArray:
    """Matrix that turns the values at `points` into the values at `at`; shape (len(at), len(points))."""
    return np.asarray(_interpolator(points, np.eye(points.shape[0]), smoothing)(at))


def _interpolator(points: FloatArray, values: FloatArray, smoothing: float) -> RBFInterpolator:
    distinct = np.ptp(points, axis=0) > 1e-12
    degree = 1 if distinct.all() and np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-6) == 2 else 0
    kernel, epsilon = (KERNEL, None) if degree else ("linear", None)
    return RBFInterpolator(points, values, kernel=kernel, epsilon=epsilon, degree=degree, smoothing=smoothing)
