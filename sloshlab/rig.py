"""The rig: tank, liquid, structure and the twin that the recording is compared with.

One rig is one TOML file beside its runs. Values are what the laboratory believes.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from sloshlab import physical_ranges
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import RigError
from sloshlab.key_spelling import misspelt_key
from sloshlab.registry import Registry, one_of
from sloshlab.toml_file import parse_toml, read_toml_text

# Strict: a number that is written as text is an error.
_Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
TankDimension = Annotated[_Number, AfterValidator(physical_ranges.TANK_DIMENSION_M.checked)]
BeamDimension = Annotated[_Number, AfterValidator(physical_ranges.BEAM_DIMENSION_M.checked)]
Mass = Annotated[_Number, AfterValidator(physical_ranges.MASS_KG.checked)]
ModalMass = Annotated[_Number, AfterValidator(physical_ranges.MODAL_MASS_KG.checked)]
Density = Annotated[_Number, AfterValidator(physical_ranges.LIQUID_DENSITY_KG_PER_M3.checked)]
SurfaceTension = Annotated[_Number, AfterValidator(physical_ranges.SURFACE_TENSION_N_PER_M.checked)]
KinematicViscosity = Annotated[_Number, AfterValidator(physical_ranges.KINEMATIC_VISCOSITY_M2_PER_S.checked)]
FillLevel = Annotated[_Number, Field(gt=0, lt=1), AfterValidator(physical_ranges.FILL_LEVEL.checked)]
Frequency = Annotated[_Number, AfterValidator(physical_ranges.FREQUENCY_HZ.checked)]
DampingRatio = Annotated[_Number, AfterValidator(physical_ranges.DAMPING_RATIO.checked)]
TipValue = Annotated[_Number, AfterValidator(physical_ranges.MODE_SHAPE.checked)]
Stiffness = Annotated[_Number, AfterValidator(physical_ranges.STIFFNESS_N_PER_M.checked)]
Friction = Annotated[_Number, AfterValidator(physical_ranges.FRICTION_N.checked)]
Damping = Annotated[_Number, AfterValidator(physical_ranges.DAMPING_KG_PER_S.checked)]


TANK_MODELS: Final[Registry[Any]] = Registry("tank model", group="sloshlab.tank_models")
"""By the names of a rig's [twin] table; `sloshlab.twin.tank_models` says what an entry is and how to add one."""
for _name, _function in {
    "frozen": "sloshlab.twin.tank_models:frozen",
    "viscous": "sloshlab.twin.tank_models:viscous",
    "bouncing_ball": "sloshlab.twin.tank_models:bouncing_ball",
    "lateral": "sloshlab.twin.tank_models:lateral",
    "rom": "sloshlab.twin.reduced_order_model_force:reduced_order_model",
}.items():
    TANK_MODELS.declare(_name, _function)

TankModelName = Annotated[str, one_of(lambda: TANK_MODELS.names)]


class _Described(BaseModel):
    """Frozen, typed, keeping what other programs add."""

    model_config = ConfigDict(frozen=True, extra="allow", arbitrary_types_allowed=False)


class Tank(_Described):
    """A rigid box; `dry_mass_kg` is all that rests on the force cells without liquid.

    `cell_frequency_hz` and `cell_damping_ratio` are those of that mass on the cells as springs.
    """

    height_m: TankDimension
    length_m: TankDimension
    width_m: TankDimension
    dry_mass_kg: Mass
    cell_frequency_hz: Frequency | None = None
    cell_damping_ratio: DampingRatio | None = None

    @property
    def volume_m3(self) -> float:
        """Inner volume [m³]."""
        return self.height_m * self.length_m * self.width_m


class Liquid(_Described):
    """The liquid in the tank and how far it fills it.

    Surface tension and viscosity may be absent; what needs them says so.
    """

    name: str = "liquid"
    density_kg_per_m3: Density
    surface_tension_n_per_m: SurfaceTension | None = None
    kinematic_viscosity_m2_per_s: KinematicViscosity | None = None
    fill_level: FillLevel


_LISTS_OF_A_BEAM: Final = ("frequencies_hz", "damping_ratios", "modal_masses_kg", "tip_mode_shape")
_OF_A_BEAM: Final = ("length_m", "width_m", "thickness_m", *_LISTS_OF_A_BEAM)
_OF_A_GUIDE: Final = ("mass_kg", "stiffness_n_per_m", "coulomb_force_n", "damping_kg_per_s")


class Structure(_Described):
    """What carries the tank: a beam with its modes, or one degree of freedom on a guide."""

    kind: Literal["beam", "sdof"]
    length_m: BeamDimension | None = None
    width_m: BeamDimension | None = None
    thickness_m: BeamDimension | None = None
    frequencies_hz: tuple[Frequency, ...] = ()
    damping_ratios: tuple[DampingRatio, ...] = ()
    modal_masses_kg: tuple[ModalMass, ...] = ()
    tip_mode_shape: tuple[TipValue, ...] = ()
    mass_kg: Mass | None = None
    stiffness_n_per_m: Stiffness | None = None
    coulomb_force_n: Friction | None = None
    damping_kg_per_s: Damping | None = None
    spring_mass_kg: Mass | None = None

    @model_validator(mode="after")
    def _complete_for_its_kind(self) -> Structure:
        if self.kind == "beam":
            lengths = {len(getattr(self, key)) for key in _LISTS_OF_A_BEAM}
            if lengths == {0} or len(lengths) != 1:
                raise ValueError(
                    "a beam needs frequencies_hz, damping_ratios, modal_masses_kg and "
                    "tip_mode_shape, all of one length"
                )
            if self.tip_mode_shape[0] == 0:
                raise ValueError("tip_mode_shape: in its first mode the tip of a beam moves")
        elif self.mass_kg is None or self.stiffness_n_per_m is None:
            raise ValueError("an sdof structure needs mass_kg and stiffness_n_per_m")
        return self


class Twin(_Described):
    """The simulation that recordings of this rig are compared with."""

    tank_model: TankModelName = "frozen"
    parameters: dict[str, Any] = Field(default_factory=dict)


class Rig(_Described):
    """Tank, liquid and, where there is one, structure and twin.

    Examples
    --------
    >>> rig = Rig.from_toml_text('''
    ... [tank]
    ... height_m = 0.0272
    ... length_m = 0.1172
    ... width_m = 0.0780
    ... dry_mass_kg = 0.61
    ... [liquid]
    ... density_kg_per_m3 = 1000.0
    ... fill_level = 0.5
    ... ''')
    >>> round(rig.liquid_mass_kg, 5)
    0.12433
    """

    tank: Tank
    liquid: Liquid
    structure: Structure | None = None
    twin: Twin | None = None

    @cached_property
    def liquid_mass_kg(self) -> float:
        """Mass of the liquid m_l = ρ α h l₁ l₂ [kg]."""
        return self.liquid.density_kg_per_m3 * self.liquid.fill_level * self.tank.volume_m3

    @property
    def frequency_scale_rad_per_s(self) -> float:
        """√(g/h) [rad/s], which makes ω̄ = Ω/√(g/h) (1.16)."""
        return math.sqrt(GRAVITY_M_PER_S2 / self.tank.height_m)

    @property
    def velocity_scale_m_per_s(self) -> float:
        """√(g h) [m/s], which makes v̄ = Ω u₀/√(g h)."""
        return math.sqrt(GRAVITY_M_PER_S2 * self.tank.height_m)

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Rig:
        """Read a rig description from a TOML file.

        Raises
        ------
        RigError
            If the file is missing, is not TOML, or describes an impossible rig.
        """
        what = f"rig {Path(path)}"
        text = read_toml_text(path, what, error=RigError, remedy="give the rig's TOML file")
        return cls.from_toml_text(text, name=str(Path(path)))

    @classmethod
    def from_toml_text(cls, text: str, *, name: str = "rig") -> Rig:
        """Read a rig description from TOML text; `name` is used in messages.

        Raises
        ------
        RigError
            If the text is not TOML or describes an impossible rig.
        """
        document = parse_toml(text, f"rig {name}", error=RigError)
        _require_spelling(document, name)
        try:
            return cls.model_validate(document)
        except ValidationError as error:
            # the first breach only: one line names one place and its remedy
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"]) or "rig"
            raise RigError(
                f"rig {name}: {place}",
                got="nothing" if first["type"] == "missing" else repr(first["input"])[:80],
                allowed=_allowed(place, first),
                remedy="correct the rig description",
            ) from error


_TABLES: Final[Mapping[str, type[BaseModel]]] = {
    "": Rig,
    "tank.": Tank,
    "liquid.": Liquid,
    "structure.": Structure,
    "twin.": Twin,
}


def _require_spelling(document: Mapping[str, Any], name: str) -> None:
    """Refuse keys that are slips; others that mean nothing here are kept, as other programs may add them."""
    for place, model in _TABLES.items():
        table = document.get(place.removesuffix("."), {}) if place else document
        if not isinstance(table, Mapping):
            continue
        known, required = _keys_of_structure(table) if model is Structure else _keys_of(model)
        slip = misspelt_key(list(table), known, required)
        if slip is not None:
            raise RigError(
                f"rig {name}: {place}{slip.key[:80]}",
                got=f"an unknown key, and nothing for {place}{slip.meant}",
                allowed=", ".join(sorted(known)),
                remedy=slip.remedy,
            )


def _keys_of(model: type[BaseModel]) -> tuple[list[str], list[str]]:
    """Keys of a table, and those of them that must be there."""
    fields = model.model_fields
    return list(fields), [key for key, field in fields.items() if field.is_required()]


def _keys_of_structure(table: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    known, required = _keys_of(Structure)
    is_guide = table.get("kind") == "sdof"
    # what the other kind of structure has is not missed here
    other = _OF_A_BEAM if is_guide else _OF_A_GUIDE
    needed = ("mass_kg", "stiffness_n_per_m") if is_guide else _LISTS_OF_A_BEAM
    return [key for key in known if key not in other or key in table], [*required, *needed]


def _allowed(place: str, problem: Mapping[str, Any]) -> str:
    if place == "liquid.fill_level" and problem["type"] in ("greater_than", "less_than"):
        return "0 < fill_level < 1 (an empty or full tank does not slosh; record it as configuration 'empty')"
    return str(problem["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
