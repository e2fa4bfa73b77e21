"""A cantilever wing with tanks, described by one TOML file: planform, beam, engine, tanks, air, landing."""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from sloshlab import physical_ranges
from sloshlab.aircraft.model import RationalFit
from sloshlab.errors import InputError
from sloshlab.toml_file import read_toml

_Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
_Positive = Annotated[_Number, Field(gt=0)]
_Share = Annotated[_Number, Field(ge=0, le=1)]
_Ratio = Annotated[_Number, Field(ge=0, lt=1)]
_Dimension = Annotated[_Number, AfterValidator(physical_ranges.TANK_DIMENSION_M.checked)]
_Density = Annotated[_Number, AfterValidator(physical_ranges.LIQUID_DENSITY_KG_PER_M3.checked)]
_MOST_TANKS: Final = 100


class _Described(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class WingChord(_Described):
    """One [[wing.chords]]: chord at a place of the span; straight in between."""

    y_m: Annotated[_Number, Field(ge=0)]
    chord_m: _Positive


class WingEngine(_Described):
    """[engine]: a rigid mass on the beam.

    Attributes
    ----------
    y_m, ahead_m : float
        Where along the span, and how far ahead of the elastic axis.
    mass_kg, pitch_inertia_kg_m2 : float
        The latter about its own centre of mass.
    """

    y_m: _Positive
    ahead_m: _Number
    mass_kg: _Positive
    pitch_inertia_kg_m2: Annotated[_Number, Field(ge=0)]


class WingBeamSection(_Described):
    """[wing]: half a wing to starboard as a beam along its swept elastic axis, clamped at y = 0.

    Attributes
    ----------
    chords : tuple of WingChord
        From the root to the tip.
    leading_edge_sweep_deg : float
    elastic_axis, mass_centre_behind_axis, pitch_radius_of_gyration : float
        Shares of the chord: place of the axis from the leading edge; mass centre of a section behind it; radius of
        gyration of a section about its mass centre.
    root_mass_kg_per_m, tip_mass_kg_per_m : float
        Per length of span, linear in between.
    root_bending_stiffness_n_m2 : float
        EI out of the plane at the root; along the span it goes with a power of the chord.
    torsion_over_bending, in_plane_over_bending : float
        GJ/EI, and EI in the plane over that out of it.
    stiffness_power : float
        Of the chord over that of the root.
    n_elements, n_modes : int
    extra_damping_ratio, extra_damping_above : float
        Damping ratio of dry modes whose ω_n/√(g/h₁), h₁ the height of the highest tank, is above the latter.
    """

    name: Annotated[str, Field(min_length=1, max_length=100)] = "wing"
    chords: Annotated[tuple[WingChord, ...], Field(min_length=2, max_length=20)]
    leading_edge_sweep_deg: Annotated[_Number, Field(ge=-60, le=60)]
    elastic_axis: _Share
    mass_centre_behind_axis: _Number
    pitch_radius_of_gyration: _Positive
    root_mass_kg_per_m: _Positive
    tip_mass_kg_per_m: _Positive
    root_bending_stiffness_n_m2: _Positive
    torsion_over_bending: _Positive
    in_plane_over_bending: _Positive = 6.0
    stiffness_power: _Number = 4.0
    n_elements: Annotated[int, Field(ge=4, le=200, strict=True)] = 40
    n_modes: Annotated[int, Field(ge=2, le=40, strict=True)] = 12
    extra_damping_ratio: _Ratio = 0.0
    extra_damping_above: Annotated[_Number, Field(ge=0)] = 6.72

    @model_validator(mode="after")
    def _ascending(self) -> WingBeamSection:
        places = [chord.y_m for chord in self.chords]
        if places[0] != 0 or any(a >= b for a, b in itertools.pairwise(places)):
            raise ValueError("chords: y_m must ascend from 0")
        return self

    @property
    def semi_span_m(self) -> float:
        """From root to tip, along y."""
        return self.chords[-1].y_m


class WingTankSection(_Described):
    """One [[tanks]]: a box whose centre is on the elastic axis, carried by the two nodes beside it."""

    name: Annotated[str, Field(min_length=1, max_length=60)]
    y_m: _Positive
    length_m: _Dimension
    width_m: _Dimension
    height_m: _Dimension
    fill_level: Annotated[_Number, Field(gt=0, lt=1)] = 0.5
    density_kg_per_m3: _Density = 800.0


class WingFlow(_Described):
    """[flow]: air; Mach number and density stay as they are, whatever the speed (S21)."""

    density_kg_per_m3: _Positive
    mach: Annotated[_Number, Field(ge=0, le=0.95)]


class WingAerodynamics(RationalFit):
    """[aerodynamics]: boxes of the doublet lattice on each half, and the rational functions."""

    n_span: Annotated[int, Field(ge=4, le=60, strict=True)] = 22
    n_chord: Annotated[int, Field(ge=2, le=20, strict=True)] = 6
    semi_chord_m: _Positive


class CalibrationTargets(_Described):
    """[calibration]: two numbers that stiffness was chosen for; they are inputs, never results.

    Attributes
    ----------
    flutter_speed_m_per_s : float
        With frozen liquids.
    frequency_ratio : float
        ω at flutter over that of the first dry mode.
    """

    flutter_speed_m_per_s: _Positive
    frequency_ratio: _Positive
    source: str = ""


class LandingSection(_Described):
    """[landing]: flow, masses, and the vertical acceleration of the fuselage.

    Attributes
    ----------
    half_aircraft_mass_kg : float
        M_ac/2 of (3.18).
    gear_y_m : float
        Of the landing gear, on the elastic axis.
    pulse_g, pulse_s : float
        A half sine, upward.
    ringing_g, ringing_hz, ringing_damping_ratio : float
        A decaying sine after it.
    """

    speed_m_per_s: _Positive
    density_kg_per_m3: _Positive
    mach: Annotated[_Number, Field(ge=0, le=0.95)]
    half_aircraft_mass_kg: _Positive
    gear_y_m: _Positive
    pulse_g: _Number = 1.5
    pulse_s: _Positive = 0.15
    ringing_g: _Number = 0.5
    ringing_hz: _Positive = 2.5
    ringing_damping_ratio: _Ratio = 0.15


class WingDescription(_Described):
    """The whole file."""

    wing: WingBeamSection
    engine: WingEngine | None = None
    flow: WingFlow
    aerodynamics: WingAerodynamics
    tanks: Annotated[tuple[WingTankSection, ...], Field(min_length=1, max_length=_MOST_TANKS)]
    calibration: CalibrationTargets | None = None
    landing: LandingSection | None = None

    @model_validator(mode="after")
    def _on_the_wing(self) -> WingDescription:
        names = [tank.name for tank in self.tanks]
        if len(set(names)) != len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"tanks: the name {twice} twice")
        span = self.wing.semi_span_m
        places = [(f"tank {tank.name}", tank.y_m) for tank in self.tanks]
        places += [("engine", self.engine.y_m)] if self.engine else []
        places += [("landing gear", self.landing.gear_y_m)] if self.landing else []
        for name, place in places:
            if place > span:
                raise ValueError(f"{name}: y_m = {place:g} is beyond the tip at {span:g}")
        return self


def load_wing(path: str | os.PathLike[str]) -> WingDescription:
    """Read a wing.

    Parameters
    ----------
    path : path-like
        TOML with [wing], [flow], [aerodynamics], [[tanks]], and [engine], [calibration], [landing] where wanted.

    Raises
    ------
    InputError
        If the file is missing, or a key unknown or impossible.
    """
    what = f"wing {Path(path)}"
    document = read_toml(Path(path), what, remedy="give the wing's TOML file")
    try:
        return WingDescription.model_validate(document)
    except ValidationError as error:
        raise _refused(what, error) from error


def _refused(what: str, error: ValidationError) -> InputError:
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"]) or "file"
    got: Any = "nothing" if first["type"] == "missing" else repr(first["input"])[:80]
    if first["type"] == "extra_forbidden":
        return InputError(f"{what}: {place}", got="an unknown key", remedy="correct its spelling, or take it out")
    message = str(first["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(f"{what}: {place}", got=got, allowed=message)
