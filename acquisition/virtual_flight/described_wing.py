"""The wing as its model file describes it, read here anew."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sloshlab.errors import InputError
from sloshlab.toml_file import parse_toml, read_toml_text


@dataclass(frozen=True)
class DescribedTank:
    """A box on the wing.

    Attributes
    ----------
    y_m, behind_axis_m : float
        Place of its centre along the span, and behind the elastic axis.
    dry_mass_kg : float
    length_m, width_m, height_m : float
    fill_level, density_kg_per_m3 : float
    """

    y_m: float
    behind_axis_m: float
    dry_mass_kg: float
    length_m: float
    width_m: float
    height_m: float
    fill_level: float
    density_kg_per_m3: float

    def liquid_kg(self, fill_level: float | None = None) -> float:
        """Mass of the liquid, at its fill or another one."""
        fill = self.fill_level if fill_level is None else fill_level
        return self.density_kg_per_m3 * self.length_m * self.width_m * self.height_m * fill

    def pitch_inertia_kg_m2(self, fill_level: float | None = None) -> float:
        """Of the frozen liquid, about its centre of mass."""
        fill = self.fill_level if fill_level is None else fill_level
        return self.liquid_kg(fill) * (self.length_m**2 + (fill * self.height_m) ** 2) / 12


@dataclass(frozen=True)
class DescribedFlap:
    """A flap along part of the span, and its actuator of the second order.

    Attributes
    ----------
    inner_m, outer_m : float
    hinge : float
        Behind mid-chord, in semi-chords.
    actuator_frequency_hz, actuator_damping_ratio : float
    linkage_time_s : float
        With which the flap follows the actuator; 0 for a rigid linkage.
    """

    inner_m: float
    outer_m: float
    hinge: float
    actuator_frequency_hz: float
    actuator_damping_ratio: float
    linkage_time_s: float = 0.0


@dataclass(frozen=True)
class DescribedWing:
    """What is believed of a wing.

    Attributes
    ----------
    semi_span_m, semi_chord_m : float
    elastic_axis : float
        Behind mid-chord, in semi-chords.
    mass_kg_per_m, mass_offset_m, pitch_inertia_kg_m : float
        Offset behind the elastic axis, inertia about it.
    bending_stiffness_n_m2, torsion_stiffness_n_m2 : float
    damping_ratio, lift_slope : float
    flap : DescribedFlap
    tanks : tuple of DescribedTank
    accelerometers : tuple of (str, float, float)
        Channel, place along the span, place behind the elastic axis.
    text : str
        Of the file, which goes into the case.
    """

    semi_span_m: float
    semi_chord_m: float
    elastic_axis: float
    mass_kg_per_m: float
    mass_offset_m: float
    pitch_inertia_kg_m: float
    bending_stiffness_n_m2: float
    torsion_stiffness_n_m2: float
    damping_ratio: float
    lift_slope: float
    flap: DescribedFlap
    tanks: tuple[DescribedTank, ...]
    accelerometers: tuple[tuple[str, float, float], ...]
    text: str

    @property
    def flap_chord_m(self) -> float:
        """From hinge to trailing edge."""
        return self.semi_chord_m * (1 - self.flap.hinge)


def read_wing(path: Path) -> DescribedWing:
    """Read a model file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be read, is too large, or lacks a number.
    """
    what = f"model {path}"
    text = read_toml_text(path, what, remedy="give the model's TOML file")
    try:
        return _described(parse_toml(text, what), text)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        allowed = "[wing], [flap], [[tanks]], [[accelerometers]] as in docs/examples/flight_wing.toml"
        raise InputError(what, got=f"{type(error).__name__}: {error}"[:160], allowed=allowed) from error


def _described(document: dict[str, Any], text: str) -> DescribedWing:
    numbers = {name: float(value) for name, value in document["wing"].items() if name != "tolerances"}
    tanks = tuple(DescribedTank(**{k: float(v) for k, v in tank.items()}) for tank in document["tanks"])
    sensors = tuple(
        (str(s["name"]), float(s["y_m"]), float(s["behind_axis_m"])) for s in document["accelerometers"]
    )
    flap = DescribedFlap(**{name: float(value) for name, value in document["flap"].items()})
    return DescribedWing(**numbers, flap=flap, tanks=tanks, accelerometers=sensors, text=text)


_TIMES: Final = {"length_m": 0.3, "height_m": 0.5, "width_m": 1 / 0.15}
_DIMENSION: Final = re.compile(r"^([ \t]*(length_m|height_m|width_m)[ \t]*=[ \t]*)([-+0-9.eE]+)", re.MULTILINE)


def with_spanwise_tanks(wing: DescribedWing) -> DescribedWing:
    """The wing with slender tanks along the span: as heavy, and with a tenth of the inertia in pitch.

    Parameters
    ----------
    wing : DescribedWing
    """
    text = _DIMENSION.sub(lambda found: f"{found[1]}{_TIMES[found[2]] * float(found[3]):.9g}", wing.text)
    return _described(parse_toml(text, "model"), text)
