"""A wing or an aircraft and the flow around it, from a TOML file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sloshlab.aeroelastic.cantilever_wing import CantileverWing, Station
from sloshlab.aircraft.model import AircraftModel, RationalFit, load_model
from sloshlab.errors import InputError
from sloshlab.toml_file import read_toml

_Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
_Positive = Annotated[float, Field(allow_inf_nan=False, strict=True, gt=0)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FlowTable(_Table):
    """Air."""

    density_kg_per_m3: _Positive
    mach: Annotated[float, Field(ge=0, le=0.95)] = 0.0


class StructureTable(_Table):
    """Division of the beam, and what is kept of it."""

    n_elements: Annotated[int, Field(ge=1, le=200)] = 24
    n_modes: Annotated[int, Field(ge=1, le=40)] = 6
    damping_ratio: Annotated[float, Field(ge=0, lt=1)] = 0.0


class AerodynamicsTable(RationalFit):
    """How the air's forces are computed, and fitted."""

    method: Literal["strips", "lattice"]
    n_span: Annotated[int, Field(ge=1, le=200)] = 20
    n_chord: Annotated[int, Field(ge=1, le=50)] = 6


class StationTable(_Table):
    """One place of the span."""

    y_m: _Number
    leading_edge_m: _Number = 0.0
    chord_m: _Positive
    elastic_axis: _Number
    bending_stiffness_n_m2: _Positive
    torsion_stiffness_n_m2: _Positive
    mass_kg_per_m: _Positive
    mass_centre: _Number
    pitch_inertia_kg_m: _Positive


class WingModel(_Table):
    """The whole file."""

    name: str
    flow: FlowTable
    structure: StructureTable = StructureTable()
    aerodynamics: AerodynamicsTable
    station: tuple[StationTable, ...]

    @property
    def wing(self) -> CantileverWing:
        """The wing that the stations describe."""
        return CantileverWing(tuple(Station(**station.model_dump()) for station in self.station))


def read_model(path: Path) -> WingModel | AircraftModel:
    """Read a model file: of an aircraft if it has [aircraft], else of a wing.

    Parameters
    ----------
    path : Path
        TOML.

    Returns
    -------
    WingModel or AircraftModel

    Raises
    ------
    InputError
        If the file is not TOML or describes neither; one line names the place.
    """
    document = read_toml(path, f"model {path.name}", remedy="give a model file")
    if "aircraft" in document:
        return load_model(path)
    try:
        model = WingModel.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "model"
        raise InputError(
            f"model {path.name}: {place}",
            got="nothing" if first["type"] == "missing" else repr(first["input"])[:80],
            allowed="a key of the documentation" if first["type"] == "extra_forbidden" else first["msg"],
            remedy="correct the model file",
        ) from error
    if not all(math.isfinite(station.y_m) for station in model.station):
        raise InputError(f"model {path.name}: station.y_m", got="not finite", allowed="finite")
    _ = model.wing
    return model
