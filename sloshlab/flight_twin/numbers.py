"""Numbers of the twin: those that a laboratory believes, and those of physics that it may have left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sloshlab.flight_twin.described_wing import FlightWing
from sloshlab.user_twin.description import Parameter

BELIEVED: Final = (
    "bending stiffness",
    "torsion stiffness",
    "bending damping",
    "torsion damping",
    "actuator frequency",
)
"""Parameters of the baseline, over what the model file says."""
NOTHING: Final[Mapping[str, float]] = {
    "lift_gain": 0.0,
    "lag_ratio": 1.0,
    "apparent_mass": 0.0,
    "stall_angle_rad": float("inf"),
    "airspeed_error": 0.0,
    "gust_delay_s": 0.0,
    "gust_time_constant_s": 0.0,
    "flap_limit_rad": float("inf"),
    "flap_rate_rad_per_s": float("inf"),
    "actuator_delay_s": 0.0,
    "play_rad": 0.0,
    "loss_factor": 0.0,
    "clearance_m": float("inf"),
    "clearance_n_per_m": 0.0,
}
"""Numbers of effects that act on the wing as a whole, where they are not there."""
OF_A_TANK: Final[Mapping[str, float]] = {
    "added_mass": 0.0,
    "fill_level": 0.0,
    "loss_kg_per_s": 0.0,
    "threshold_g": 1.0,
    "peak_w_bar": 0.0,
    "onset_exponent": 4.0,
    "lateral_hz": 0.0,
    "lateral_mass_kg": 0.0,
    "lateral_height_ratio": 0.0,
}
"""The same of one tank, under ``NAME of tank_1``; a fill level of 0 is that of the model file."""
OF_A_MODE: Final = ("missing_mode_hz", "missing_mode_damping", "missing_mode_kg")
"""Of one more mode of the structure."""


def of_tank(name: str, tank: int) -> str:
    """Name of a number of one tank, counted from 0.

    Examples
    --------
    >>> of_tank("peak_w_bar", 0)
    'peak_w_bar of tank_1'
    """
    return f"{name} of {tank_name(tank)}"


def tank_name(tank: int) -> str:
    """Place of effects of a tank, counted from 0.

    Examples
    --------
    >>> tank_name(1)
    'tank_2'
    """
    return f"tank_{tank + 1}"


def parameters_of(described: FlightWing) -> list[Parameter]:
    """The baseline's parameters, relative to the model file.

    Parameters
    ----------
    described : FlightWing
    """
    tolerances = described.wing.tolerances
    of = {
        "bending stiffness": tolerances.bending_stiffness,
        "torsion stiffness": tolerances.torsion_stiffness,
        "bending damping": tolerances.damping,
        "torsion damping": tolerances.damping,
        "actuator frequency": tolerances.actuator_frequency,
    }
    return [Parameter(name, 1.0, of[name]) for name in BELIEVED]
