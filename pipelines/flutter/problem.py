"""What a model file becomes before its flutter is sought: structures, forces of the air, and how to draw modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.flutter.checks import ModelCheck, checks_of
from pipelines.flutter.model_file import WingModel
from pipelines.report.progress import progress
from sloshlab.aeroelastic.bending_torsion_beam import WingModes
from sloshlab.aeroelastic.cantilever_wing import CantileverWing
from sloshlab.aeroelastic.generalised_force_cache import CacheStatus, cached_generalised_forces
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces, generalised_forces
from sloshlab.aeroelastic.gust import gust_fit
from sloshlab.aeroelastic.modal_structure import ModalStructure, of_modes
from sloshlab.aeroelastic.p_k import Forces
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.root_locus import System
from sloshlab.aeroelastic.splines import BoxMotion
from sloshlab.aeroelastic.state_space import system_over_speed
from sloshlab.aeroelastic.strip import strip_table
from sloshlab.aircraft.air_of_free_flight import air_of_free_flight
from sloshlab.aircraft.flight_stability import LIQUIDS, Liquids, flight_system
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.model import AircraftModel, RationalFit
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class BeamShapes:
    """Modes of a beam wing, to be drawn by their edges."""

    wing: CantileverWing
    modes: WingModes


@dataclass(frozen=True, eq=False)
class BoxShapes:
    """Modes of an aircraft, to be drawn by its boxes: displacement along the normal, shape (n_boxes, n_modes)."""

    boxes: Boxes
    displacement: FloatArray
    frequency_rad_per_s: FloatArray


@dataclass(frozen=True, eq=False)
class Variant:
    """One of the models of a file whose stability is sought.

    Attributes
    ----------
    name : str
        ``frozen`` or ``lateral`` liquids, or ``wing`` that carries none.
    structure : ModalStructure
        For p-k.
    forces : callable
        Q(k) of its coordinates.
    matrix_at : callable
        State matrix at a speed, for the root locus.
    rigid : tuple of str
        Coordinates of the body as a whole.
    """

    name: str
    structure: ModalStructure
    forces: Forces
    matrix_at: System
    rigid: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FlownAircraft:
    """What a gust response of an aircraft needs beside the forces of its own motion.

    Attributes
    ----------
    model : AircraftModel
    gust : RationalForces
        By w_g/U that is the same everywhere.
    """

    model: AircraftModel
    gust: RationalForces


def _no_checks(speed_m_per_s: float) -> tuple[ModelCheck, ...]:
    """Of a wing of stations, whose numbers are checked by themselves."""
    return ()


@dataclass(frozen=True, eq=False)
class FlutterProblem:
    """A model file, ready.

    Attributes
    ----------
    name, method : str
        Of the wing or aircraft, and of its forces.
    density_kg_per_m3 : float
    fit : RationalFit
        As chosen in the file.
    shapes : BeamShapes or BoxShapes
    reduced_frequency, table : ndarray, shapes (n_k,), (n_k, n, n)
        Generalised forces over q_D.
    rational : RationalForces
        Their fit.
    variants : tuple of Variant
    cache : CacheStatus or None
        Where the table is from; None for strips.
    checks : callable
        Identities that must hold of the model, at a speed.
    flown : FlownAircraft or None
        The aircraft and what a gust does to it; None of a wing of stations.
    """

    name: str
    method: str
    density_kg_per_m3: float
    fit: RationalFit
    shapes: BeamShapes | BoxShapes
    reduced_frequency: FloatArray
    table: ComplexArray
    rational: RationalForces
    variants: tuple[Variant, ...]
    cache: CacheStatus | None = None
    checks: Callable[[float], tuple[ModelCheck, ...]] = _no_checks
    flown: FlownAircraft | None = None


def problem_of(model: WingModel | AircraftModel, liquids: Sequence[str], cache: Path | None) -> FlutterProblem:
    """Compute modes and forces of the air.

    Parameters
    ----------
    model : WingModel or AircraftModel
    liquids : sequence of str
        Variants of an aircraft; empty for those that it can have. A wing has none.
    cache : Path or None
        Folder that keeps generalised forces of the doublet lattice.

    Raises
    ------
    InputError
        If a variant is unknown, or there is none of it.
    """
    if isinstance(model, WingModel):
        if liquids:
            raise InputError(
                "--models", got=", ".join(liquids), allowed="an aircraft; a wing of stations has no tanks"
            )
        return _of_wing(model, cache)
    chosen = _liquids(model, liquids)
    return _of_aircraft(model, chosen, cache)


def _liquids(model: AircraftModel, asked: Sequence[str]) -> tuple[Liquids, ...]:
    strange = [name for name in asked if name not in LIQUIDS]
    if strange or len(set(asked)) != len(asked):
        raise InputError("--models", got=",".join(asked), allowed=f"{', '.join(LIQUIDS)}, each once")
    if not model.tanks and any(name != "frozen" for name in asked):
        raise InputError("--models", got=",".join(asked), allowed="frozen; the model has no [[tanks]]")
    if asked:
        return tuple(name for name in LIQUIDS if name in asked)
    return LIQUIDS if model.tanks else LIQUIDS[:1]


def _of_wing(model: WingModel, cache: Path | None) -> FlutterProblem:
    wing, chosen, density = model.wing, model.aerodynamics, model.flow.density_kg_per_m3
    modes = wing.modes(model.structure.n_modes, n_elements=model.structure.n_elements)
    structure = of_modes(modes.structure.natural_frequency_rad_per_s, damping_ratio=model.structure.damping_ratio)
    k = chosen.reduced_frequencies
    forces: Forces
    status: CacheStatus | None = None
    if chosen.method == "strips":
        forces = strip_table(wing.strips(modes, chosen.n_span), semi_chord_m=wing.semi_chord_m)
        table = np.array([forces(float(value)) for value in k])
    else:
        boxes = wing.boxes(chosen.n_span, chosen.n_chord)
        flow = (wing.semi_chord_m, model.flow.mach)
        lattice, status = _lattice(boxes, wing.motion(boxes, modes), k, flow, cache)
        forces, table = lattice.at, lattice.motion
    rational = chosen.fitted(table, wing.semi_chord_m)
    matrix_at = system_over_speed(structure, rational, density_kg_per_m3=density)
    return FlutterProblem(
        model.name,
        chosen.method,
        density,
        chosen,
        BeamShapes(wing, modes),
        k,
        table,
        rational,
        (Variant("wing", structure, forces, matrix_at),),
        status,
    )


def _of_aircraft(model: AircraftModel, liquids: Sequence[Liquids], cache: Path | None) -> FlutterProblem:
    chosen, density = model.aerodynamics, model.density_kg_per_m3
    surfaces = lifting_surfaces(model.structure, chosen.n_boxes)
    k = chosen.reduced_frequencies
    lattice, status = _lattice(surfaces.boxes, surfaces.motion, k, (surfaces.semi_chord_m, model.flow.mach), cache)
    if model.structure.is_free and chosen.rational == "roger":
        lags, b = np.array(chosen.lags), surfaces.semi_chord_m
        rational = air_of_free_flight(k, lattice.motion, semi_chord_m=b, lags=lags)
    else:
        rational = chosen.fitted(lattice.motion, surfaces.semi_chord_m)
    variants = []
    for name in liquids:
        system = flight_system(model, rational, name, density_kg_per_m3=density)
        variants.append(
            Variant(name, system.structure, _moved(lattice.at, system.motion), system.matrix_at, system.rigid)
        )
    n_modes = model.structure.n_modes
    return FlutterProblem(
        model.name,
        "lattice",
        density,
        chosen,
        BoxShapes(
            surfaces.boxes,
            surfaces.motion.control_displacement[:, -n_modes:] if n_modes else np.zeros((surfaces.boxes.n, 0)),
            2 * np.pi * model.structure.frequencies_hz,
        ),
        k,
        lattice.motion,
        rational,
        tuple(variants),
        status,
        lambda speed: checks_of(model, surfaces, lattice, rational, (tuple(liquids), speed)),
        FlownAircraft(model, gust_fit(lattice)),
    )


def _moved(forces: Forces, motion: FloatArray) -> Forces:
    """Forces on and by the coordinates of a variant."""
    return lambda k: motion.T @ forces(k) @ motion


def _lattice(
    boxes: Boxes, motion: BoxMotion, k: FloatArray, chord_and_mach: tuple[float, float], cache: Path | None
) -> tuple[GeneralisedForces, CacheStatus]:
    with progress("doublet lattice", k.size) as advance:
        told: Mapping[str, Any] = {
            "semi_chord_m": chord_and_mach[0],
            "mach": chord_and_mach[1],
            "progress": _named(advance),
        }
        if cache is None:
            return generalised_forces(boxes, motion, k, **told), CacheStatus.MADE
        return cached_generalised_forces(cache, boxes, motion, k, **told)


def _named(advance: Callable[[str], None]) -> Callable[[float, float, str], None]:
    return lambda _done, _everything, note: advance(note)
