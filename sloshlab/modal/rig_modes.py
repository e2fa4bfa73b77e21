"""Mode shapes of the rig's structure at the sensors of a recording.

Shapes between root and tip are those of the uniform beam that the twin has too, scaled to the stated tip values.
Only the ratio of tip mass to beam mass enters the shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.channel_names import ACCELERATION_ROOF, ACCELERATION_ROOT, ACCELERATION_TIP
from sloshlab.errors import AnalysisError, RigError
from sloshlab.modal.cantilever import Cantilever, cantilever_modes
from sloshlab.modal.modal_filter import ModalFilter, modal_filter
from sloshlab.modal.rig_beam import beam_of_rig
from sloshlab.rig import Rig, Structure

FloatArray = npt.NDArray[np.float64]

_AT_THE_TIP: Final = (ACCELERATION_TIP, ACCELERATION_ROOF)


@dataclass(frozen=True)
class ModeNames:
    """Modes of a structure as the rig states them.

    Attributes
    ----------
    names : tuple of str
        ``mode 1`` … or ``guide``.
    frequency_hz, damping_ratio : tuple of float
        Believed, liquid frozen.
    """

    names: tuple[str, ...]
    frequency_hz: tuple[float, ...]
    damping_ratio: tuple[float, ...]


def structure_of(rig: Rig) -> Structure:
    """The structure of a rig.

    Raises
    ------
    RigError
        If it has none.
    """
    if rig.structure is None:
        raise RigError(
            "rig: structure", got="nothing", allowed="a table [structure]", remedy="describe the beam or the guide"
        )
    return rig.structure


def stated_modes(rig: Rig, n_modes: int | None = None) -> ModeNames:
    """Modes that a rig states, the first `n_modes` of them.

    Parameters
    ----------
    rig : Rig
        With a structure.
    n_modes : int, optional
        Default: all.

    Returns
    -------
    ModeNames
        On a guide one mode: √(K/(m_s + m_l))/2π with the liquid frozen, damping b₁/(2mω) without the dry friction.

    Raises
    ------
    RigError
        If the rig has no structure.
    AnalysisError
        If it states fewer modes.
    """
    structure = structure_of(rig)
    if structure.kind == "sdof":
        if n_modes not in (None, 1):
            raise AnalysisError("number of modes", got=str(n_modes), allowed="1 on a guide")
        # on a guide the mass is stated without the liquid; modal data of a beam contain it frozen
        mass_kg = (structure.mass_kg or 0.0) + rig.liquid_mass_kg
        omega = float(np.sqrt((structure.stiffness_n_per_m or 0.0) / mass_kg))
        damping = (structure.damping_kg_per_s or 0.0) / (2 * mass_kg * omega)
        return ModeNames(("guide",), (omega / (2 * np.pi),), (damping,))
    n_stated = len(structure.frequencies_hz)
    n_kept = n_stated if n_modes is None else n_modes
    if not 1 <= n_kept <= n_stated:
        raise AnalysisError(
            "number of modes", got=str(n_modes), allowed=f"1 … {n_stated}, as structure.frequencies_hz has them"
        )
    names = tuple(f"mode {n}" for n in range(1, n_kept + 1))
    return ModeNames(names, structure.frequencies_hz[:n_kept], structure.damping_ratios[:n_kept])


def uniform_beam(rig: Rig) -> Cantilever:
    """The uniform beam that a rig's structure stands for.

    Raises
    ------
    RigError
        If the structure is no beam, dimensions are missing, or no tip mass suits its modes.

    Examples
    --------
    >>> rig = Rig.from_toml_text('''
    ... tank = {height_m = 0.0272, length_m = 0.1172, width_m = 0.0780, dry_mass_kg = 0.314}
    ... liquid = {density_kg_per_m3 = 1000.0, fill_level = 0.5}
    ... [structure]
    ... kind = "beam"
    ... length_m = 0.74
    ... width_m = 0.10
    ... thickness_m = 0.01
    ... frequencies_hz = [10.87]
    ... damping_ratios = [0.0032]
    ... modal_masses_kg = [0.8956]
    ... tip_mode_shape = [1.0]
    ... ''')
    >>> round(uniform_beam(rig).tip_mass_kg, 2)
    0.45
    """
    structure = structure_of(rig)
    beam = beam_of_rig(structure) if structure.kind == "beam" else None
    if beam is None:
        got = f"kind {structure.kind!r}" if structure.kind != "beam" else "no length_m, width_m or thickness_m"
        raise RigError("rig: structure", got=got, allowed="a beam with its dimensions", remedy="measure the beam")
    return beam


def sensor_places_m(places_m: Mapping[str, float | None], length_m: float) -> dict[str, float]:
    """Places of accelerometers along the beam, from the root.

    Parameters
    ----------
    places_m : mapping of str to float or None
        What the recording states; None where it states nothing.
    length_m : float
        Of the beam; where tip and tank are.

    Returns
    -------
    dict
        ``acceleration_tip…`` and ``acceleration_roof…`` are at the tip and ``acceleration_root`` at the root where
        nothing is stated.

    Raises
    ------
    AnalysisError
        If a place is not known or not on the beam.

    Examples
    --------
    >>> sensor_places_m({"acceleration_tip": None, "acceleration_beam_1": 0.3}, 0.74)
    {'acceleration_tip': 0.74, 'acceleration_beam_1': 0.3}
    """
    known = {}
    for name, stated in places_m.items():
        place = stated
        if place is None and name.startswith(_AT_THE_TIP):
            # the tank is at the tip, and so are its roof accelerometers
            place = length_m
        if place is None and name.startswith(ACCELERATION_ROOT):
            place = 0.0
        if place is None or not 0 <= place <= length_m * (1 + 1e-6):
            raise AnalysisError(
                f"place of {name}",
                got="no attribute x_m" if place is None else f"x_m = {place:g}",
                allowed=f"0 … {length_m:g} m from the root",
                remedy="state x_m in the channel map",
            )
        known[name] = min(place, length_m)
    return known


def rig_modal_filter(rig: Rig, places_m: Mapping[str, float], *, n_modes: int | None = None) -> ModalFilter:
    """Modal filter of a rig's beam for accelerometers at known places.

    Parameters
    ----------
    rig : Rig
        With a beam.
    places_m : mapping of str to float
        Sensors and their distances from the root [m].
    n_modes : int, optional
        Default: all that the rig states.

    Returns
    -------
    ModalFilter
        Modal coordinates in the scale of the rig's `tip_mode_shape`.

    Raises
    ------
    AnalysisError
        If the sensors cannot see a mode; the message names it.
    """
    names = stated_modes(rig, n_modes).names
    structure, beam = structure_of(rig), uniform_beam(rig)
    tip = np.asarray(structure.tip_mode_shape[: len(names)])
    # along the whole beam, as the largest deflection of a higher mode need not be at a sensor
    along = cantilever_modes(beam, n_modes=len(names)).mode_shape * tip
    # ψ is 1 at the tip in the closed form; a rig may state another scale
    at_sensors = _shapes_at(beam, list(places_m.values()), len(names)) * tip
    return modal_filter(
        at_sensors,
        sensor_names=list(places_m),
        mode_names=names,
        largest_deflection=np.abs(along).max(axis=0),
    )


def _shapes_at(beam: Cantilever, places_m: Sequence[float], n_modes: int) -> FloatArray:
    if not places_m:
        raise AnalysisError(
            "sensors along the beam",
            got="no accelerometer beyond the root",
            allowed="acceleration_tip or acceleration_beam_1 … with x_m",
        )
    return cantilever_modes(beam, n_modes=n_modes, x_m=np.asarray(places_m, dtype=np.float64)).mode_shape
