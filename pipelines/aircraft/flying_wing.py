"""Stability and gust responses of a flying aircraft whose tanks slosh sideways and vertically (chapter 3.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from pipelines.aircraft.flying_wing_gusts import GustCase, source_gusts
from pipelines.aircraft.flying_wing_results import (
    AircraftExperiment,
    AircraftSettings,
    GustResult,
    GustRun,
    OneGust,
)
from pipelines.aircraft.gust_runs import GustedAircraft
from pipelines.aircraft.offset_scan import OffsetScan, ScanFile, read_scan, require_pair, scan_offsets
from pipelines.aircraft.response_file import largest_displacements
from pipelines.aircraft.tank_models import TankModels, load_tank_models, require_light_liquid
from pipelines.flutter.analysis import flutter_of
from pipelines.flutter.problem import BoxShapes, FlutterProblem, problem_of
from pipelines.report.progress import progress
from sloshlab.aeroelastic.gust import USUAL_LENGTH_IN_SEMI_CHORDS
from sloshlab.aircraft.flutter_crossings import FlutterCrossing, first_flutter, flutter_crossings
from sloshlab.aircraft.linear_flight import LiquidModel
from sloshlab.aircraft.model import AircraftModel, load_model
from sloshlab.aircraft.oscillation_measures import OscillationMeasures, oscillation_measures
from sloshlab.aircraft.tank_simulation import FlightResponse
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]

DAMPING_RATIOS: Final = (0.0, 0.005, 0.02)
"""Of sideways sloshing, which the source does not print."""
KEPT_STEP_S: Final = 5e-3
"""Between outputs that are kept: a tenth of the period of 20 Hz."""
_CROSSING_STEP_M_PER_S: Final = 0.5


def analyse_aircraft(
    path: Path,
    settings: AircraftSettings,
    *,
    rom: Path | None = None,
    ensemble: Path | None = None,
    scan: Path | None = None,
    cache: Path | None = None,
) -> AircraftExperiment:
    """Compute stability, gust responses and, if asked, the scan of the places of two tanks.

    Parameters
    ----------
    path : Path
        Model of a free aircraft.
    settings : AircraftSettings
    rom, ensemble : Path, optional
        Trained model of the liquid, and its ensemble; without them liquids are frozen or slosh sideways only.
    scan : Path, optional
        File of the places to look at.
    cache : Path, optional
        Folder that keeps generalised forces of the doublet lattice.

    Raises
    ------
    InputError
        If a file is bad, the aircraft is clamped, its liquid heavier than itself, or it does not flutter where
        gusts need it to.
    """
    model = load_model(path)
    if not model.structure.is_free:
        raise InputError(f"aircraft {path}", got="a clamped structure", allowed="one that flies freely")
    require_light_liquid(model)
    if ensemble is not None and rom is None:
        raise InputError("--ensemble", got="no --rom", allowed="the model that it was trained with, too")
    tanks = None if rom is None else load_tank_models(model, rom, ensemble)
    asked = None if scan is None else read_scan(scan)
    if asked is not None:
        require_pair(model)
    problem = problem_of(model, (), cache)
    inputs = (path, *(() if tanks is None else tanks.files), *(() if scan is None else (scan,)))
    flutter = flutter_of(problem, settings.stability, inputs)
    crossings, by_damping = _crossings(model, problem, settings)
    node = _nearest_to_centre(model)
    gusts = _gust_results(problem, tanks, _planned(crossings, problem, settings), settings, node)
    scanned = _scanned(model, problem, asked)
    return AircraftExperiment(flutter, settings, inputs, model, crossings, by_damping, node, gusts, tanks, scanned)


def _scanned(model: AircraftModel, problem: FlutterProblem, asked: ScanFile | None) -> OffsetScan | None:
    if asked is None or not isinstance(problem.shapes, BoxShapes):
        return None
    return scan_offsets(model, problem.rational, problem.shapes.boxes, asked)


def _nearest_to_centre(model: AircraftModel) -> int:
    structure = model.structure
    apart = np.linalg.norm(structure.places_m - structure.mass_centre_m, axis=1)
    return structure.nodes[int(apart.argmin())]


def _crossings(
    model: AircraftModel, problem: FlutterProblem, settings: AircraftSettings
) -> tuple[dict[str, tuple[FlutterCrossing, ...]], dict[float, tuple[FlutterCrossing, ...]]]:
    """Of frozen and sideways liquids, and of sideways ones with other damping."""
    asked = settings.stability
    n = max(2, round((asked.last_m_per_s - asked.first_m_per_s) / _CROSSING_STEP_M_PER_S) + 1)
    speeds = np.linspace(asked.first_m_per_s, asked.last_m_per_s, n)
    with threadpool_limits(1):
        found = {"frozen": flutter_crossings(model, problem.rational, "frozen", speeds)}
        if not model.tanks:
            return found, {}
        found["lateral"] = flutter_crossings(model, problem.rational, "lateral", speeds)
        by_damping = {
            ratio: flutter_crossings(with_sloshing_damping(model, ratio), problem.rational, "lateral", speeds)
            for ratio in DAMPING_RATIOS
        }
    return found, by_damping


def with_sloshing_damping(model: AircraftModel, ratio: float) -> AircraftModel:
    """The same aircraft with another damping ratio of all sideways liquids."""
    return replace(model, tanks=tuple(replace(tank, sloshing_damping_ratio=ratio) for tank in model.tanks))


def _planned(
    crossings: dict[str, tuple[FlutterCrossing, ...]], problem: FlutterProblem, settings: AircraftSettings
) -> tuple[GustCase, ...]:
    b = problem.rational.semi_chord_m
    if settings.gust is not None:
        return (_case_of(settings.gust, b),)
    flutter = {name: first_flutter(found) for name, found in crossings.items()}
    speeds = {name: found.speed_m_per_s for name, found in flutter.items() if found is not None}
    n_tanks = 0 if problem.flown is None else len(problem.flown.model.tanks)
    return source_gusts(n_tanks, speeds, b)


def _case_of(gust: OneGust, semi_chord_m: float) -> GustCase:
    length = USUAL_LENGTH_IN_SEMI_CHORDS * semi_chord_m if gust.length_m is None else gust.length_m
    name = f"{gust.amplitude_m_per_s:g} m/s at {gust.speed_m_per_s:g} m/s"
    return GustCase(name, gust.speed_m_per_s, gust.amplitude_m_per_s, length)


def _gust_results(
    problem: FlutterProblem,
    tanks: TankModels | None,
    gusts: tuple[GustCase, ...],
    settings: AircraftSettings,
    node: int,
) -> tuple[GustResult, ...]:
    if problem.flown is None:
        return ()
    aircraft = GustedAircraft(problem.flown, problem.rational, tanks)
    members = range(0 if tanks is None else len(tanks.members))
    sloshing = tuple(name for name in aircraft.models if name in ("vertical", "full"))
    n_main = sum(gust.is_main for gust in gusts)
    total = len(gusts) * len(aircraft.models) + n_main * len(sloshing) * len(members)
    results = []
    with threadpool_limits(1), progress("gusts", total) as advance:
        for gust in gusts:
            runs: dict[str, GustRun] = {}
            for name in aircraft.models:
                runs[name] = _run(aircraft, gust, name, (settings.duration_s, node))
                advance(f"{gust.name}, {name}")
            of_members: dict[str, tuple[OscillationMeasures, ...]] = {}
            for name in sloshing if gust.is_main and members else ():
                of_members[name] = _of_members(aircraft, gust, name, (settings.duration_s, node), advance)
            results.append(GustResult(gust, runs, of_members))
    return tuple(results)


def _of_members(
    aircraft: GustedAircraft,
    gust: GustCase,
    name: LiquidModel,
    duration_and_node: tuple[float, int],
    advance: Callable[[str], None],
) -> tuple[OscillationMeasures, ...]:
    found = []
    for member in range(len(aircraft.tanks.members) if aircraft.tanks else 0):
        found.append(_run(aircraft, gust, name, duration_and_node, member).angle_of_attack)
        advance(f"{gust.name}, {name}, member {member + 1}")
    return tuple(found)


def _run(
    aircraft: GustedAircraft,
    gust: GustCase,
    name: LiquidModel,
    duration_and_node: tuple[float, int],
    member: int | None = None,
) -> GustRun:
    duration_s, node = duration_and_node
    recorded = aircraft.through(gust, name, duration_s, member)
    response = recorded.response
    passed_s = gust.length_m / gust.speed_m_per_s
    angle = oscillation_measures(response.time_s, response.angle_of_attack_at(node), start_s=passed_s)
    first = oscillation_measures(response.time_s, largest_displacements(response)[:, 0], start_s=passed_s)
    return GustRun(replace(recorded, response=_thinned(response)), angle, first, _sideways(response))


def _sideways(response: FlightResponse) -> float:
    """Largest displacement of liquids along y over that along x; NaN where none sloshes."""
    liquids = response.flight.liquids
    if not liquids:
        return float("nan")
    largest = np.abs(response.liquid_displacement_m).max(axis=0)
    # tank, plane and number: the letter of the plane stands before the number
    is_sideways = np.array([name.rpartition(" ")[2].startswith("y") for name in liquids])
    return float(largest[is_sideways].max() / max(largest[~is_sideways].max(), np.finfo(float).tiny))


def _thinned(response: FlightResponse) -> FlightResponse:
    """Every so many outputs, so that all simulations of a command fit into memory."""
    if response.time_s.size < 2:
        return response
    every = max(1, round(KEPT_STEP_S / float(response.time_s[1] - response.time_s[0])))
    return replace(
        response,
        time_s=response.time_s[::every].copy(),
        states=response.states[::every].copy(),
        force_n=response.force_n[::every].copy(),
        wind=response.wind[::every].copy(),
    )
