"""A cantilever wing as a beam that bends and twists: cubic elements in bending, linear ones in torsion.

The beam lies on the elastic axis, root at y = 0. Coordinates of a node: w (up), its slope dw/dy, and θ (nose up).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from sloshlab.aeroelastic.arrays import FloatArray, require_positive, require_shape
from sloshlab.aeroelastic.modal_structure import ModalStructure, of_modes
from sloshlab.errors import AnalysisError


@dataclass(frozen=True)
class WingBeam:
    """Properties of each element, constant along it.

    Attributes
    ----------
    node_m : ndarray, shape (n_elements + 1,)
        y of the nodes, ascending from 0.
    bending_stiffness_n_m2, torsion_stiffness_n_m2 : ndarray, shape (n_elements,)
        EI and GJ.
    mass_kg_per_m : ndarray, shape (n_elements,)
        Mass per length.
    mass_offset_m : ndarray, shape (n_elements,)
        Mass centre behind the elastic axis, aft positive.
    pitch_inertia_kg_m : ndarray, shape (n_elements,)
        Moment of inertia per length about the **elastic axis**.
    """

    node_m: FloatArray
    bending_stiffness_n_m2: FloatArray
    torsion_stiffness_n_m2: FloatArray
    mass_kg_per_m: FloatArray
    mass_offset_m: FloatArray
    pitch_inertia_kg_m: FloatArray

    def __post_init__(self) -> None:
        n_elements = self.node_m.size - 1
        if n_elements < 1 or self.node_m[0] != 0 or np.any(np.diff(self.node_m) <= 0):
            raise AnalysisError("beam nodes", got="places that do not ascend from 0", allowed="0 < y₁ < y₂ …")
        for name in ("bending_stiffness_n_m2", "torsion_stiffness_n_m2", "mass_kg_per_m", "pitch_inertia_kg_m"):
            require_shape(name, getattr(self, name), (n_elements,))
            require_positive(**{name: float(getattr(self, name).min())})
        require_shape("mass_offset_m", self.mass_offset_m, (n_elements,))
        if np.any(self.pitch_inertia_kg_m < self.mass_kg_per_m * self.mass_offset_m**2):
            raise AnalysisError(
                "pitch_inertia_kg_m",
                got="less than mass times offset squared",
                allowed="inertia about the elastic axis",
            )


@dataclass(frozen=True)
class WingModes:
    """Modes with unit modal mass.

    Attributes
    ----------
    structure : ModalStructure
        Undamped.
    node_m : ndarray, shape (n_nodes,)
        y of the nodes.
    deflection, slope, twist_rad : ndarray, shape (n_nodes, n_modes)
        w, dw/dy and θ at the nodes.
    """

    structure: ModalStructure
    node_m: FloatArray
    deflection: FloatArray
    slope: FloatArray
    twist_rad: FloatArray

    def at(self, place_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deflection and twist between the nodes.

        Parameters
        ----------
        place_m : ndarray, shape (n,)
            y within the wing.

        Returns
        -------
        deflection, twist_rad : ndarray, shape (n, n_modes)
        """
        from scipy.interpolate import CubicHermiteSpline

        bent = CubicHermiteSpline(self.node_m, self.deflection, self.slope, axis=0)(place_m)
        twists = [np.interp(place_m, self.node_m, twist) for twist in self.twist_rad.T]
        return np.asarray(bent, dtype=float), np.array(twists).T


def uniform_beam(
    length_m: float,
    *,
    n_elements: int,
    bending_stiffness_n_m2: float,
    torsion_stiffness_n_m2: float,
    mass_kg_per_m: float,
    mass_offset_m: float,
    pitch_inertia_kg_m: float,
) -> WingBeam:
    """A wing that is the same all along.

    Parameters
    ----------
    length_m : float
        Semi-span.
    n_elements : int
        Equal elements.
    bending_stiffness_n_m2, torsion_stiffness_n_m2, mass_kg_per_m, mass_offset_m, pitch_inertia_kg_m : float
        As in `WingBeam`.

    Returns
    -------
    WingBeam
    """
    require_positive(length_m=length_m)

    def everywhere(value: float) -> FloatArray:
        return np.full(n_elements, float(value))

    return WingBeam(
        np.linspace(0.0, length_m, n_elements + 1),
        everywhere(bending_stiffness_n_m2),
        everywhere(torsion_stiffness_n_m2),
        everywhere(mass_kg_per_m),
        everywhere(mass_offset_m),
        everywhere(pitch_inertia_kg_m),
    )


def wing_modes(beam: WingBeam, n_modes: int) -> WingModes:
    """Lowest modes of the clamped wing.

    Parameters
    ----------
    beam : WingBeam
        The wing.
    n_modes : int
        1 … 3 times the number of elements.

    Returns
    -------
    WingModes
        The largest deflection or twist of each mode is positive.

    Raises
    ------
    AnalysisError
        If there are not so many modes.
    """
    mass, stiffness = assembled(beam)
    free = slice(3, None)
    size = mass.shape[0] - 3
    if not 1 <= n_modes <= size:
        raise AnalysisError("modes of the wing", got=f"{n_modes}", allowed=f"1 … {size}")
    # M v = ω⁻² K v: the lowest modes are the largest values and lose no digits to the highest
    inverse_squares, vectors = eigh(
        mass[free, free], stiffness[free, free], subset_by_index=[size - n_modes, size - 1]
    )
    omega = 1 / np.sqrt(inverse_squares[::-1])
    shape = np.vstack([np.zeros((3, n_modes)), vectors[:, ::-1] * omega])
    peak = np.abs(shape).argmax(axis=0)
    shape = shape * np.sign(shape[peak, np.arange(n_modes)])
    return WingModes(of_modes(omega), beam.node_m, shape[0::3], shape[1::3], shape[2::3])


def assembled(beam: WingBeam) -> tuple[FloatArray, FloatArray]:
    """Mass and stiffness over (w, dw/dy, θ) of every node, root included.

    Parameters
    ----------
    beam : WingBeam
        The wing.

    Returns
    -------
    mass, stiffness : ndarray, shape (3 n_nodes, 3 n_nodes)
    """
    n = 3 * beam.node_m.size
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for element, length in enumerate(np.diff(beam.node_m)):
        part = slice(3 * element, 3 * element + 6)
        mass[part, part] += _element_mass(beam, element, float(length))
        stiffness[part, part] += _element_stiffness(beam, element, float(length))
    return mass, stiffness


def _shapes(length: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Places' weights, and deflection, curvature and twist over the six coordinates at four Gauss points."""
    points, weights = np.polynomial.legendre.leggauss(4)
    x = 0.5 * (points + 1)
    zero = np.zeros_like(x)
    h = length
    bent = [1 - 3 * x**2 + 2 * x**3, h * (x - 2 * x**2 + x**3), zero]
    bent += [3 * x**2 - 2 * x**3, h * (x**3 - x**2), zero]
    curved = [(-6 + 12 * x) / h**2, (-4 + 6 * x) / h, zero, (6 - 12 * x) / h**2, (6 * x - 2) / h, zero]
    twisted = [zero, zero, 1 - x, zero, zero, x]
    return 0.5 * h * weights, np.array(bent), np.array(curved), np.array(twisted)


def _element_mass(beam: WingBeam, element: int, length: float) -> FloatArray:
    weights, bent, _, twisted = _shapes(length)
    mass, offset = beam.mass_kg_per_m[element], beam.mass_offset_m[element]
    # a point x behind the axis moves by w − θx
    coupling = -mass * offset * (bent * weights) @ twisted.T
    own = mass * (bent * weights) @ bent.T + beam.pitch_inertia_kg_m[element] * (twisted * weights) @ twisted.T
    return np.asarray(own + coupling + coupling.T, dtype=float)


def _element_stiffness(beam: WingBeam, element: int, length: float) -> FloatArray:
    weights, _, curved, _ = _shapes(length)
    bending = beam.bending_stiffness_n_m2[element] * (curved * weights) @ curved.T
    rate = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 1.0]) / length
    torsion = beam.torsion_stiffness_n_m2[element] * length * np.outer(rate, rate)
    return np.asarray(bending + torsion, dtype=float)
