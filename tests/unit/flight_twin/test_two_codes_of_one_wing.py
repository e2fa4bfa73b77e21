"""Twin and laboratory share no code: with the same physics they read the same, to what both leave out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.virtual_flight.described_wing import read_wing
from acquisition.virtual_flight.flight_test import CARD, FlightPoint
from acquisition.virtual_flight.hidden_physics import HiddenFlight, Oscillator
from acquisition.virtual_flight.recorded_flight import Laboratory, perfect_run
from sloshlab.flight_twin.described_wing import read_flight_wing
from sloshlab.flight_twin.simulation import DENSITY, FlightSimulation
from sloshlab.user_twin.description import TwinRun

MODEL = Path(__file__).parents[3] / "docs/examples/flight_wing.toml"
GUST, PULSE, TAXI = CARD[0], CARD[2], CARD[5]
CASES = {
    "nothing": (GUST, HiddenFlight(), {}),
    "nothing in a pulse": (PULSE, HiddenFlight(), {}),
    "nothing on the ground": (TAXI, HiddenFlight(), {}),
    "lift_gain": (PULSE, HiddenFlight(lift_gain=0.2), {"lift_gain": 0.2}),
    "aerodynamic_lag": (GUST, HiddenFlight(lag_ratio=2.0), {"lag_ratio": 2.0}),
    "airspeed_error": (GUST, HiddenFlight(airspeed_ratio=0.06), {"airspeed_error": 0.06}),
    "gust delay": (GUST, HiddenFlight(gust_delay_s=0.02), {"gust_delay_s": 0.02}),
    "gust low pass": (GUST, HiddenFlight(gust_time_constant_s=0.05), {"gust_time_constant_s": 0.05}),
    "control_saturation": (PULSE, HiddenFlight(flap_limit_rad=0.08), {"flap_limit_rad": 0.08}),
    "control_rate_limit": (PULSE, HiddenFlight(flap_rate_rad_per_s=2.0), {"flap_rate_rad_per_s": 2.0}),
    "actuator_delay": (PULSE, HiddenFlight(actuator_delay_s=0.02), {"actuator_delay_s": 0.02}),
    "control_freeplay": (PULSE, HiddenFlight(play_rad=0.05), {"play_rad": 0.05}),
    "structural_damping": (TAXI, HiddenFlight(loss_factor=0.03), {"loss_factor": 0.03}),
    "effective_mass": (GUST, HiddenFlight(effective_mass={1: -0.1}), {"added_mass of tank_2": -0.1}),
    "liquid_loss": (GUST, HiddenFlight(liquid_loss_kg_per_s={1: 0.03}), {"loss_kg_per_s of tank_2": 0.03}),
    "missing_mode": (
        TAXI,
        HiddenFlight(oscillators=(Oscillator(1.6, 0.0, 6.0, 0.02, 0.05, 0.05),)),
        {"missing_mode_hz": 6.0, "missing_mode_damping": 0.02, "missing_mode_kg": 0.05},
    ),
    "lateral_mode": (
        GUST,
        HiddenFlight(oscillators=(Oscillator(1.25, 0.0, 3.0, 0.005, 1.0, 0.0414, 49.0333, turns=True),)),
        # far more than the tank holds, as it hardly shows; h = 0.3 g/ω² at 3 Hz, √m = 5: 0.0414 = 5 × 0.00828
        {
            "lateral_hz of tank_2": 3.0,
            "lateral_mass_kg of tank_2": 25.0,
            "lateral_height_ratio of tank_2": 0.3,
        },
    ),
}


@pytest.fixture(scope="module")
def twin() -> FlightSimulation:
    return FlightSimulation(read_flight_wing(MODEL))


def flown(point: FlightPoint, hidden: HiddenFlight) -> TwinRun:
    readings = perfect_run(read_wing(MODEL), hidden, Laboratory(), point, [7])
    return TwinRun("run", 128.0, readings["velocity_gust"].size, readings, {DENSITY: 1.2})


def largest_error(twin: FlightSimulation, run: TwinRun, values: dict[str, float]) -> float:
    """Over accelerometers, RMS of the difference over that of the reading."""
    simulated = twin.simulate(run, values).readings
    names = [each.name for each in twin.described.accelerometers]
    return max(float(np.std(simulated[name] - run.channels[name]) / np.std(run.channels[name])) for name in names)


@pytest.mark.parametrize("name", list(CASES))
def test_both_read_the_same(twin: FlightSimulation, name: str) -> None:
    point, hidden, values = CASES[name]
    run = flown(point, hidden)
    # one per cent: modes that the twin leaves out, strips against Gauss points, steps against Runge–Kutta; a
    # limit falls between two steps
    assert largest_error(twin, run, values) < (0.02 if "limit" in str(values) or "rate" in str(values) else 0.01)
    if values:
        assert largest_error(twin, run, {}) > 3 * largest_error(twin, run, values)


def test_forces_that_are_not_linear(twin: FlightSimulation) -> None:
    """Steps with a corrector against Runge–Kutta with eight times as many: one or two per cent."""
    stalled = flown(CARD[1], HiddenFlight(stall_angle_rad=0.08))
    assert largest_error(twin, stalled, {"stall_angle_rad": 0.08}) < 0.02 < 0.1 * largest_error(twin, stalled, {})
    wet = flown(TAXI, HiddenFlight(sloshing={1: (0.5, 1.0)}))
    numbers = {"threshold_g of tank_2": 0.5, "peak_w_bar of tank_2": 1.0, "onset_exponent of tank_2": 6.0}
    assert largest_error(twin, wet, numbers) < 0.01 < 0.1 * largest_error(twin, wet, {})
