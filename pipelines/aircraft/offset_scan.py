"""Where a pair of tanks hangs under the wings, and what sideways sloshing then does to the flutter.

The source does not print the places of its two tanks. Forces of the air do not depend on them, so that the whole
plane of places is looked at with one doublet lattice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from threadpoolctl import threadpool_limits

from pipelines.report.progress import progress
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.flutter_crossings import FlutterCrossing, first_flutter, flutter_crossings
from sloshlab.aircraft.model import AircraftModel
from sloshlab.errors import InputError
from sloshlab.quantities import described
from sloshlab.toml_file import read_toml

FloatArray = npt.NDArray[np.float64]

_PITCH, _HEAVE = 4, 2
_MOST_PLACES: Final = 2000
LEAST_STATIC_MARGIN: Final = 0.05
"""Of a place that is chosen, a usual one: with less an aircraft pitches away on a slight force of its tanks."""
_Offset = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False)]


class ScanFile(BaseModel):
    """Which places to look at.

    Attributes
    ----------
    left, right : tuple of int
        Nodes that carry the tanks, pair by pair, from the middle outwards.
    x_offset_m : tuple of float
        Of each tank's centre from its node, aft positive.
    first_m_per_s, last_m_per_s, step_m_per_s : float
        Speeds among which roots are followed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    left: Annotated[tuple[int, ...], Field(min_length=1, max_length=100)]
    right: Annotated[tuple[int, ...], Field(min_length=1, max_length=100)]
    x_offset_m: Annotated[tuple[_Offset, ...], Field(min_length=1, max_length=200)]
    first_m_per_s: Annotated[float, Field(gt=0, le=500)] = 13.0
    last_m_per_s: Annotated[float, Field(gt=0, le=500)] = 50.0
    step_m_per_s: Annotated[float, Field(ge=0.05, le=10)] = 1.0

    @model_validator(mode="after")
    def _in_pairs(self) -> ScanFile:
        if len(self.left) != len(self.right):
            raise ValueError("left and right: as many nodes on both sides")
        if list(self.x_offset_m) != sorted(set(self.x_offset_m)):
            raise ValueError("x_offset_m: ascending")
        if self.first_m_per_s >= self.last_m_per_s:
            raise ValueError("first_m_per_s: below last_m_per_s")
        if len(self.left) * len(self.x_offset_m) > _MOST_PLACES:
            raise ValueError(f"at most {_MOST_PLACES} places")
        return self

    @property
    def speeds_m_per_s(self) -> FloatArray:
        """Ascending, both ends included."""
        n = max(2, round((self.last_m_per_s - self.first_m_per_s) / self.step_m_per_s) + 1)
        return np.linspace(self.first_m_per_s, self.last_m_per_s, n)


def read_scan(path: Path) -> ScanFile:
    """Read a file of places.

    Raises
    ------
    InputError
        If it is no TOML, or a key is missing, unknown or impossible.
    """
    what = f"scan {path.name}"
    try:
        return ScanFile.model_validate(read_toml(path, what, remedy="give the TOML file of a scan"))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "places"
        got = "nothing" if first["type"] == "missing" else repr(first["input"])[:80]
        raise InputError(f"{what}: {place}", got=got, allowed=str(first["msg"])) from error


@dataclass(frozen=True, eq=False)
class PlaceOfTanks:
    """One place of the pair, and the crossings of each model.

    Attributes
    ----------
    x_m, y_m : float
        Of the centre of the right tank.
    static_margin : float
        Of the rigid aircraft with frozen liquid, in reference chords; positive is stable.
    is_beneath : bool
        Whether the tank's centre is beneath the wing.
    frozen, lateral : tuple of FlutterCrossing
    """

    x_m: float
    y_m: float
    static_margin: float
    is_beneath: bool
    frozen: tuple[FlutterCrossing, ...]
    lateral: tuple[FlutterCrossing, ...]

    @property
    def change(self) -> float:
        """Of the symmetric flutter speed by sideways sloshing, relative; NaN where there is none."""
        return _speed(first_flutter(self.lateral)) / _speed(first_flutter(self.frozen)) - 1


@dataclass(frozen=True, eq=False)
class OffsetScan:
    """All places, by pair of nodes and offset.

    Attributes
    ----------
    asked : ScanFile
    places : list of list of PlaceOfTanks
        Pair by pair, offset by offset.
    """

    asked: ScanFile
    places: list[list[PlaceOfTanks]]

    def chosen(self) -> tuple[int, int] | None:
        """The place at which sideways sloshing raises the symmetric flutter most.

        Among those with `LEAST_STATIC_MARGIN`; None if sloshing raises it at none of them.
        """
        best: tuple[float, tuple[int, int]] | None = None
        for row, places in enumerate(self.places):
            for column, place in enumerate(places):
                is_better = place.change > (0.0 if best is None else best[0])
                if is_better and place.static_margin >= LEAST_STATIC_MARGIN:
                    best = (place.change, (row, column))
        return None if best is None else best[1]

    def to_dataset(self) -> xr.Dataset:
        """As ``scan.nc`` keeps it: NaN where nothing flutters within the range."""
        along = ("pair", "x_offset")

        def each(value: Callable[[PlaceOfTanks], float]) -> FloatArray:
            return np.array([[value(place) for place in row] for row in self.places])

        variables: dict[str, Any] = {
            "tank_x": (along, each(lambda place: place.x_m)),
            "tank_y": (along, each(lambda place: place.y_m)),
            "static_margin": (along, each(lambda place: place.static_margin)),
            "is_beneath": (along, each(lambda place: float(place.is_beneath))),
            "frozen_flutter_speed": (along, each(lambda place: _speed(first_flutter(place.frozen)))),
            "frozen_flutter_frequency": (along, each(lambda place: _frequency(first_flutter(place.frozen)))),
            "frozen_antisymmetric_speed": (along, each(lambda place: _first(place.frozen, "antisymmetric"))),
            "lateral_flutter_speed": (along, each(lambda place: _speed(first_flutter(place.lateral)))),
            "lateral_flutter_frequency": (along, each(lambda place: _frequency(first_flutter(place.lateral)))),
            "lateral_antisymmetric_speed": (along, each(lambda place: _first(place.lateral, "antisymmetric"))),
            "lateral_sloshing_speed": (along, each(lambda place: _first(place.lateral, "sloshing"))),
        }
        coordinates = {
            "pair": np.arange(len(self.places)),
            "x_offset": np.array(self.asked.x_offset_m),
        }
        return described(xr.Dataset(variables, coords=coordinates))


def _speed(crossing: FlutterCrossing | None) -> float:
    return float("nan") if crossing is None else crossing.speed_m_per_s


def _frequency(crossing: FlutterCrossing | None) -> float:
    return float("nan") if crossing is None else crossing.frequency_rad_per_s


def _first(crossings: tuple[FlutterCrossing, ...], kind: str) -> float:
    return _speed(next((crossing for crossing in crossings if crossing.kind == kind), None))


def scan_offsets(model: AircraftModel, air: RationalForces, boxes: Boxes, asked: ScanFile) -> OffsetScan:
    """Move the pair of tanks of an aircraft from place to place.

    Parameters
    ----------
    model : AircraftModel
        Free, with two like tanks.
    air : RationalForces
        Of its coordinates; tanks play no part in them.
    boxes : Boxes
        Of the doublet lattice.
    asked : ScanFile

    Raises
    ------
    InputError
        If the aircraft has no such pair, or no node of a number.
    """
    require_pair(model)
    places: list[list[PlaceOfTanks]] = []
    total = len(asked.left) * len(asked.x_offset_m)
    with threadpool_limits(1), progress("places of the tanks", total) as advance:
        for pair in zip(asked.left, asked.right, strict=True):
            row = []
            for offset in asked.x_offset_m:
                row.append(_place(with_pair_at(model, pair, offset), air, boxes, asked.speeds_m_per_s))
                advance(f"nodes {pair[0]} and {pair[1]}, {offset:+.2f} m")
            places.append(row)
    return OffsetScan(asked, places)


def require_pair(model: AircraftModel) -> None:
    """Refuse an aircraft without two tanks that are mirror images in size.

    Raises
    ------
    InputError
    """
    if len(model.tanks) != 2 or model.tanks[0].box != model.tanks[1].box or not model.structure.is_free:
        raise InputError(
            "--scan",
            got=f"{len(model.tanks)} tanks" + (" of a clamped wing" if not model.structure.is_free else ""),
            allowed="a free aircraft with two tanks of one size",
        )


def with_pair_at(model: AircraftModel, nodes: tuple[int, int], x_offset_m: float) -> AircraftModel:
    """The same aircraft with its tanks at a pair of nodes, at their height above the nodes as before.

    Parameters
    ----------
    model : AircraftModel
    nodes : tuple of int
        Left and right.
    x_offset_m : float
        Of both centres from their nodes, aft positive.
    """
    structure, moved = model.structure, []
    for tank, node in zip(model.tanks, nodes, strict=True):
        own = structure.places_m[structure.row_of(node)]
        # tanks hang where they hung: z of the file stays, whatever the node
        arm = np.array([x_offset_m, 0.0, tank.place_m[2] - own[2]])
        moved.append(replace(tank, motion=structure.motion_at(node, arm), place_m=own + arm))
    return replace(model, tanks=tuple(moved))


def _place(model: AircraftModel, air: RationalForces, boxes: Boxes, speeds: FloatArray) -> PlaceOfTanks:
    right = max(model.tanks, key=lambda tank: tank.place_m[1])
    return PlaceOfTanks(
        float(right.place_m[0]),
        float(right.place_m[1]),
        static_margin(model, air),
        is_beneath(boxes, right.place_m),
        flutter_crossings(model, air, "frozen", speeds),
        flutter_crossings(model, air, "lateral", speeds),
    )


def is_beneath(boxes: Boxes, place_m: FloatArray) -> bool:
    """Whether a place is below or above a box of a surface that is nearly level.

    Parameters
    ----------
    boxes : Boxes
    place_m : ndarray, shape (3,)
    """
    level = np.abs(boxes.normal[:, 2]) > 0.5
    # around each box: a place within has all edges on one side
    corner = boxes.corner_m[level][:, [0, 1, 3, 2], :2]
    edge = np.roll(corner, -1, axis=1) - corner
    way = np.asarray(place_m)[:2] - corner
    side = edge[..., 0] * way[..., 1] - edge[..., 1] * way[..., 0]
    return bool(((side >= 0).all(axis=1) | (side <= 0).all(axis=1)).any())


def static_margin(model: AircraftModel, air: RationalForces) -> float:
    """Distance of the neutral point behind the centre of mass with frozen liquid, in reference chords.

    Parameters
    ----------
    model : AircraftModel
        Free; it does not deform here.
    air : RationalForces
        Moments about the dry centre of mass.
    """
    lift, moment = air.a0[_HEAVE, _PITCH], air.a0[_PITCH, _PITCH]
    # lift that acts aft of the centre turns the nose down
    neutral_m = -moment / lift
    liquid = sum(
        tank.box.liquid_mass_kg * (tank.liquid_place_m[0] - model.structure.mass_centre_m[0])
        for tank in model.tanks
    )
    centre_m = liquid / (model.structure.rigid_mass[0, 0] + model.liquid_mass_kg)
    return float((neutral_m - centre_m) / (2 * air.semi_chord_m))
