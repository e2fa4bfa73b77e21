"""Whether an aircraft is its own mirror image about y = 0, and which motions are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.model import AircraftModel, AircraftTank
from sloshlab.aircraft.structure import AircraftStructure

FloatArray = npt.NDArray[np.float64]

_OF_RIGID: Final = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
"""Surge, heave and pitch are even; sway, roll and yaw odd."""
_LEAST_PARITY: Final = 0.9
"""Of a mode, from −1 to 1; below it a mode is neither even nor odd."""
_NEAR_M: Final = 5e-3
"""Nodes of a deck that a person typed lie so near their mirror images."""


@dataclass(frozen=True, eq=False)
class MirrorSymmetry:
    """Parities of an aircraft that is nearly its own mirror image.

    Attributes
    ----------
    parity : ndarray, shape (n,)
        Of each generalised coordinate of the aircraft: 1 is even, −1 odd.
    partner : tuple of int
        Of each tank, the one on the other side; itself if it is in the middle.
    sloshing_modes : tuple of int
        Of each tank, in each plane.
    """

    parity: FloatArray
    partner: tuple[int, ...]
    sloshing_modes: tuple[int, ...]

    def halves(self, n_liquids: int) -> tuple[FloatArray, FloatArray]:
        """Orthonormal motions that the mirror leaves as they are, and those that it turns over.

        Parameters
        ----------
        n_liquids : int
            Coordinates of liquids behind those of the aircraft; 0 where they are frozen.

        Returns
        -------
        even, odd : ndarray, shape (n + n_liquids, n_even), (n + n_liquids, n_odd)
        """
        n = self.parity.size
        mirror = np.zeros((n + n_liquids,) * 2)
        mirror[:n, :n] = np.diag(self.parity)
        if n_liquids:
            starts = n + np.concatenate([[0], np.cumsum(2 * np.array(self.sloshing_modes))]).astype(int)
            for number, other in enumerate(self.partner):
                modes = self.sloshing_modes[number]
                # along x as it is, along y the other way
                sides = np.diag(np.repeat([1.0, -1.0], modes))
                own, of_other = (slice(starts[which], starts[which] + 2 * modes) for which in (number, other))
                mirror[own, of_other] = sides
        sign, motions = np.linalg.eigh(mirror)
        return motions[:, sign > 0], motions[:, sign < 0]


def mirror_symmetry(model: AircraftModel) -> MirrorSymmetry | None:
    """Parities of coordinates and partners of tanks; None if there is a mode or a tank without a mirror image.

    Parameters
    ----------
    model : AircraftModel
        A free aircraft; a clamped wing has no mirror image.
    """
    structure = model.structure
    if not structure.is_free:
        return None
    of_modes = _parity_of_modes(structure)
    if of_modes.size and np.abs(of_modes).min() < _LEAST_PARITY:
        return None
    partner = [_partner(model.tanks, tank) for tank in model.tanks]
    if None in partner:
        return None
    whole = np.concatenate([_OF_RIGID, np.sign(of_modes)])
    modes = tuple(tank.n_sloshing_modes for tank in model.tanks)
    return MirrorSymmetry(whole, tuple(number for number in partner if number is not None), modes)


def _parity_of_modes(structure: AircraftStructure) -> FloatArray:
    """Likeness of each mode with its mirror image over nodes that have one, −1 … 1."""
    places = structure.places_m
    apart = np.linalg.norm(places[:, None] * [1.0, -1.0, 1.0] - places[None], axis=2)
    image, paired = apart.argmin(axis=1), apart.min(axis=1) < _NEAR_M
    # displacements alone: rotations have another unit
    own = structure.shapes[:, paired, :3]
    mirrored = structure.shapes[:, image[paired], :3] * [1.0, -1.0, 1.0]
    size = np.einsum("mni,mni->m", own, own)
    return np.asarray(np.einsum("mni,mni->m", own, mirrored) / np.maximum(size, np.finfo(float).tiny))


def _partner(tanks: tuple[AircraftTank, ...], tank: AircraftTank) -> int | None:
    for number, other in enumerate(tanks):
        is_near = np.linalg.norm(tank.place_m * [1.0, -1.0, 1.0] - other.place_m) < _NEAR_M
        is_like = tank.box == other.box and abs(tank.turn_rad + other.turn_rad) < 1e-6
        if is_near and is_like and tank.n_sloshing_modes == other.n_sloshing_modes:
            return number
    return None
