"""The model file of a wing in flight, as its laboratory believes it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from sloshlab import physical_ranges
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.toml_file import read_toml

MODEL: Final = "model.toml"
"""Name of the file in a case."""
_Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
_Positive = Annotated[_Number, Field(gt=0)]
_Share = Annotated[_Number, Field(gt=-1, lt=1)]
_Ratio = Annotated[_Number, Field(ge=0, lt=1)]
_Dimension = Annotated[_Number, AfterValidator(physical_ranges.TANK_DIMENSION_M.checked)]
_Density = Annotated[_Number, AfterValidator(physical_ranges.LIQUID_DENSITY_KG_PER_M3.checked)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ToleranceTable(_Table):
    """Half-widths of where numbers of the wing are expected, relative to them.

    Attributes
    ----------
    bending_stiffness, torsion_stiffness, damping, actuator_frequency, gain : float
        The last one of every compared channel.
    """

    bending_stiffness: _Positive = 0.04
    torsion_stiffness: _Positive = 0.04
    damping: _Positive = 0.2
    actuator_frequency: _Positive = 0.02
    gain: _Positive = 0.01


class WingTable(_Table):
    """[wing]: a uniform cantilever.

    Attributes
    ----------
    semi_span_m, semi_chord_m : float
    elastic_axis : float
        Behind mid-chord, in semi-chords.
    mass_kg_per_m, mass_offset_m, pitch_inertia_kg_m : float
        Of the structure; its centre behind the elastic axis, inertia about it.
    bending_stiffness_n_m2, torsion_stiffness_n_m2 : float
    damping_ratio : float
        Of every mode with frozen liquid.
    lift_slope : float
        dC_L/dα of a section.
    tolerances : ToleranceTable
    """

    semi_span_m: _Positive
    semi_chord_m: _Positive
    elastic_axis: _Share
    mass_kg_per_m: _Positive
    mass_offset_m: _Number
    pitch_inertia_kg_m: _Positive
    bending_stiffness_n_m2: _Positive
    torsion_stiffness_n_m2: _Positive
    damping_ratio: _Ratio
    lift_slope: _Positive
    tolerances: ToleranceTable = ToleranceTable()


class FlapTable(_Table):
    """[flap]: along part of the span, behind its hinge.

    Attributes
    ----------
    inner_m, outer_m : float
    hinge : float
        Behind mid-chord, in semi-chords.
    actuator_frequency_hz, actuator_damping_ratio : float
        Of the second order between command and angle.
    linkage_time_s : float
        With which the flap follows the actuator, as a spring against the damping of the air; 0 if it is rigid.
    """

    inner_m: Annotated[_Number, Field(ge=0)]
    outer_m: _Positive
    hinge: _Share
    actuator_frequency_hz: _Positive
    actuator_damping_ratio: Annotated[_Positive, Field(lt=2)]
    linkage_time_s: Annotated[_Number, Field(ge=0, lt=1)] = 0.0


class TankTable(_Table):
    """One [[tanks]]: a box whose frozen liquid rides on the wing.

    Attributes
    ----------
    y_m, behind_axis_m : float
        Centre along the span, and behind the elastic axis.
    dry_mass_kg : float
    length_m, width_m, height_m : float
        Along the chord, along the span, upward.
    fill_level, density_kg_per_m3 : float
    """

    y_m: _Positive
    behind_axis_m: _Number
    dry_mass_kg: Annotated[_Number, Field(ge=0)]
    length_m: _Dimension
    width_m: _Dimension
    height_m: _Dimension
    fill_level: Annotated[_Number, Field(gt=0, lt=1)]
    density_kg_per_m3: _Density

    def box(self, fill_level: float | None = None) -> BoxTank:
        """The tank with its liquid, at its fill or another one."""
        fill = self.fill_level if fill_level is None else fill_level
        return BoxTank(self.length_m, self.width_m, self.height_m, fill, self.density_kg_per_m3)


class AccelerometerTable(_Table):
    """One [[accelerometers]]: vertical, on the wing.

    Attributes
    ----------
    name : str
        Of its channel.
    y_m, behind_axis_m : float
    """

    name: Annotated[str, Field(pattern=r"^acceleration_[a-z0-9_]{1,60}$")]
    y_m: _Positive
    behind_axis_m: _Number


class FlightWing(_Table):
    """The whole file."""

    name: Annotated[str, Field(min_length=1, max_length=100)] = "wing"
    wing: WingTable
    flap: FlapTable
    tanks: Annotated[tuple[TankTable, ...], Field(min_length=1, max_length=12)]
    accelerometers: Annotated[tuple[AccelerometerTable, ...], Field(min_length=1, max_length=40)]

    @model_validator(mode="after")
    def _on_the_wing(self) -> FlightWing:
        span = self.wing.semi_span_m
        if not self.flap.inner_m < self.flap.outer_m <= span:
            raise ValueError("flap: inner_m < outer_m ≤ semi_span_m")
        for what, place in [("tanks", each.y_m) for each in self.tanks] + [
            ("accelerometers", each.y_m) for each in self.accelerometers
        ]:
            if place > span:
                raise ValueError(f"{what}: y_m ≤ semi_span_m, not {place:g}")
        names = [each.name for each in self.accelerometers]
        if len(set(names)) != len(names):
            raise ValueError("accelerometers: each name once")
        if self.wing.pitch_inertia_kg_m <= self.wing.mass_kg_per_m * self.wing.mass_offset_m**2:
            raise ValueError(
                "wing: pitch_inertia_kg_m about the elastic axis, more than mass times offset squared"
            )
        return self

    @property
    def flap_chord_m(self) -> float:
        """From hinge to trailing edge: channels of the flap are displacements of its edge."""
        return self.wing.semi_chord_m * (1 - self.flap.hinge)


def read_flight_wing(path: Path) -> FlightWing:
    """Read a model file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be read, a key is unknown or missing, or a number impossible.
    """
    what = f"model {path}"
    document = read_toml(path, what, remedy="give the model's TOML file")
    try:
        return FlightWing.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        got: Any = "nothing" if first["type"] == "missing" else repr(first["input"])[:80] if place else "the whole"
        allowed = str(first["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
        raise InputError(f"{what}: {place}" if place else what, got=got, allowed=allowed) from error
