"""Effects of the structure and of the base under it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from sealed_trial.hidden_physics.effect import Change, DrawnEffect, HiddenEffect, Scales
from sealed_trial.hidden_physics.outside_forces import outside_force
from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.prescribed_motion import acting
from sealed_trial.laboratory.system import storage_of_springs

_CARRIED = ("sdof", "beam")


def _effect(name: str, change: Callable[[float], Change], least: float = 1e-4, most: float = 1e3) -> DrawnEffect:
    return DrawnEffect(name, "structure", change, least=least, most=most)


def _proportional(
    name: str, parameter: str, place: int, unit: float, *, least: float = 1e-4, most: float = 1e3
) -> DrawnEffect:
    """An effect of one parameter, proportional to the magnitude."""
    return _effect(name, lambda m: Change({parameter: m * unit}, {place: m * unit}), least, most)


def _sign(generator: np.random.Generator) -> float:
    return 1.0 if generator.random() < 0.5 else -1.0


def viscous(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Far more viscous damping than the laboratory's uncertainty."""
    return _proportional(
        "viscous_damping", "damping_n_s_per_m", at.STRUCTURE_VISCOUS, scales.damping_n_s_per_m, least=0.3, most=6.0
    )


def coulomb(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Dry friction of one force."""
    unit = 0.004 * scales.force_n

    def change(m: float) -> Change:
        return Change({"force_n": m * unit}, {at.FRICTION_UP: m * unit, at.FRICTION_DOWN: m * unit})

    return _effect("coulomb_friction", change)


def asymmetric(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Dry friction whose force differs up and down."""
    unit, ratio = 0.004 * scales.force_n, generator.uniform(1.5, 2.5) ** _sign(generator)

    def change(m: float) -> Change:
        up, down = m * unit * math.sqrt(ratio), m * unit / math.sqrt(ratio)
        return Change({"force_up_n": up, "force_down_n": down}, {at.FRICTION_UP: up, at.FRICTION_DOWN: down})

    def asymmetry(m: float) -> Change:
        return Change({}, {at.CONSTANT: 0.5 * m * unit * (1 / math.sqrt(ratio) - math.sqrt(ratio))})

    return replace(_effect("asymmetric_friction", change), essential=asymmetry)


def stribeck(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Dry friction that falls with the velocity."""
    unit, extra = 0.004 * scales.force_n, generator.uniform(0.8, 1.6)
    velocity = scales.velocity_m_per_s * generator.uniform(0.08, 0.2)

    def change(m: float) -> Change:
        true = {"coulomb_n": m * unit, "static_n": m * unit * (1 + extra), "stribeck_velocity_m_per_s": velocity}
        return Change(
            true,
            {
                at.FRICTION_UP: m * unit,
                at.FRICTION_DOWN: m * unit,
                at.FRICTION_STATIC_EXTRA: m * unit * extra,
                at.FRICTION_STRIBECK: velocity,
            },
        )

    return _effect("stribeck_friction", change)


def drag(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Damping force with the square of the velocity."""
    unit = scales.damping_n_s_per_m / scales.velocity_m_per_s
    return _proportional("quadratic_drag", "drag_n_s2_per_m2", at.STRUCTURE_DRAG, unit)


def structural(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Loss that no frequency changes, by relaxing springs; the first mode stays where it is."""
    stiffening = storage_of_springs(0.0, scales.rate_rad_per_s)

    def change(m: float) -> Change:
        gain = 0.04 * m * scales.stiffness_n_per_m
        return Change(
            {"loss_factor": 0.04 * m}, {at.RELAXATION_GAIN: gain, at.STIFFNESS_CHANGE: -gain * stiffening}
        )

    return _effect("structural_damping", change, 0.3, 2.5)


def hysteresis(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Bouc–Wen: a spring that yields."""
    stiffness = 0.03 * scales.stiffness_n_per_m
    reach = scales.displacement_m * generator.uniform(0.15, 0.4)
    exponent = float(generator.integers(1, 3))

    def change(m: float) -> Change:
        return Change(
            {"stiffness_n_per_m": m * stiffness},
            {
                at.HYSTERESIS_STIFFNESS: m * stiffness,
                at.HYSTERESIS_YIELD: m * stiffness * reach,
                at.HYSTERESIS_EXPONENT: exponent,
            },
        )

    return _effect("hysteresis", change, most=20.0)


def cubic(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Hardening or softening spring."""
    unit = 0.03 * _sign(generator) * scales.stiffness_n_per_m / scales.displacement_m**2
    return _proportional("cubic_stiffness", "stiffness_n_per_m3", at.STIFFNESS_CUBIC, unit, most=12.0)


def quadratic(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Spring that differs between pull and push."""
    unit = 0.03 * _sign(generator) * scales.stiffness_n_per_m / scales.displacement_m
    return _proportional("quadratic_stiffness", "stiffness_n_per_m2", at.STIFFNESS_QUADRATIC, unit, most=12.0)


def clearance(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Stops on both sides."""
    gap, unit = scales.displacement_m * generator.uniform(0.35, 0.65), 0.3 * scales.stiffness_n_per_m

    def change(m: float) -> Change:
        damping = 0.002 * m * unit / scales.rate_rad_per_s
        kernel = {at.CLEARANCE_GAP: gap, at.CLEARANCE_STIFFNESS: m * unit, at.CLEARANCE_DAMPING: damping}
        return Change({"gap_m": gap, "stiffness_n_per_m": m * unit}, kernel)

    return _effect("clearance", change, most=50.0)


def missing_mode(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A small mass on a spring and a damper beside the tank."""
    rate, ratio = scales.rate_rad_per_s * generator.uniform(1.4, 2.6), generator.uniform(0.01, 0.03)

    def change(m: float) -> Change:
        mass = 0.03 * m * scales.mass_kg
        true = {"frequency_hz": rate / (2 * math.pi), "damping_ratio": ratio, "participation": mass}
        return Change(true, {at.APPENDAGE_MASS: mass, at.APPENDAGE_RATE: rate, at.APPENDAGE_DAMPING: ratio})

    return _effect("missing_mode", change, most=12.0)


def constant(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A force that never changes."""
    return _proportional(
        "constant_force", "force_n", at.CONSTANT, 0.01 * _sign(generator) * scales.force_n, most=40.0
    )


def rocking(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """The root gives way to the bending moment."""
    unit = 0.06 / (scales.stiffness_n_per_m * scales.length_m**2)

    def change(m: float) -> Change:
        return Change({"compliance_rad_per_n_m": m * unit}, compliance_rad_per_n_m=m * unit)

    return DrawnEffect("base_rocking", "excitation", change, least=0.02, most=12.0)


def behind_play(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A slider with dry friction behind a play; in half of the cases it holds more in one direction."""
    unit, play = 0.02 * scales.force_n, scales.displacement_m * generator.uniform(0.15, 0.5)
    give = scales.displacement_m * generator.uniform(0.05, 0.2)
    differs = generator.random() < 0.5
    root = generator.uniform(1.5, 2.5) ** (0.5 * _sign(generator)) if differs else 1.0

    def change(m: float) -> Change:
        up, down, stiffness = m * unit * root, m * unit / root, m * unit / give
        forces = {"force_up_n": up, "force_down_n": down} if differs else {"force_n": up}
        return Change(
            {**forces, "play_m": play, "stiffness_n_per_m": stiffness},
            {at.SLIDER_UP: up, at.SLIDER_DOWN: down, at.SLIDER_PLAY: play, at.SLIDER_STIFFNESS: stiffness},
        )

    return _effect("friction_behind_play", change, most=20.0)


def saturation(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """An actuator under the base that gives no more than it can, in half of the cases with a dead zone."""
    peak, rms = scales.peak["acceleration_root"], scales.rms["acceleration_root"]
    share = generator.uniform(0.05, 0.15) if generator.random() < 0.5 else 0.0

    def change(m: float) -> Change:
        limit, dead_zone = peak / (1 + 0.4 * m), share * rms * min(m, 3.0)
        return Change(
            {"limit": limit, "dead_zone": dead_zone}, obeyed=lambda motion: acting(motion, limit, dead_zone)
        )

    return DrawnEffect("actuator_saturation", "excitation", change, "acceleration_root", 0.05, 10.0)


def outside(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Blows, or another machine, at the structure."""
    return outside_force("structure", 0.01 * scales.force_n, scales, generator)


STRUCTURE_EFFECTS: Final = (
    HiddenEffect("viscous_damping", "structure", viscous, ("sdof",), needs_frequencies=True),
    HiddenEffect("coulomb_friction", "structure", coulomb, _CARRIED, needs_levels=True, is_friction=True),
    HiddenEffect("stribeck_friction", "structure", stribeck, _CARRIED, needs_levels=True, is_friction=True),
    HiddenEffect("quadratic_drag", "structure", drag, _CARRIED, needs_levels=True),
    HiddenEffect("structural_damping", "structure", structural, ("sdof",), needs_frequencies=True),
    HiddenEffect("hysteresis", "structure", hysteresis, _CARRIED, needs_levels=True),
    HiddenEffect("cubic_stiffness", "structure", cubic, _CARRIED, needs_levels=True),
    HiddenEffect("quadratic_stiffness", "structure", quadratic, _CARRIED, needs_levels=True),
    HiddenEffect("clearance", "structure", clearance, _CARRIED, needs_levels=True),
    HiddenEffect("missing_mode", "structure", missing_mode, _CARRIED, needs_levels=True),
    HiddenEffect("constant_force", "structure", constant, _CARRIED),
    HiddenEffect("base_rocking", "excitation", rocking, ("beam",)),
    HiddenEffect("friction_behind_play", "structure", behind_play, _CARRIED, needs_levels=True, is_friction=True),
    HiddenEffect("external_force", "structure", outside, _CARRIED),
    HiddenEffect(
        "actuator_saturation", "excitation", saturation, _CARRIED, needs_levels=True, needs_driven_base=True
    ),
)
"""Singles; asymmetric friction is missing because it always has an equal."""
