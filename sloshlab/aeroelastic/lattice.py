"""Pressures on lifting surfaces in subsonic, oscillating flow: doublet lattice, steady part by vortex lattice.

The matrices are PanelAero's (extra ``aircraft``): parabolic doublets after Rodden, Giesing and Kálmán, horseshoe
vortices for k = 0.

References
----------
E. Albano, W. P. Rodden: A doublet-lattice method for calculating lift distributions on oscillating surfaces in
subsonic flows. AIAA Journal 7, 279–285 (1969).
A. Voß: An implementation of the vortex lattice and the doublet lattice method. DLR-IB-AE-GO-2020-137 (2020).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_shape
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.errors import AnalysisError, MissingExtraError

Progress = Callable[[float, float, str], None]
Downwash = Callable[[float], ComplexArray]

_LARGEST_MACH = 0.95


def pressures(
    boxes: Boxes,
    downwash: Downwash,
    reduced_frequency: FloatArray,
    *,
    semi_chord_m: float,
    mach: float,
    progress: Progress | None = None,
) -> Iterator[ComplexArray]:
    """Pressure coefficients by downwash, one frequency after the other.

    Parameters
    ----------
    boxes : Boxes
        Boxes.
    downwash : callable
        At k, shape (n_boxes, m): normal velocity of the air relative to the surface at ¾ chord over U, positive
        along the normal, so that a nose-up rotation and an upward gust are positive.
    reduced_frequency : ndarray, shape (n_k,)
        k = ω b/U ≥ 0.
    semi_chord_m : float
        b.
    mach : float
        0 … 0.95.
    progress : callable, optional
        Takes what is done, what there is to do, and a word.

    Yields
    ------
    ndarray of complex, shape (n_boxes, m)
        Δc_p, positive along the normal, constant over each box.

    Raises
    ------
    AnalysisError
        If Mach number or frequencies are out of range.
    MissingExtraError
        If PanelAero is not installed.
    """
    if not 0 <= mach <= _LARGEST_MACH:
        raise AnalysisError("Mach number", got=f"{mach}", allowed=f"0 … {_LARGEST_MACH}: subsonic, small motion")
    if np.any(~np.isfinite(reduced_frequency)) or np.any(reduced_frequency < 0):
        raise AnalysisError("reduced frequencies", got="negative or not finite ones", allowed="≥ 0")
    vortex, doublet = _panelaero("VLM"), _panelaero("DLM")
    grid = _grid(boxes)
    with np.errstate(all="ignore"):
        # PanelAero divides by zero on the axes of doublets and mends it afterwards
        steady, _ = vortex.calc_Ajj(_copy(grid), mach)
    for index, k in enumerate(reduced_frequency):
        matrix = steady
        if k > 0:
            with np.errstate(all="ignore"):
                matrix = steady + doublet.calc_Ajj(_copy(grid), mach, float(k) / semi_chord_m)
        wash = downwash(float(k))
        require_shape("downwash", wash.real, (boxes.n, -1))
        yield np.asarray(-np.linalg.solve(matrix, wash), dtype=complex)
        if progress is not None:
            progress(index + 1, len(reduced_frequency), f"k = {k:.3g}")


def panelaero_version() -> str:
    """Version of PanelAero.

    Returns
    -------
    str

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("PanelAero")
    except PackageNotFoundError:
        raise _missing() from None


def _missing() -> MissingExtraError:
    return MissingExtraError("PanelAero", extra="aircraft", purpose="the doublet lattice")


def _panelaero(module: str) -> Any:
    # importing it switches off all of NumPy's warnings, for the whole program
    state = np.geterr()
    try:
        return importlib.import_module(f"panelaero.{module}")
    except ImportError:
        raise _missing() from None
    finally:
        np.seterr(**state)


def _grid(boxes: Boxes) -> dict[str, Any]:
    """Boxes as PanelAero names them."""
    return {
        "n": boxes.n,
        "offset_j": boxes.at_chord(0.75),
        "offset_k": boxes.at_chord(0.5),
        "offset_l": boxes.at_chord(0.25),
        "offset_P1": boxes.at_chord(0.25, "left"),
        "offset_P3": boxes.at_chord(0.25, "right"),
        "N": boxes.normal,
        "A": boxes.area_m2,
        "l": boxes.chord_m,
    }


def _copy(grid: dict[str, Any]) -> dict[str, Any]:
    # the vortex lattice stretches x by the Mach number in place
    return {name: np.array(value) if name != "n" else value for name, value in grid.items()}
