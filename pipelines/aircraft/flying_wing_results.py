"""What was computed of a flying aircraft: stability, gusts, and the places of its tanks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.aircraft.flying_wing_gusts import GustCase
from pipelines.aircraft.offset_scan import OffsetScan
from pipelines.aircraft.response_file import RecordedResponse
from pipelines.aircraft.tank_models import TankModels
from pipelines.flutter.analysis import FlutterExperiment, FlutterSettings
from sloshlab.aircraft.flutter_crossings import FlutterCrossing, first_flutter
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.oscillation_measures import OscillationMeasures
from sloshlab.aircraft.vertical_sloshing import TankDeparture
from sloshlab.errors import InputError


@dataclass(frozen=True)
class OneGust:
    """A gust that was asked for in place of those of the source.

    Attributes
    ----------
    speed_m_per_s, amplitude_m_per_s : float
    length_m : float or None
        25 semi-chords if not stated.
    """

    speed_m_per_s: float
    amplitude_m_per_s: float
    length_m: float | None = None

    def __post_init__(self) -> None:
        for name, value in (
            ("--gust-speed", self.speed_m_per_s),
            ("--gust", self.amplitude_m_per_s),
            ("--gust-length", 1.0 if self.length_m is None else self.length_m),
        ):
            if not 0 < value <= 1000:
                raise InputError(name, got=f"{value:g}", allowed="0 < value ≤ 1000")


@dataclass(frozen=True)
class AircraftSettings:
    """What was asked for.

    Attributes
    ----------
    stability : FlutterSettings
    gust : OneGust or None
        In place of the gusts of the source.
    duration_s : float
        Of each simulation.
    """

    stability: FlutterSettings
    gust: OneGust | None = None
    duration_s: float = 40.0

    def __post_init__(self) -> None:
        if not 1 <= self.duration_s <= 600:
            raise InputError("--duration", got=f"{self.duration_s:g} s", allowed="1 … 600")


@dataclass(frozen=True, eq=False)
class GustRun:
    """One model in one gust.

    Attributes
    ----------
    recorded : RecordedResponse
        Thinned out; measures are of all outputs.
    angle_of_attack, first_mode : OscillationMeasures
        Of Δw/U at the node [rad], and of the first mode's largest displacement [m].
    sideways : float
        Largest displacement of a liquid along y over the largest along x; NaN where none sloshes.
    """

    recorded: RecordedResponse
    angle_of_attack: OscillationMeasures
    first_mode: OscillationMeasures
    sideways: float

    @property
    def model(self) -> str:
        """Its name."""
        return self.recorded.model

    @property
    def has_diverged(self) -> bool:
        """Whether its simulation ended before its time, or still grows."""
        return bool(self.recorded.response.ending) or self.angle_of_attack.fate == "grows"


@dataclass(frozen=True, eq=False)
class GustResult:
    """A gust, all models that flew through it, and members of an ensemble in place of the trained model.

    Attributes
    ----------
    gust : GustCase
    runs : dict of str to GustRun
    members : dict of str to tuple of OscillationMeasures
        Angle of attack with each member, by model.
    """

    gust: GustCase
    runs: dict[str, GustRun]
    members: dict[str, tuple[OscillationMeasures, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class AircraftExperiment:
    """An aircraft with tanks, and everything of chapter 3.2 that was computed of it.

    Attributes
    ----------
    flutter : FlutterExperiment
        Root loci of frozen and sideways liquids.
    crossings : dict of str to tuple of FlutterCrossing
        By model; what moves in each.
    by_damping : dict of float to tuple of FlutterCrossing
        With sideways liquids of other damping ratios.
    node : int
        Where the angle of attack is taken.
    gusts : tuple of GustResult
    tanks : TankModels or None
    scan : OffsetScan or None
    """

    flutter: FlutterExperiment
    settings: AircraftSettings
    inputs: tuple[Path, ...]
    model: AircraftModel
    crossings: dict[str, tuple[FlutterCrossing, ...]]
    by_damping: dict[float, tuple[FlutterCrossing, ...]]
    node: int
    gusts: tuple[GustResult, ...]
    tanks: TankModels | None = None
    scan: OffsetScan | None = None
    provenance: Mapping[str, object] = field(default_factory=dict)

    def flutter_of(self, model: str) -> FlutterCrossing | None:
        """First symmetric flutter of ``frozen`` or ``lateral`` liquids."""
        return first_flutter(self.crossings.get(model, ()))

    @property
    def departures(self) -> list[tuple[str, str, TankDeparture]]:
        """Gust, model, and how a tank left what its model knows."""
        return [
            (result.gust.name, run.model, departure)
            for result in self.gusts
            for run in result.runs.values()
            for departure in run.recorded.departures
        ]

    @property
    def flags(self) -> tuple[str, ...]:
        """What must be read before the results."""
        flags = list(self.flutter.flags)
        first: dict[tuple[str, str], list[tuple[str, str, TankDeparture]]] = {}
        for found in self.departures:
            first.setdefault((found[2].tank, found[2].kind), []).append(found)
        for same in first.values():
            gust, model, departure = same[0]
            more = f"; {len(same)} simulations in all" if len(same) > 1 else ""
            flags.append(f"{gust}, {model}: {departure}{more}")
        for result in self.gusts:
            for run in result.runs.values():
                # without trained models a flight beyond flutter diverges as it should
                if run.recorded.response.ending and run.model in ("vertical", "full"):
                    flags.append(f"{result.gust.name}, {run.model}: {run.recorded.response.ending}")
        return tuple(flags)
