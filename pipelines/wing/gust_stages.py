"""Stages of a wing in gusts and in a landing: frozen liquids, trained models, dampers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from pipelines.aircraft.response_file import RecordedCase, RecordedResponse
from pipelines.aircraft.tank_models import TankModels
from pipelines.wing.results import FROZEN, SLOSHING, GustCase, Reading, WingSettings
from sloshlab.aeroelastic.gust import USUAL_LENGTH_IN_SEMI_CHORDS, GustShape, one_minus_cosine
from sloshlab.aircraft.landing import fuselage_acceleration_m_per_s2, fuselage_velocity_m_per_s, landing_flight
from sloshlab.aircraft.linear_flight import LinearFlight, linear_flight
from sloshlab.aircraft.linear_sloshing import with_dampers
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.oscillation_measures import damping_between_peaks, limit_cycle_of
from sloshlab.aircraft.tank_simulation import simulate_flight
from sloshlab.aircraft.vertical_sloshing import LARGEST_ACCELERATION_G
from sloshlab.aircraft.wing_air import WingAir
from sloshlab.aircraft.wing_calibration import WingState
from sloshlab.aircraft.wing_file import LandingSection
from sloshlab.constants import GRAVITY_M_PER_S2

FloatArray = npt.NDArray[np.float64]
Advance = Callable[[str], None]
OUTPUT_STEP_S = 5e-3
"""Forty samples of a cycle at 5 Hz; the shortest gust, 45 m at 321 m/s, has its straight lines 0.3 % off."""
_LARGEST_ACCELERATION_M_PER_S2 = LARGEST_ACCELERATION_G * GRAVITY_M_PER_S2
_PASSAGE_S = 1.0
"""In which a gust has passed and frozen liquids have had their largest acceleration, if they do not diverge."""
_LONGEST_LANDING_S = 10.0
_SMALLER = 0.9
_MOST_TRIES = 6


def tip_node(model: AircraftModel) -> int:
    """The outermost node."""
    return model.structure.nodes[-1]


def gust_length_m(state: WingState, settings: WingSettings) -> float:
    """L_g as asked, or 25 semi-chords."""
    if settings.gust_length_m is not None:
        return settings.gust_length_m
    return USUAL_LENGTH_IN_SEMI_CHORDS * state.described.aerodynamics.semi_chord_m


def flight_at(model: AircraftModel, air: WingAir, speed_m_per_s: float) -> LinearFlight:
    """The wing with frozen liquids, or their linear substitutes, at a speed."""
    return linear_flight(
        model, "frozen", speed_m_per_s=speed_m_per_s, air=air.motion, gust=air.gust,
        density_kg_per_m3=model.density_kg_per_m3,
    )  # fmt: skip


def gust_of(state: WingState, settings: WingSettings, speed_m_per_s: float, amplitude_m_per_s: float) -> GustShape:
    """1 − cos as (3.38)."""
    return one_minus_cosine(
        amplitude_m_per_s, gust_length_m=gust_length_m(state, settings), speed_m_per_s=speed_m_per_s
    )


def gust_case(
    state: WingState, tanks: TankModels, settings: WingSettings, gust: tuple[float, float], advance: Advance
) -> GustCase:
    """One gust with frozen and with sloshing liquids.

    Parameters
    ----------
    state : WingState
    tanks : TankModels
    settings : WingSettings
    gust : tuple of float
        U and w_ga of the source; w_ga is made smaller until all tanks stay below 6 g, as the source chose its own.
    advance : callable
    """
    speed, printed = gust
    flight = flight_at(state.model, state.air, speed)

    def flown(name: str, amplitude: float, duration_s: float = settings.duration_s) -> RecordedResponse:
        shape = gust_of(state, settings, speed, amplitude)
        if name == SLOSHING:
            return tanks.flown(name, flight, shape, duration_s=duration_s, output_step_s=OUTPUT_STEP_S)
        response = simulate_flight(flight, duration_s=duration_s, output_step_s=OUTPUT_STEP_S, gust=shape)
        return RecordedResponse(name, response)

    # frozen liquids are linear: their largest acceleration tells the largest gust, the trained models then decide
    linear = _largest(flown(FROZEN, printed, min(_PASSAGE_S, settings.duration_s)))
    first = printed * min(1.0, _LARGEST_ACCELERATION_M_PER_S2 / linear)
    # the last one is kept, whatever its tanks feel: both liquids fly through the same gust
    for amplitude in first * _SMALLER ** np.arange(_MOST_TRIES):
        sloshing = flown(SLOSHING, float(amplitude))
        if not sloshing.response.ending and _largest(sloshing) <= _LARGEST_ACCELERATION_M_PER_S2:
            break
    advance(f"{speed:g} m/s, gust of {amplitude:.3g} m/s")
    length = gust_length_m(state, settings)
    name = f"{speed:g} m/s, w = {amplitude:.3g} m/s"
    case = RecordedCase(name, speed, float(amplitude), length, (flown(FROZEN, float(amplitude)), sloshing))
    return GustCase(case, readings_of(case, length / speed), printed)


def _largest(run: RecordedResponse) -> float:
    """Acceleration of any tank [m/s²]."""
    return float(np.abs(run.response.tank_acceleration_m_per_s2).max(initial=0.0))


def readings_of(case: RecordedCase, after_s: float) -> Mapping[str, Reading]:
    """Motion of the tip in all models, damping from a time on."""
    found = {}
    for run in case.runs:
        response = run.response
        node = tip_node(response.flight.model)
        displacement = response.states @ response.flight.displacement_at(node)
        acceleration = response.acceleration_at(node)
        later = response.time_s >= after_s
        damping = damping_between_peaks(response.time_s[later], displacement[later])
        found[run.model] = Reading(
            run, displacement, acceleration, damping, limit_cycle_of(response.time_s, displacement)
        )
    return found


def damper_case(
    state: WingState,
    trained: GustCase,
    dampers: Mapping[str, Mapping[str, float]],
    settings: WingSettings,
    advance: Advance,
) -> GustCase:
    """The gust of a case with dampers of (E.8) in place of the trained models.

    Parameters
    ----------
    state : WingState
    trained : GustCase
        Frozen and sloshing.
    dampers : mapping
        c of each tank by the name of the choice.
    settings : WingSettings
    advance : callable
    """
    speed, amplitude = trained.case.speed_m_per_s, trained.case.amplitude_m_per_s
    shape = gust_of(state, settings, speed, amplitude)
    runs = list(trained.case.runs)
    for name, damping in dampers.items():
        flight = flight_at(with_dampers(state.model, damping), state.air, speed)
        response = simulate_flight(flight, duration_s=settings.duration_s, output_step_s=OUTPUT_STEP_S, gust=shape)
        runs.append(RecordedResponse(name, response))
        advance(f"damper {name}")
    case = RecordedCase(f"dampers, {trained.case.name}", speed, amplitude, trained.case.length_m, tuple(runs))
    return GustCase(case, readings_of(case, trained.case.length_m / speed), trained.printed_m_per_s)


def landing_case(
    state: WingState,
    air: WingAir,
    landing: LandingSection,
    tanks: TankModels,
    settings: WingSettings,
    advance: Advance,
) -> GustCase:
    """The landing with frozen and with sloshing liquids; acceleration of the tip with that of the fuselage.

    Parameters
    ----------
    state : WingState
    air : WingAir
        At the Mach number of the landing.
    landing : LandingSection
    tanks : TankModels
    settings : WingSettings
    advance : callable
    """
    flight = landing_flight(state.described, state.model, air.motion, landing)
    duration_s = min(settings.duration_s, _LONGEST_LANDING_S)

    def fuselage(time_s: FloatArray) -> FloatArray:
        return fuselage_velocity_m_per_s(landing, time_s)

    runs = [
        RecordedResponse(
            FROZEN, simulate_flight(flight, duration_s=duration_s, output_step_s=OUTPUT_STEP_S, gust=fuselage)
        )
    ]
    advance(f"landing, {FROZEN}")
    runs.append(tanks.flown(SLOSHING, flight, fuselage, duration_s=duration_s, output_step_s=OUTPUT_STEP_S))
    advance(f"landing, {SLOSHING}")
    case = RecordedCase("landing", landing.speed_m_per_s, float("nan"), float("nan"), tuple(runs))
    readings = {}
    for name, reading in readings_of(case, landing.pulse_s).items():
        of_fuselage = fuselage_acceleration_m_per_s2(landing, reading.record.response.time_s)
        readings[name] = Reading(
            reading.record, reading.displacement_m, reading.acceleration_m_per_s2 + of_fuselage,
            reading.damping, reading.end,
        )  # fmt: skip
    return GustCase(case, readings)
