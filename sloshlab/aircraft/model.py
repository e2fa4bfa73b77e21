"""An aircraft with its tanks: a TOML file beside the netCDF file of its structure."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from math import radians
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from sloshlab import physical_ranges
from sloshlab.aeroelastic.arrays import ComplexArray
from sloshlab.aeroelastic.generalised_forces import usual_reduced_frequencies
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_minimum_state import minimum_state_fit
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aircraft.deck_reader import read_deck
from sloshlab.aircraft.structure import AircraftStructure, load_structure, structure_of_deck
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.lateral_sloshing.coupling import TankCoupling, frozen_mass_matrix, sloshing_liquid
from sloshlab.toml_file import read_toml

FloatArray = npt.NDArray[np.float64]
_Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
_Positive = Annotated[_Number, Field(gt=0)]
_Dimension = Annotated[_Number, AfterValidator(physical_ranges.TANK_DIMENSION_M.checked)]
_Density = Annotated[_Number, AfterValidator(physical_ranges.LIQUID_DENSITY_KG_PER_M3.checked)]
_MOST_TANKS: Final = 1000
_UP: Final = 2
"""Among the six directions of a tank."""
_MODES_OF_A_DECK: Final = 20
"""With the six of a free body, unless the model says how many it keeps."""


class _Described(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class TankSection(_Described):
    """One [[tanks]] of the file.

    Attributes
    ----------
    name : str
    node, nodes, weights
        One node that carries the tank, or several whose weighted motion it has; weights sum to 1.
    offset_m : tuple of float
        From the node, or from the weighted place of the nodes, to the tank's centre.
    length_m, width_m, height_m, fill_level, density_kg_per_m3 : float
        Inside; along x, y, z of the tank.
    turn_deg : float
        Of the tank about z.
    sloshing_modes : int
        Of each plane.
    sloshing_damping_ratio : float
    """

    name: Annotated[str, Field(min_length=1, max_length=60)]
    node: int | None = None
    nodes: tuple[int, ...] = ()
    weights: tuple[_Number, ...] = ()
    offset_m: tuple[_Number, _Number, _Number] = (0.0, 0.0, 0.0)
    length_m: _Dimension
    width_m: _Dimension
    height_m: _Dimension
    fill_level: Annotated[_Number, Field(gt=0, lt=1)]
    density_kg_per_m3: _Density
    turn_deg: _Number = 0.0
    sloshing_modes: Annotated[int, Field(ge=0, le=100, strict=True)] = 3
    sloshing_damping_ratio: Annotated[_Number, Field(ge=0, lt=1)] = 0.005

    @model_validator(mode="after")
    def _carried(self) -> TankSection:
        if (self.node is None) == (not self.nodes):
            raise ValueError("a tank needs node, or nodes and weights")
        if len(self.nodes) != len(self.weights) or (self.nodes and abs(sum(self.weights) - 1) > 1e-6):
            raise ValueError("weights: one for each of nodes, 1 in all")
        return self


class RationalFit(_Described):
    """Which reduced frequencies forces of the air are computed for, and what is fitted to them.

    Attributes
    ----------
    largest_reduced_frequency : float
    n_reduced_frequencies : int
    rational : str
        ``roger`` or ``minimum_state``.
    lags : tuple of float
    """

    largest_reduced_frequency: _Positive = 1.3
    n_reduced_frequencies: Annotated[int, Field(ge=6, le=100)] = 15
    rational: Literal["roger", "minimum_state"] = "roger"
    lags: tuple[_Positive, ...] = (0.08, 0.197, 0.487, 1.2)

    @property
    def reduced_frequencies(self) -> FloatArray:
        """From 0, denser near it."""
        return usual_reduced_frequencies(self.largest_reduced_frequency, self.n_reduced_frequencies)

    def fitted(self, table: ComplexArray, semi_chord_m: float) -> RationalForces:
        """Rational functions of a table over `reduced_frequencies`, shape (n_k, n, n)."""
        fit = roger_fit if self.rational == "roger" else minimum_state_fit
        return fit(self.reduced_frequencies, table, semi_chord_m=semi_chord_m, lags=np.array(self.lags))


class AerodynamicsSection(RationalFit):
    """[aerodynamics] of the file: as `RationalFit`, and how many boxes the doublet lattice has at most."""

    n_boxes: Annotated[int, Field(ge=4, le=3000, strict=True)] = 450


class FlowSection(_Described):
    """[flow] of the file: air; the deck's density unless stated."""

    density_kg_per_m3: _Positive | None = None
    mach: Annotated[_Number, Field(ge=0, le=0.95)] = 0.0


class _Aircraft(_Described):
    name: Annotated[str, Field(min_length=1, max_length=100)] = "aircraft"
    structure: Annotated[str, Field(min_length=1)]
    deck_length_m: _Positive | None = None
    deck_mass_kg: _Positive | None = None
    n_modes: Annotated[int, Field(ge=0, strict=True)] | None = None
    damping_ratio: Annotated[_Number, Field(ge=0, lt=1)] = 0.0

    @model_validator(mode="after")
    def _in_units(self) -> _Aircraft:
        units = (self.deck_length_m, self.deck_mass_kg)
        if self.is_deck and None in units:
            raise ValueError(
                "structure: a deck needs deck_length_m and deck_mass_kg, its units in metre and kilogram"
            )
        if not self.is_deck and units != (None, None):
            raise ValueError(
                "structure: deck_length_m and deck_mass_kg belong to a deck, which does not end in .nc"
            )
        return self

    @property
    def is_deck(self) -> bool:
        return not self.structure.lower().endswith(".nc")


class _ModelFile(_Described):
    aircraft: _Aircraft
    flow: FlowSection = FlowSection()
    aerodynamics: AerodynamicsSection = AerodynamicsSection()
    tanks: Annotated[tuple[TankSection, ...], Field(max_length=_MOST_TANKS)] = ()

    @model_validator(mode="after")
    def _named_once(self) -> _ModelFile:
        names = [tank.name for tank in self.tanks]
        if len(set(names)) != len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"tanks: the name {twice} twice")
        return self


@dataclass(frozen=True, eq=False)
class AircraftTank:
    """A tank where it is.

    Attributes
    ----------
    name : str
    box : BoxTank
    motion : ndarray, shape (6, n)
        Of its centre per generalised coordinate, in axes x aft, y to starboard, z up.
    place_m : ndarray, shape (3,)
        Of its centre.
    turn_rad, sloshing_damping_ratio : float
    n_sloshing_modes : int
        Of each plane.
    effective_mass_fraction : float
        β of a vertical force −β m_l ü beyond that of the frozen liquid; negative where it moves in counter-phase.
    viscous_damping_n_s_per_m : float
        c of a vertical force −c u̇ in place of sloshing (E.4).
    """

    name: str
    box: BoxTank
    motion: FloatArray
    place_m: FloatArray
    turn_rad: float = 0.0
    n_sloshing_modes: int = 3
    sloshing_damping_ratio: float = 0.005
    effective_mass_fraction: float = 0.0
    viscous_damping_n_s_per_m: float = 0.0

    @property
    def frozen_mass(self) -> FloatArray:
        """What its frozen liquid adds to the mass matrix, with an effective mass if there is one, shape (n, n)."""
        at_centre = frozen_mass_matrix(self.box, turn_rad=self.turn_rad)
        at_centre[_UP, _UP] += self._effective_mass_kg
        return np.asarray(self.motion.T @ at_centre @ self.motion)

    @property
    def damping(self) -> FloatArray:
        """What its damper adds to the damping matrix, shape (n, n)."""
        return self.viscous_damping_n_s_per_m * np.outer(self.motion[_UP], self.motion[_UP])

    @property
    def _effective_mass_kg(self) -> float:
        return self.effective_mass_fraction * self.box.liquid_mass_kg

    @property
    def sloshing(self) -> TankCoupling:
        """Its sloshing liquid in generalised coordinates."""
        at_centre = sloshing_liquid(
            self.box,
            n_modes=self.n_sloshing_modes,
            damping_ratio=self.sloshing_damping_ratio,
            turn_rad=self.turn_rad,
        )
        rigid = at_centre.rigid.copy()
        rigid[_UP, _UP] -= self._effective_mass_kg
        return replace(at_centre, rigid=rigid).transferred(self.motion)

    @property
    def liquid_place_m(self) -> FloatArray:
        """Centre of the liquid, in the axes of the structure."""
        return np.asarray(self.place_m + np.array([0.0, 0.0, self.box.liquid_centre_m]))


@dataclass(frozen=True, eq=False)
class AircraftModel:
    """Structure and tanks; coordinates are the body's six about its dry centre of mass, then the modes'.

    `damping_ratio` is that of all modes, or of each.
    """

    name: str
    structure: AircraftStructure
    tanks: tuple[AircraftTank, ...]
    damping_ratio: float | FloatArray = 0.0
    flow: FlowSection = field(default_factory=FlowSection)
    aerodynamics: AerodynamicsSection = field(default_factory=AerodynamicsSection)

    @property
    def density_kg_per_m3(self) -> float:
        """Of the air, as stated or as the deck has it.

        Raises
        ------
        InputError
            If neither says it.
        """
        density = self.flow.density_kg_per_m3 or self.structure.density_kg_per_m3
        if density is None:
            raise InputError("aircraft: flow.density_kg_per_m3", got="nothing", allowed="> 0; the deck has none")
        return density

    @property
    def damping_matrix(self) -> FloatArray:
        """Of the modes, and of dampers in tanks, shape (n, n).

        Raises
        ------
        InputError
            If a free aircraft has dampers in tanks: they would have to act in axes that do not fly with it.
        """
        structure = self.structure
        if structure.is_free and any(tank.viscous_damping_n_s_per_m for tank in self.tanks):
            raise InputError("aircraft: dampers in tanks", got="a free aircraft", allowed="a clamped wing")
        modal = 4 * np.pi * self.damping_ratio * structure.frequencies_hz * structure.modal_masses_kg
        own = np.diag(np.concatenate([np.zeros(6 if structure.is_free else 0), modal]))
        return np.asarray(sum((tank.damping for tank in self.tanks), own))

    @property
    def frozen_mass_matrix(self) -> FloatArray:
        """Mass matrix with all liquids frozen, shape (n, n)."""
        return np.asarray(sum((tank.frozen_mass for tank in self.tanks), self.structure.mass_matrix))

    @property
    def liquid_mass_kg(self) -> float:
        """Of all tanks."""
        return float(sum(tank.box.liquid_mass_kg for tank in self.tanks))


def load_model(path: str | os.PathLike[str]) -> AircraftModel:
    """Read an aircraft model.

    Parameters
    ----------
    path : path-like
        TOML with [aircraft], which names the file of the structure beside it (netCDF, or a Nastran deck and its
        units), and any number of [[tanks]]; [flow] and [aerodynamics] for what needs air.

    Raises
    ------
    InputError
        If a file is missing or damaged, a key unknown or impossible, or a tank at a node that is not there.
    """
    file = Path(path)
    what = f"aircraft {file}"
    document = read_toml(file, what, remedy="give the model's TOML file")
    try:
        described = _ModelFile.model_validate(document)
    except ValidationError as error:
        raise _refused(what, error) from error
    structure = _with_modes(_structure(file.parent, described.aircraft), described.aircraft.n_modes, what)
    tanks = tuple(_tank(structure, section) for section in described.tanks)
    return AircraftModel(
        described.aircraft.name,
        structure,
        tanks,
        described.aircraft.damping_ratio,
        described.flow,
        described.aerodynamics,
    )


def _structure(folder: Path, described: _Aircraft) -> AircraftStructure:
    place = folder / described.structure
    if described.deck_length_m is None or described.deck_mass_kg is None:
        return load_structure(place)
    return structure_of_deck(
        read_deck(place),
        length_m=described.deck_length_m,
        mass_kg=described.deck_mass_kg,
        n_modes=_MODES_OF_A_DECK if described.n_modes is None else 6 + described.n_modes,
    )


def _refused(what: str, error: ValidationError) -> InputError:
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"]) or "model"
    got: Any = "nothing" if first["type"] == "missing" else repr(first["input"])[:80]
    if first["type"] == "extra_forbidden":
        return InputError(f"{what}: {place}", got="an unknown key", remedy="correct its spelling, or take it out")
    message = str(first["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(f"{what}: {place}", got=got, allowed=message)


def _with_modes(structure: AircraftStructure, n_modes: int | None, what: str) -> AircraftStructure:
    if n_modes is None or n_modes == structure.n_modes:
        return structure
    if n_modes > structure.n_modes:
        raise InputError(f"{what}: aircraft.n_modes", got=f"{n_modes}", allowed=f"≤ {structure.n_modes}")
    return replace(
        structure,
        frequencies_hz=structure.frequencies_hz[:n_modes],
        modal_masses_kg=structure.modal_masses_kg[:n_modes],
        shapes=structure.shapes[:n_modes],
    )


def _tank(structure: AircraftStructure, section: TankSection) -> AircraftTank:
    nodes = (section.node,) if section.node is not None else section.nodes
    weights = (1.0,) if section.node is not None else section.weights
    places = [structure.places_m[structure.row_of(node)] for node in nodes]
    centre = np.asarray(sum(weight * place for weight, place in zip(weights, places, strict=True)))
    centre = centre + np.array(section.offset_m)
    # each node carries the tank on a rigid arm; the mean of rigid motions is the rigid motion
    motion = sum(
        weight * structure.motion_at(node, centre - place)
        for node, weight, place in zip(nodes, weights, places, strict=True)
    )
    box = BoxTank(
        section.length_m, section.width_m, section.height_m, section.fill_level, section.density_kg_per_m3
    )
    return AircraftTank(
        section.name, box, np.asarray(motion), centre, radians(section.turn_deg),
        section.sloshing_modes, section.sloshing_damping_ratio,
    )  # fmt: skip
