"""Radial basis functions through scattered windows, with uncertainty and cross-validation.

SciPy's interpolator is linear in the data. It is therefore applied once to the unit vectors, and
the weights so obtained give the values and their standard errors. Points are smoothed in proportion to
the square of their standard error. How much, and in which coordinates distances are taken, is chosen by
leaving whole runs out.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RBFInterpolator

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

KERNEL = "thin_plate_spline"
SMOOTHINGS = (1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Candidates for the smoothing of a point with the median standard error; never zero, as points may coincide."""
DEFAULT_SMOOTHING = 1e-2
"""Smoothing where cross-validation over runs is not possible."""
_SMALLEST_RELATIVE_STD = 0.25
"""Standard errors below this part of the median are raised to it: a few cycles may agree by chance."""
_LARGEST_NUMBER_OF_POINTS = 20_000
# Every candidate solves a dense system of this size for every fold.
_LARGEST_NUMBER_TO_CHOOSE_BY = 600


@dataclass(frozen=True)
class ScatteredField:
    """Values with standard errors at scattered points of the plane.

    Parameters
    ----------
    coordinates : dict of str to ndarray, shape (n, 2)
        Candidates for the coordinates of the points; each scaled so that one unit means about the same
        in both directions.
    values, std : ndarray, shape (n,)
        Values and their standard errors.
    group : ndarray of int, shape (n,)
        Points of one group come from one run; cross-validation leaves whole runs out.
    """

    coordinates: dict[str, FloatArray]
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

    def weights(self, smoothing: float) -> FloatArray:
        """Smoothing of every point, shape (n,)."""
        typical = float(np.median(self.std))
        if smoothing == 0.0 or not typical > 0:
            return np.full(self.values.size, smoothing)
        # a point with twice the error is followed a quarter as closely
        return np.asarray(smoothing * np.maximum(self.std / typical, _SMALLEST_RELATIVE_STD) ** 2)


@dataclass(frozen=True)
class CrossValidation:
    """What a map was interpolated with, and its errors at points that were left out.

    Attributes
    ----------
    left_out_windows_rms : float
        RMS error when every fifth window is left out, in the units of the map.
    left_out_runs_rms : float
        RMS error when whole runs are left out and their surroundings must predict them; NaN for one run.
    coordinates : str
        The coordinates that were chosen.
    smoothing : float
        The smoothing that was chosen.
    """

    left_out_windows_rms: float
    left_out_runs_rms: float
    coordinates: str
    smoothing: float


def interpolated(
    field: ScatteredField, at: dict[str, FloatArray], chosen: CrossValidation
) -> tuple[FloatArray, FloatArray]:
    """Values and standard errors of a field at other points.

    Parameters
    ----------
    field : ScatteredField
        The data.
    at : dict of str to ndarray, shape (m, 2)
        Where to evaluate, in the same coordinates as the field.
    chosen : CrossValidation
        Coordinates and smoothing to use.

    Returns
    -------
    values, std : ndarray, shape (m,)
        The standard errors are those of the data carried through the weights; they do not contain the
        error of the interpolation itself, which `cross_validation` estimates.
    """
    points = field.coordinates[chosen.coordinates]
    # interpolation is linear in the values: its weights, found once, carry values and standard errors alike
    unit_vectors = np.eye(points.shape[0])
    operator = _interpolator(points, unit_vectors, field.weights(chosen.smoothing))(at[chosen.coordinates])
    # errors of windows are taken as independent: they have no cycle in common unless M < 2P
    return operator @ field.values, np.sqrt(operator**2 @ field.std**2)


def cross_validation(field: ScatteredField, *, n_folds: int = 5) -> CrossValidation:
    """Choose coordinates and smoothing, and estimate the error of the map at points not measured.

    The smoothing answers to the scatter of the windows: for each kind of coordinates every fifth window is left
    out. The coordinates answer to the gaps between runs: whole runs are left out. With fewer than three
    runs there is nothing to choose by, and the first coordinates with `DEFAULT_SMOOTHING` are taken. The
    errors reported belong to the choice made by them and are therefore slightly optimistic; twelve candidates
    leave little to choose from.
    """
    runs = _inner_runs(field)
    chosen = (next(iter(field.coordinates)), DEFAULT_SMOOTHING)
    # smoothing is not chosen by left-out runs: on a thinned field that gave too little of it
    if runs:
        thinned = _thinned(field)
        folds = _every(thinned, n_folds)
        smoothest = {
            name: min(SMOOTHINGS, key=functools.partial(_left_out_rms, thinned, folds, name))
            for name in field.coordinates
        }
        chosen = min(smoothest.items(), key=lambda candidate: _left_out_rms(field, runs, *candidate))
    few = field.values.size <= _LARGEST_NUMBER_TO_CHOOSE_BY
    return CrossValidation(
        left_out_windows_rms=_left_out_rms(field, _every(field, n_folds)[: n_folds if few else 2], *chosen),
        left_out_runs_rms=_left_out_rms(field, runs, *chosen),
        coordinates=chosen[0],
        smoothing=chosen[1],
    )


def _thinned(field: ScatteredField) -> ScatteredField:
    """Every k-th point, so that choosing among candidates stays quick."""
    step = -(-field.values.size // _LARGEST_NUMBER_TO_CHOOSE_BY)
    if step == 1:
        return field
    coordinates = {name: points[::step] for name, points in field.coordinates.items()}
    return ScatteredField(coordinates, field.values[::step], field.std[::step], field.group[::step])


def _every(field: ScatteredField, n_folds: int) -> list[npt.NDArray[np.bool_]]:
    # every fifth, not blocks: neighbours along a run stay, so that only scatter is judged
    return [np.arange(field.values.size) % n_folds == fold for fold in range(n_folds)]


def _inner_runs(field: ScatteredField) -> list[npt.NDArray[np.bool_]]:
    """Runs that have others on both sides in the second coordinate: no extrapolation is judged."""
    groups = np.unique(field.group)
    if groups.size < 3:
        return []
    second = next(iter(field.coordinates.values()))[:, 1]
    level = np.array([np.median(second[field.group == group]) for group in groups])
    # the outermost runs could only be extrapolated
    inner = groups[(level > level.min()) & (level < level.max())]
    return [field.group == group for group in inner]


def _left_out_rms(
    field: ScatteredField, folds: list[npt.NDArray[np.bool_]], coordinates: str, smoothing: float
) -> float:
    points, weights = field.coordinates[coordinates], field.weights(smoothing)
    squares, count = 0.0, 0
    for left_out in folds:
        kept = ~left_out
        if kept.sum() < 3 or not left_out.any():
            continue
        interpolator = _interpolator(points[kept], field.values[kept], weights[kept])
        error = interpolator(points[left_out]) - field.values[left_out]
        squares, count = squares + float(error @ error), count + int(left_out.sum())
    return float(np.sqrt(squares / count)) if count else float("nan")


def _interpolator(points: FloatArray, values: FloatArray, smoothing: FloatArray) -> RBFInterpolator:
    # a run by itself may lie on a line, on which a thin plate with a linear part is not determined
    in_the_plane = np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-6) == 2
    kernel, degree = (KERNEL, 1) if in_the_plane else ("linear", 0)
    return RBFInterpolator(points, values, kernel=kernel, degree=degree, smoothing=smoothing)
