"""Air around a beam wing: the doublet lattice by the nodes of its beam, once; from it the air of any modes of it.

Forces are linear in the motion of the nodes, so that a wing whose stiffness changes needs no new lattice.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sloshlab.aeroelastic.generalised_force_cache import CacheStatus, cached_generalised_forces
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces, generalised_forces
from sloshlab.aeroelastic.gust import gust_fit
from sloshlab.aeroelastic.lattice import Progress
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.beam_wing import box_motion_of_nodes, nodes_per_mode, wing_boxes
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.aircraft.wing_file import WingAerodynamics, WingDescription


@dataclass(frozen=True, eq=False)
class WingAir:
    """Forces of the air on the modes of a wing.

    Attributes
    ----------
    table : GeneralisedForces
        Over the reduced frequency.
    motion, gust : RationalForces
        Their fits, by the modes and by w_g/U of a gust that is the same everywhere.
    """

    table: GeneralisedForces
    motion: RationalForces
    gust: RationalForces


def air_on_nodes(
    described: WingDescription, mach: float, *, cache: Path | None = None, progress: Progress | None = None
) -> tuple[GeneralisedForces, CacheStatus]:
    """Generalised forces by the components of the nodes.

    Parameters
    ----------
    described : WingDescription
    mach : float
    cache : Path, optional
        Folder that keeps them.
    progress : callable, optional
        As for `sloshlab.aeroelastic.generalised_forces.generalised_forces`.

    Returns
    -------
    GeneralisedForces
        Coordinates as of `box_motion_of_nodes`.
    CacheStatus
    """
    boxes, chosen = wing_boxes(described), described.aerodynamics
    motion, k, b = box_motion_of_nodes(described.wing, boxes), chosen.reduced_frequencies, chosen.semi_chord_m
    if cache is None:
        made = generalised_forces(boxes, motion, k, semi_chord_m=b, mach=mach, progress=progress)
        return made, CacheStatus.MADE
    return cached_generalised_forces(cache, boxes, motion, k, semi_chord_m=b, mach=mach, progress=progress)


def air_on_modes(nodes: GeneralisedForces, structure: AircraftStructure, chosen: WingAerodynamics) -> WingAir:
    """Forces on and by the modes of a wing.

    Parameters
    ----------
    nodes : GeneralisedForces
        As `air_on_nodes` gives them.
    structure : AircraftStructure
        Of the same nodes.
    chosen : WingAerodynamics
        How to fit.
    """
    table = nodes.transferred(nodes_per_mode(structure))
    return WingAir(table, chosen.fitted(table.motion, table.semi_chord_m), gust_fit(table))
