"""Physics that a wing in flight may have and its twin believes not to be there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from sloshlab.flight_twin.numbers import of_tank, tank_name
from sloshlab.missing_physics.candidate import Effect, EffectParameter, Numbers, Surroundings
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import Range

_TWO_SPEEDS: Final = "the same pulse at two airspeeds"
_TWO_LEVELS: Final = "two amplitudes of the same pulse or gust at one airspeed"
_TWO_FILLS: Final = "the same run at two fills of the tank"
_NO_AIR: Final = "a ground vibration test: the same wing without air"
_PULSE_AND_GUST: Final = "a pulse of the flap beside a gust passage"
_Of = Callable[[Surroundings], float]


def flight_effects(n_tanks: int) -> tuple[Effect, ...]:
    """All effects of a wing with some tanks.

    Parameters
    ----------
    n_tanks : int
    """
    tanks = tuple(tank_name(i) for i in range(n_tanks))
    return (
        *_of_air(),
        *_of_excitation(),
        *_of_control(),
        *_of_structure(),
        *_of_vertical_sloshing(tanks),
        *_of_fill(tanks),
        *_of_lateral_sloshing(tanks),
    )


def _ratio(name: str, low: float, high: float, least: float, most: float) -> EffectParameter:
    """A size of either sign, by its logarithm."""
    return EffectParameter(name, low, high, range=Range(least, most, may_be_negative=True))


def _place(name: str, low: float, high: float, least: float, most: float) -> EffectParameter:
    """A number of which no effect is no zero; its steps are a third of its middle."""
    return EffectParameter(
        name, low, high, range=Range(least, most), tolerance=lambda at: (least * most) ** 0.5 / 3
    )


def _effect(
    name: str,
    block: str,
    equation: str,
    parameters: Sequence[EffectParameter],
    starts: Sequence[Numbers],
    numbers: Mapping[str, str] | None = None,
    *,
    separated_by: str = "",
    variant_of: str = "",
    reduces_to: tuple[str, ...] = (),
    size: tuple[str, ...] = (),
    corrects: str = "",
) -> Effect:
    """An effect on the wing as a whole; `numbers` says which number of the twin each parameter is, if another."""
    meant = {parameter.name: (numbers or {}).get(parameter.name, parameter.name) for parameter in parameters}

    def extension(given: Numbers, at: Surroundings, channel: str) -> Extension:
        del at, channel
        return Extension(numbers={meant[key]: value for key, value in given.items()})

    return Effect(
        name, block, equation, tuple(parameters), lambda at: [dict(start) for start in starts], extension,
        separated_by, variant_of=variant_of, reduces_to=reduces_to, size=size, corrects=corrects,
    )  # fmt: skip


def _tank_effect(
    tanks: tuple[str, ...],
    name: str,
    equation: str,
    parameters: Sequence[EffectParameter],
    starts: Sequence[Numbers],
    numbers: Mapping[str, str],
    separated_by: str,
    size: tuple[str, ...] = (),
) -> Effect:
    """An effect in one of the tanks; `numbers` says which number of the tank each parameter is."""

    def extension(given: Numbers, at: Surroundings, channel: str) -> Extension:
        del at
        tank = tanks.index(channel)
        return Extension(numbers={of_tank(numbers[key], tank): value for key, value in given.items()})

    return Effect(
        name, "tank", equation, tuple(parameters), lambda at: [dict(start) for start in starts], extension,
        separated_by, places=lambda at: tanks, size=size,
    )  # fmt: skip


def _of_air() -> tuple[Effect, ...]:
    return (
        _effect(
            "lift_gain",
            "aerodynamics",
            "q_D Q → (1 + ε) q_D Q",
            [_ratio("ratio", -0.7, 2.0, 0.01, 0.6)],
            [{"ratio": 0.1}, {"ratio": -0.1}],
            {"ratio": "lift_gain"},
            separated_by=_TWO_SPEEDS,
        ),
        _effect(
            "aerodynamic_lag",
            "aerodynamics",
            "lags β → λ β",
            [_place("lag_ratio", 0.05, 50.0, 0.2, 20.0)],
            [{"lag_ratio": ratio} for ratio in (0.5, 0.8, 1.3, 2.5, 8.0)],
            separated_by=f"{_PULSE_AND_GUST}; {_TWO_SPEEDS}",
        ),
        _effect(
            "apparent_mass",
            "aerodynamics",
            "A₂ → (1 + ε) A₂",
            [_ratio("ratio", -1.0, 3.0, 0.1, 1.0)],
            [{"ratio": 0.5}, {"ratio": -0.9}],
            {"ratio": "apparent_mass"},
            separated_by="the same run in air of another density",
        ),
        _effect(
            "aerodynamic_nonlinearity",
            "aerodynamics",
            "lift of a strip stays beyond an angle of attack α_s",
            [_place("stall_angle_rad", 1e-3, 1.0, 0.02, 0.3)],
            [{"stall_angle_rad": angle} for angle in (0.15, 0.10, 0.06, 0.03)],
            separated_by=_TWO_LEVELS,
        ),
    )


def _of_excitation() -> tuple[Effect, ...]:
    delay, constant = (
        _ratio("delay_s", -0.2, 0.2, 1e-3, 0.1),
        EffectParameter("time_constant_s", 0.0, 1.0, range=Range(2e-3, 0.3)),
    )
    return (
        _effect(
            "gust_shape",
            "excitation",
            "the gust at the wing is that of the vane, later by τ",
            [delay],
            [{"delay_s": value} for value in (0.01, -0.01, 0.04)],
            {"delay_s": "gust_delay_s"},
            separated_by=_PULSE_AND_GUST,
        ),
        _effect(
            "low_passed_gust",
            "excitation",
            "the gust at the wing is that of the vane through T ẇ + w = w_vane",
            [constant],
            [{"time_constant_s": value} for value in (0.01, 0.05)],
            {"time_constant_s": "gust_time_constant_s"},
            separated_by=_PULSE_AND_GUST,
            variant_of="gust_shape",
        ),
    )


def _of_control() -> tuple[Effect, ...]:
    return (
        _effect(
            "control_saturation",
            "control",
            "|β| ≤ limit of what is asked of the actuator",
            [_place("limit_rad", 1e-3, 2.0, 0.03, 0.3)],
            [{"limit_rad": limit} for limit in (0.25, 0.18, 0.12, 0.07)],
            {"limit_rad": "flap_limit_rad"},
            separated_by=_TWO_LEVELS,
        ),
        _effect(
            "control_rate_limit",
            "control",
            "|β̇| ≤ rate of the actuator",
            [_place("rate_rad_per_s", 0.01, 100.0, 0.3, 10.0)],
            [{"rate_rad_per_s": rate} for rate in (6.0, 3.0, 1.5, 0.8)],
            {"rate_rad_per_s": "flap_rate_rad_per_s"},
            separated_by=_TWO_LEVELS,
        ),
        _effect(
            "actuator_delay",
            "control",
            "command later by τ",
            [EffectParameter("delay_s", 0.0, 0.3, range=Range(1e-3, 0.1))],
            [{"delay_s": value} for value in (0.005, 0.02, 0.05)],
            {"delay_s": "actuator_delay_s"},
            separated_by=_PULSE_AND_GUST,
        ),
        _effect(
            "control_freeplay",
            "control",
            "play of the hinge between actuator and flap",
            [EffectParameter("play_rad", 0.0, 0.5, range=Range(2e-3, 0.2))],
            [{"play_rad": value} for value in (0.01, 0.03, 0.08)],
            separated_by=_TWO_LEVELS,
        ),
        _effect(
            "airspeed_error",
            "sensor",
            "U → (1 + ε) U in q_D, k and the lags",
            [_ratio("ratio", -0.5, 0.5, 5e-3, 0.3)],
            [{"ratio": 0.05}, {"ratio": -0.05}],
            {"ratio": "airspeed_error"},
            separated_by=_TWO_SPEEDS,
        ),
    )


def _of_structure() -> tuple[Effect, ...]:
    return (
        _effect(
            "structural_damping",
            "structure",
            "loss factor η of every mode beyond its damping",
            [EffectParameter("loss_factor", 0.0, 1.0, range=Range(2e-3, 0.3))],
            [{"loss_factor": value} for value in (0.01, 0.04)],
            separated_by=_NO_AIR,
        ),
        _effect(
            "missing_mode",
            "structure",
            "a mass on a spring at the tip, part of the wing's mass",
            [
                EffectParameter("mass_kg", 0.0, 5.0, range=Range(3e-3, 0.5)),
                EffectParameter("frequency_hz", 0.5, 60.0, range=Range(2.0, 30.0), tolerance=lambda at: 0.2),
                EffectParameter("damping_ratio", 1e-3, 0.5, range=Range(3e-3, 0.1)),
            ],
            [
                {"mass_kg": 0.03, "frequency_hz": frequency, "damping_ratio": 0.02}
                for frequency in (2.5, 3.5, 5.0, 7.0, 9.0, 11.0, 15.0, 20.0)
            ],
            {
                "mass_kg": "missing_mode_kg",
                "frequency_hz": "missing_mode_hz",
                "damping_ratio": "missing_mode_damping",
            },
            separated_by=f"{_TWO_FILLS}; {_NO_AIR}",
            size=("mass_kg",),
        ),
        _effect(
            "clearance",
            "structure",
            "stops beyond a gap at the tip, on both sides",
            [
                EffectParameter("stiffness_n_per_m", 0.0, 1e6, range=Range(20.0, 2e4)),
                _place("gap_m", 1e-4, 1.0, 3e-3, 0.1),
            ],
            [{"stiffness_n_per_m": 300.0, "gap_m": gap} for gap in (0.01, 0.02, 0.04)],
            {"stiffness_n_per_m": "clearance_n_per_m", "gap_m": "clearance_m"},
            separated_by=_TWO_LEVELS,
            size=("stiffness_n_per_m",),
        ),
    )


def _of_vertical_sloshing(tanks: tuple[str, ...]) -> tuple[Effect, ...]:
    return (
        _tank_effect(
            tanks,
            "liquid_sloshing",
            "Δf = −W̄ m_l ω/π G u̇, G = aⁿ/(aⁿ + a_tⁿ) of the acceleration's envelope a",
            [
                EffectParameter("peak_w_bar", 0.0, 10.0, range=Range(0.05, 4.0)),
                _place("threshold_g", 0.02, 10.0, 0.1, 3.0),
                _place("onset_exponent", 1.0, 16.0, 2.0, 12.0),
            ],
            [{"peak_w_bar": 0.8, "threshold_g": g, "onset_exponent": 4.0} for g in (0.2, 0.5, 1.0)],
            {name: name for name in ("peak_w_bar", "threshold_g", "onset_exponent")},
            _TWO_LEVELS,
            ("peak_w_bar",),
        ),
        _tank_effect(
            tanks,
            "effective_mass",
            "Δf = −β m_l ü",
            [_ratio("beta", -1.0, 3.0, 0.01, 0.9)],
            [{"beta": 0.1}, {"beta": -0.1}],
            {"beta": "added_mass"},
            _TWO_FILLS,
        ),
    )


def _of_fill(tanks: tuple[str, ...]) -> tuple[Effect, ...]:
    return (
        _tank_effect(
            tanks,
            "fuel_state",
            "another fill: m_l and its inertia",
            [_place("fill_level", 0.02, 0.98, 0.1, 0.95)],
            [{"fill_level": fill} for fill in (0.3, 0.45, 0.55, 0.7, 0.9)],
            {"fill_level": "fill_level"},
            f"two modes in a ground vibration test; {_TWO_FILLS}",
        ),
        _tank_effect(
            tanks,
            "liquid_loss",
            "m_l falls with time in every run",
            [EffectParameter("rate_kg_per_s", 0.0, 1.0, range=Range(5e-4, 0.1))],
            [{"rate_kg_per_s": rate} for rate in (0.005, 0.02)],
            {"rate_kg_per_s": "loss_kg_per_s"},
            "a longer run",
        ),
    )


def _of_lateral_sloshing(tanks: tuple[str, ...]) -> tuple[Effect, ...]:
    return (
        _tank_effect(
            tanks,
            "lateral_mode",
            "linear sloshing along the chord, driven by pitch",
            [
                EffectParameter("mass_kg", 0.0, 5.0, range=Range(5e-3, 1.0)),
                EffectParameter("frequency_hz", 0.5, 30.0, range=Range(1.0, 10.0), tolerance=lambda at: 0.2),
                EffectParameter("height_ratio", -3.0, 3.0, range=Range(-1.0, 1.0, is_log=False)),
            ],
            [
                {"mass_kg": 0.1, "frequency_hz": frequency, "height_ratio": -0.1}
                for frequency in (1.5, 2.0, 2.7, 3.5, 4.5, 6.0)
            ],
            {"mass_kg": "lateral_mass_kg", "frequency_hz": "lateral_hz", "height_ratio": "lateral_height_ratio"},
            f"{_TWO_FILLS}: its frequency moves with the fill and not with the airspeed",
            ("mass_kg",),
        ),
    )
