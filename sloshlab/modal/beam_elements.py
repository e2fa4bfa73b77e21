"""Euler–Bernoulli beam by finite elements: cubic Hermite elements, consistent mass, point masses.

Slower than the closed form and not tied to it: any point masses anywhere, and the check of the closed form.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from sloshlab.errors import AnalysisError
from sloshlab.modal.cantilever import BeamModes, Cantilever

FloatArray = npt.NDArray[np.float64]

_LARGEST_N_ELEMENTS = 500


def element_modes(
    beam: Cantilever,
    *,
    n_modes: int,
    n_elements: int = 20,
    tip_inertia_kg_m2: float = 0.0,
    tip_offset_m: float = 0.0,
) -> BeamModes:
    """Modes of the cantilever by finite elements; frequencies are above the true ones and converge as n⁻⁴.

    Parameters
    ----------
    beam : Cantilever
        The beam.
    n_modes : int
        1 … 2 n_elements.
    n_elements : int
        Equal elements, at most 500.
    tip_inertia_kg_m2 : float
        Moment of inertia of the tip mass about its own centre, ≥ 0.
    tip_offset_m : float
        Distance of its centre beyond the tip along the beam.

    Returns
    -------
    BeamModes
        Shapes at the nodes.

    Raises
    ------
    AnalysisError
        If the numbers are not allowed.

    Examples
    --------
    >>> steel = Cantilever(1.0, 0.05, 0.01, 210e9, 7850.0)
    >>> element_modes(steel, n_modes=2).frequency_hz.round(3).tolist()
    [8.355, 52.361]
    """
    if not (1 <= n_elements <= _LARGEST_N_ELEMENTS and 1 <= n_modes <= 2 * n_elements and tip_inertia_kg_m2 >= 0):
        raise AnalysisError(
            "beam elements",
            got=f"{n_elements} elements, {n_modes} modes, tip inertia {tip_inertia_kg_m2}",
            allowed=f"1 … {_LARGEST_N_ELEMENTS} elements, modes up to twice their number, inertia ≥ 0",
        )
    stiffness, mass = _assembled(beam, n_elements)
    # a rigid body beyond the tip: its centre moves with deflection and slope of the last node
    mass[-2, -2] += beam.tip_mass_kg
    mass[-1, -2] += beam.tip_mass_kg * tip_offset_m
    mass[-2, -1] += beam.tip_mass_kg * tip_offset_m
    mass[-1, -1] += tip_inertia_kg_m2 + beam.tip_mass_kg * tip_offset_m**2
    # clamped: deflection and slope of the root are zero
    free = slice(2, None)
    # M v = ω⁻² K v: the lowest modes are the largest values here and lose no digits to the highest
    size = mass.shape[0] - 2
    inverse_squares, vectors = eigh(
        mass[free, free], stiffness[free, free], subset_by_index=[size - n_modes, size - 1]
    )
    # ψ = 1 at the tip
    vectors = vectors[:, ::-1] / vectors[-2, ::-1]
    # a translation of the whole beam, whose inertia is what a moving base exerts (2.31)
    rigid = np.zeros(mass.shape[0])
    rigid[0::2] = 1.0
    shape = np.vstack([np.zeros((2, n_modes)), vectors])
    return BeamModes(
        frequency_hz=1 / np.sqrt(inverse_squares[::-1]) / (2 * np.pi),
        modal_mass_kg=np.einsum("im,ij,jm->m", shape, mass, shape),
        base_factor_kg=rigid @ mass @ shape,
        x_m=np.linspace(0, beam.length_m, n_elements + 1),
        mode_shape=shape[0::2],
    )


def _assembled(beam: Cantilever, n_elements: int) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass over deflection and slope at every node, root included."""
    length = beam.length_m / n_elements
    n_unknowns = 2 * (n_elements + 1)
    stiffness, mass = np.zeros((n_unknowns, n_unknowns)), np.zeros((n_unknowns, n_unknowns))
    own_stiffness = _element_stiffness(beam.bending_stiffness_n_m2, length)
    own_mass = _element_mass(beam.mass_per_length_kg_per_m, length)
    for element in range(n_elements):
        part = slice(2 * element, 2 * element + 4)
        stiffness[part, part] += own_stiffness
        mass[part, part] += own_mass
    return stiffness, mass


def _element_stiffness(bending_stiffness_n_m2: float, length_m: float) -> FloatArray:
    h = length_m
    return (
        bending_stiffness_n_m2
        / h**3
        * np.array(
            [
                [12, 6 * h, -12, 6 * h],
                [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                [-12, -6 * h, 12, -6 * h],
                [6 * h, 2 * h**2, -6 * h, 4 * h**2],
            ]
        )
    )


def _element_mass(mass_per_length_kg_per_m: float, length_m: float) -> FloatArray:
    h = length_m
    return (
        mass_per_length_kg_per_m
        * h
        / 420
        * np.array(
            [
                [156, 22 * h, 54, -13 * h],
                [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                [54, 13 * h, 156, -22 * h],
                [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
            ]
        )
    )
