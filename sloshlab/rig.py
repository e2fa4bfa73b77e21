"""The rig: tank, liquid, structure and the twin that the recording is compared with.

One rig is one TOML file beside its runs. Values are what the laboratory believes.
"""

from __future__ import annotations

import math
import os
import tomllib
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import RigError
from sloshlab.registry import Registry, one_of

# Strict: a number that is written as text is an error.
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NonNegativeFloat = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]

_LARGEST_RIG_FILE_BYTES = 1_000_000


TANK_MODELS: Final[Registry[Any]] = Registry("tank model", group="sloshlab.tank_models")
"""By the names of a rig's [twin] table; `sloshlab.twin.tank_models` says what an entry is and how to add one."""
for _name, _function in {
    "frozen": "sloshlab.twin.tank_models:frozen",
    "viscous": "sloshlab.twin.tank_models:viscous",
    "bouncing_ball": "sloshlab.twin.tank_models:bouncing_ball",
    "rom": "sloshlab.twin.reduced_order_model_force:reduced_order_model",
}.items():
    TANK_MODELS.declare(_name, _function)

TankModelName = Annotated[str, one_of(lambda: TANK_MODELS.names)]


class _Described(BaseModel):
    """Frozen, typed, keeping what other programs add."""

    model_config = ConfigDict(frozen=True, extra="allow", arbitrary_types_allowed=False)


class Tank(_Described):
    """A rigid box; `dry_mass_kg` is all that rests on the force cells without liquid."""

    height_m: PositiveFloat
    length_m: PositiveFloat
    width_m: PositiveFloat
    dry_mass_kg: PositiveFloat

    @property
    def volume_m3(self) -> float:
        """Inner volume [m³]."""
        return self.height_m * self.length_m * self.width_m


class Liquid(_Described):
    """The liquid in the tank and how far it fills it.

    Surface tension and viscosity may be absent; what needs them says so.
    """

    name: str = "liquid"
    density_kg_per_m3: PositiveFloat
    surface_tension_n_per_m: NonNegativeFloat | None = None
    kinematic_viscosity_m2_per_s: NonNegativeFloat | None = None
    fill_level: Annotated[float, Field(gt=0, lt=1, strict=True)]


class Structure(_Described):
    """What carries the tank: a beam with its modes, or one degree of freedom on a guide."""

    kind: Literal["beam", "sdof"]
    length_m: PositiveFloat | None = None
    width_m: PositiveFloat | None = None
    thickness_m: PositiveFloat | None = None
    frequencies_hz: tuple[PositiveFloat, ...] = ()
    damping_ratios: tuple[NonNegativeFloat, ...] = ()
    modal_masses_kg: tuple[PositiveFloat, ...] = ()
    tip_mode_shape: tuple[float, ...] = ()
    mass_kg: PositiveFloat | None = None
    stiffness_n_per_m: PositiveFloat | None = None
    coulomb_force_n: NonNegativeFloat | None = None
    damping_kg_per_s: NonNegativeFloat | None = None

    @model_validator(mode="after")
    def _complete_for_its_kind(self) -> Structure:
        if self.kind == "beam":
            lengths = {
                len(self.frequencies_hz),
                len(self.damping_ratios),
                len(self.modal_masses_kg),
                len(self.tip_mode_shape),
            }
            if lengths == {0} or len(lengths) != 1:
                raise ValueError(
                    "a beam needs frequencies_hz, damping_ratios, modal_masses_kg and "
                    "tip_mode_shape, all of one length"
                )
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
        file = Path(path)
        try:
            # before it is read: a wrong path may name a recording
            if file.stat().st_size > _LARGEST_RIG_FILE_BYTES:
                raise RigError(
                    f"rig {file}",
                    got=f"{file.stat().st_size} bytes",
                    allowed=f"≤ {_LARGEST_RIG_FILE_BYTES}",
                    remedy="give the rig's TOML file",
                )
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise RigError(f"rig {file}", got="bytes that are not UTF-8 text", allowed="a TOML file") from error
        except OSError as error:
            raise RigError(
                f"rig {file}",
                got=error.strerror or str(error),
                allowed="a readable TOML file",
                remedy="check the path given to --rig",
            ) from error
        return cls.from_toml_text(text, name=str(file))

    @classmethod
    def from_toml_text(cls, text: str, *, name: str = "rig") -> Rig:
        """Read a rig description from TOML text; `name` is used in messages.

        Raises
        ------
        RigError
            If the text is not TOML or describes an impossible rig.
        """
        try:
            document = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # ValueError: also integers of thousands of digits
            raise RigError(f"rig {name}", got=f"text that is not TOML ({error})", allowed="TOML") from error
        try:
            return cls.model_validate(document)
        except ValidationError as error:
            # the first breach only: one line names one place and its remedy
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"]) or "rig"
            raise RigError(
                f"rig {name}: {place}",
                got="nothing" if first["type"] == "missing" else repr(first["input"])[:80],
                allowed=_allowed(place, first["msg"]),
                remedy="correct the rig description",
            ) from error


def _allowed(place: str, message: str) -> str:
    if place == "liquid.fill_level":
        return "0 < fill_level < 1 (an empty or full tank does not slosh; record it as configuration 'empty')"
    return message.removeprefix("Value error, ").removeprefix("Input should be ")
