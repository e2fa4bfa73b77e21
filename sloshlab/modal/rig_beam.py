"""The beam that a rig file describes by its dimensions and by its modes at the tip: shapes in between.

The file gives no tip mass. It is the one with which a uniform aluminium beam of these dimensions has the first
frequency (0.45 kg for Table 2.4); for a beam of another material, the one that gives the first modal mass. Shapes
and participation are those of this beam, scaled to the tip values of the file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from sloshlab.errors import AnalysisError, RigError
from sloshlab.modal.cantilever import BeamModes, Cantilever, cantilever_modes
from sloshlab.rig import Structure

FloatArray = npt.NDArray[np.float64]

ALUMINIUM_PA: Final = 70e9
ALUMINIUM_KG_PER_M3: Final = 2700.0
"""Material of the beam, which the rig file does not state."""

_LARGEST_MASS_RATIO = 100.0
"""Of the tip to the beam, up to which the tip mass is sought."""
# Two scales of one shape differ by 2.3 and more in Table 2.4.
_MASSES_AGREE = 0.25


# called for every sensor of a simulation; finding the tip mass takes longer than the simulation
@lru_cache(maxsize=64)
def beam_of_rig(described: Structure) -> Cantilever | None:
    """The uniform beam with the tip mass of the module's text; None where the file has no dimensions.

    Raises
    ------
    RigError
        If no tip mass gives the first frequency or the first modal mass.
    """
    if described.length_m is None or described.width_m is None or described.thickness_m is None:
        return None
    bare = Cantilever(
        described.length_m, described.width_m, described.thickness_m, ALUMINIUM_PA, ALUMINIUM_KG_PER_M3
    )

    def frequency_error(tip_kg: float) -> float:
        modes = cantilever_modes(replace(bare, tip_mass_kg=tip_kg), n_modes=1)
        return float(modes.frequency_hz[0]) - described.frequencies_hz[0]

    def mass_error(tip_kg: float) -> float:
        modes = cantilever_modes(replace(bare, tip_mass_kg=tip_kg), n_modes=1)
        # a modal mass goes with the square of the shape's scale
        return described.modal_masses_kg[0] / described.tip_mode_shape[0] ** 2 - float(modes.modal_mass_kg[0])

    largest = _LARGEST_MASS_RATIO * bare.mass_per_length_kg_per_m * bare.length_m
    # the frequency tells the tip mass of an aluminium beam, the modal mass that of a beam of another material
    for error in (frequency_error, mass_error):
        tip = _root(error, largest)
        if tip is not None:
            return replace(bare, tip_mass_kg=tip)
    raise RigError(
        "rig: structure",
        got=f"{described.frequencies_hz[0]:g} Hz and {described.modal_masses_kg[0]:g} kg for mode 1",
        allowed="what an aluminium beam of these dimensions has with some mass at its tip",
        remedy="correct the beam's dimensions, frequencies or modal masses",
    )


def _root(error: Callable[[float], float], largest: float) -> float | None:
    return float(brentq(error, 0.0, largest, xtol=1e-12)) if error(0.0) * error(largest) <= 0 else None


def shapes_at(described: Structure, x_m: npt.ArrayLike) -> FloatArray:
    """Mode shapes of the file's modes at places along the beam, (n_places, n_modes), scaled to its tip values.

    Raises
    ------
    RigError
        If the file has no dimensions, or a place is not on the beam.
    """
    # a copy, because the cached array is shared by all callers
    return _shapes_at(described, tuple(np.atleast_1d(np.asarray(x_m, np.float64)).tolist())).copy()


@lru_cache(maxsize=256)
def _shapes_at(described: Structure, x_m: tuple[float, ...]) -> FloatArray:
    beam = beam_of_rig(described)
    if beam is None:
        raise RigError(
            "rig: structure.length_m", got="nothing", allowed="> 0", remedy="give the beam's dimensions"
        )
    try:
        return np.asarray(_modes(described, beam, x_m).mode_shape * described.tip_mode_shape)
    except AnalysisError as error:
        raise RigError(f"rig: {error}") from error


def base_participation_kg(described: Structure) -> FloatArray | None:
    """Γ = ∫ µ ψ dx + m_tip ψ(l) of (2.31) [kg], shape (n_modes,); None where the file has no dimensions."""
    beam = beam_of_rig(described)
    if beam is None:
        return None
    # the shape may be scaled to any tip value; Γ scales with it
    return np.asarray(_modes(described, beam, [beam.length_m]).base_factor_kg * described.tip_mode_shape)


@dataclass(frozen=True, eq=False)
class Rotation:
    """A rotation of the whole beam about its root, as modes and a remainder that they do not hold.

    Attributes
    ----------
    length_m : float
    of_modes_per_m : ndarray, shape (n_modes,)
        r_i of x ≈ Σ r_i ψ_i: (∫ µ ψ x dx + m_tip l ψ(l)) over the modal mass, both of the beam.
    residual_inertia_kg_m2 : float
        Moment of inertia about the root less Σ r_i² m_i.
    residual_base_kg_m : float
        ∫ µ x dx + m_tip l less Σ r_i Γ_i.
    """

    length_m: float
    of_modes_per_m: FloatArray
    residual_inertia_kg_m2: float
    residual_base_kg_m: float


@lru_cache(maxsize=64)
def rotation_of_beam(described: Structure) -> Rotation | None:
    """A rotation about the root in the file's modes; None where the file has no dimensions."""
    beam = beam_of_rig(described)
    if beam is None:
        return None
    line, length, tip = beam.mass_per_length_kg_per_m, beam.length_m, beam.tip_mass_kg
    nodes, weights = np.polynomial.legendre.leggauss(40 + 4 * len(described.frequencies_hz))
    x = 0.5 * length * (nodes + 1)
    modes = _modes(described, beam, x)
    coupling = 0.5 * length * line * (weights * x) @ modes.mode_shape + tip * length
    of_modes = coupling / modes.modal_mass_kg
    # what the kept modes do not hold of the rotation; without it the base would turn too light
    inertia = line * length**3 / 3 + tip * length**2 - float(of_modes**2 @ modes.modal_mass_kg)
    base = line * length**2 / 2 + tip * length - float(of_modes @ modes.base_factor_kg)
    return Rotation(length, np.asarray(of_modes / described.tip_mode_shape), inertia, base)


def scale_remarks(described: Structure) -> list[str]:
    """What to know about modal masses that a beam with these tip values does not have.

    Table 2.4 tells no scale. Its masses are those of shapes whose largest deflection is one, which for the higher
    modes is not at the tip; stated with a tip value of one they make these modes easier to move by 2.3 and 4.5.

    Examples
    --------
    >>> beam = Structure(kind="beam", length_m=0.74, width_m=0.1, thickness_m=0.01, frequencies_hz=(10.87, 78.31),
    ...     damping_ratios=(0.0032, 0.009), modal_masses_kg=(0.8956, 1.0692), tip_mode_shape=(1.0, 1.0))
    >>> print(scale_remarks(beam)[0])
    mode 2 has 1.069 kg with 1 at the tip, a uniform beam 2.53 kg; scaled to largest deflection 0.982 kg with 0.623
    """
    beam = beam_of_rig(described)
    if beam is None:
        return []
    modes = _modes(described, beam, np.linspace(0.0, beam.length_m, 501))
    remarks = []
    for n, (stated, tip) in enumerate(zip(described.modal_masses_kg, described.tip_mode_shape, strict=True)):
        expected = float(modes.modal_mass_kg[n]) * tip**2
        if abs(stated / expected - 1) > _MASSES_AGREE:
            largest = float(np.abs(modes.mode_shape[:, n]).max())
            remarks.append(
                f"mode {n + 1} has {stated:.4g} kg with {tip:.3g} at the tip, a uniform beam {expected:.3g} kg; "
                f"scaled to largest deflection {modes.modal_mass_kg[n] / largest**2:.3g} kg with {1 / largest:.3g}"
            )
    return remarks


def _modes(described: Structure, beam: Cantilever, x_m: npt.ArrayLike) -> BeamModes:
    n_modes = len(described.frequencies_hz)
    return cantilever_modes(beam, n_modes=n_modes, x_m=np.atleast_1d(np.asarray(x_m, dtype=np.float64)))
