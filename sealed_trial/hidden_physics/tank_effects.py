"""Effects of the tank and its liquid."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from sealed_trial.hidden_physics.effect import Change, DrawnEffect, HiddenEffect, Scales
from sealed_trial.hidden_physics.outside_forces import outside_force
from sealed_trial.laboratory import kernel_layout as at

_ALL = ("sdof", "beam", "shaker")


def _effect(name: str, change: Callable[[float], Change], least: float = 1e-4, most: float = 1e3) -> DrawnEffect:
    return DrawnEffect(name, "tank", change, least=least, most=most)


def _damping(scales: Scales) -> float:
    """c of a liquid with W̄ = 0.6 [N s/m]."""
    return scales.liquid_mass_kg * scales.rate_rad_per_s * 0.6 / math.pi


def viscous(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A liquid that damps, believed to be frozen."""
    unit = _damping(scales)
    return _effect(
        "viscous_damping", lambda m: Change({"damping_n_s_per_m": m * unit}, {at.TANK_VISCOUS: m * unit}), most=5.0
    )


def coulomb(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Dry friction between tank and laboratory."""
    unit = 0.02 * scales.liquid_mass_kg * scales.acceleration_g * at.GRAVITY

    def change(m: float) -> Change:
        kernel = {at.FRICTION_UP: m * unit, at.FRICTION_DOWN: m * unit, at.FRICTION_AT_TANK: 1.0}
        return Change({"force_n": m * unit}, kernel)

    return _effect("coulomb_friction", change)


def drag(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Drag of the tank in the laboratory's air or of the liquid."""
    unit = 0.5 * _damping(scales) / scales.velocity_m_per_s
    return _effect("quadratic_drag", lambda m: Change({"drag_n_s2_per_m2": m * unit}, {at.TANK_DRAG: m * unit}))


def sloshing(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Dissipation that sets in above a threshold, peaks, and falls again."""
    threshold = scales.acceleration_g * generator.uniform(0.15, 0.35)

    def change(m: float) -> Change:
        true = {"threshold_g": threshold, "peak_w_bar": m}
        kernel = {at.SLOSHING_THRESHOLD: threshold, at.SLOSHING_PEAK: m}
        return Change(true, kernel)

    return _effect("liquid_sloshing", change, most=3.0)


def effective_mass(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Part of the liquid that does not follow; less of it in violent motion."""
    fade = scales.acceleration_g * generator.uniform(0.25, 0.5)

    def change(m: float) -> Change:
        return Change({"beta": -0.15 * m}, {at.EFFECTIVE_MASS: -0.15 * m, at.EFFECTIVE_MASS_FADE: fade})

    return _effect("effective_mass", change, most=6.0)


def ceiling(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Part of the liquid flies and meets ceiling and floor."""
    gap = scales.room_m * generator.uniform(0.4, 1.0)
    rate, ratio = 2 * math.pi * generator.uniform(45.0, 80.0), generator.uniform(0.15, 0.4)

    def change(m: float) -> Change:
        mass = 0.15 * m * scales.liquid_mass_kg
        stiffness, damping = mass * rate**2, 2 * ratio * mass * rate
        true = {"gap_m": gap, "stiffness_n_per_m": stiffness, "damping_n_s_per_m": damping}
        kernel = {at.LOOSE_MASS: mass, at.LOOSE_GAP: gap, at.LOOSE_STIFFNESS: stiffness, at.LOOSE_DAMPING: damping}
        return Change(true, kernel)

    return _effect("ceiling_impact", change, 0.01, 6.0)


def build_up(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """The liquid's damping needs some cycles of violent motion."""
    start = scales.acceleration_g * generator.uniform(0.1, 0.2)

    def change(m: float) -> Change:
        return Change({"time_constant_s": 0.4 * m}, {at.BUILD_UP_TIME: 0.4 * m, at.BUILD_UP_START: start})

    return _effect("breakup_delay", change, 0.02, 8.0)


def saturation(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """The liquid's work stops growing beyond an acceleration."""

    def change(m: float) -> Change:
        threshold = scales.acceleration_g / (1 + 0.6 * m)
        return Change({"threshold_g": threshold}, {at.SATURATION: threshold})

    return _effect("high_g_saturation", change, 0.02, 8.0)


def faraday(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A wave at half the frequency of the motion, above a threshold."""
    rate = 0.5 * scales.rate_rad_per_s * (1 + 0.01 * generator.uniform(-1, 1))
    ratio, height = 0.01, 0.012
    coupling = 4 * ratio / (scales.acceleration_g * generator.uniform(0.15, 0.3))

    def change(m: float) -> Change:
        return Change(
            {"frequency_hz": rate / (2 * math.pi), "growth": coupling},
            {
                at.WAVE_MASS: 0.2 * m * scales.liquid_mass_kg,
                at.WAVE_RATE: rate,
                at.WAVE_DAMPING: ratio,
                at.WAVE_COUPLING: coupling,
                at.WAVE_HARDENING: 0.67 * coupling * scales.acceleration_g / height**2,
            },
        )

    return _effect("faraday_wave", change, most=100.0)


def lateral(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """A lateral mode of the liquid that the rocking tip drives and that answers through it."""
    rate, ratio = scales.rate_rad_per_s * generator.uniform(0.55, 0.85), generator.uniform(0.005, 0.015)

    def change(m: float) -> Change:
        mass = 0.1 * m * scales.liquid_mass_kg
        return Change(
            {"frequency_hz": rate / (2 * math.pi), "mass_kg": mass},
            {at.SLUG_MASS: mass, at.SLUG_STIFFNESS: mass * rate**2, at.SLUG_DAMPING: 2 * ratio * mass * rate},
        )

    return _effect("lateral_mode", change, most=9.0)


def air(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Part of the liquid rests on trapped gas that hardens when it is compressed."""
    rate, ratio = scales.rate_rad_per_s * generator.uniform(2.2, 3.5), generator.uniform(0.02, 0.06)
    travel = scales.acceleration_g * at.GRAVITY / rate**2

    def change(m: float) -> Change:
        mass = 0.2 * m * scales.liquid_mass_kg
        return Change(
            {"stiffness_n_per_m": mass * rate**2},
            {
                at.SLUG_MASS: mass,
                at.SLUG_STIFFNESS: mass * rate**2,
                at.SLUG_DAMPING: 2 * ratio * mass * rate,
                at.SLUG_HARDENING: 0.25 / travel,
            },
        )

    return _effect("air_cushion", change, most=4.5)


def loss(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """The tank leaks."""
    unit = 0.02 * scales.liquid_mass_kg
    return _effect(
        "liquid_loss", lambda m: Change({"rate_kg_per_s": m * unit}, {at.LOSS_RATE: m * unit}), most=4.5
    )


def mass(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """More or less mass in the tank than weighed."""
    unit = 0.08 * (1 if generator.random() < 0.5 else -1) * scales.mass_kg
    return _effect("mass_error", lambda m: Change({"mass_kg": m * unit}, {at.TANK_MASS: m * unit}), 0.1, 3.0)


def outside(scales: Scales, generator: np.random.Generator) -> DrawnEffect:
    """Blows, or another machine, at a tank on a shaker, which itself goes on as it does."""
    unit = 0.02 * scales.liquid_mass_kg * scales.acceleration_g * at.GRAVITY
    return outside_force("tank", unit, scales, generator)


TANK_EFFECTS: Final = (
    HiddenEffect("viscous_damping", "tank", viscous, _ALL, needs_frequencies=True, tank_model="frozen"),
    HiddenEffect("coulomb_friction", "tank", coulomb, ("shaker",), needs_levels=True, is_friction=True),
    HiddenEffect("quadratic_drag", "tank", drag, _ALL, needs_levels=True),
    HiddenEffect("liquid_sloshing", "tank", sloshing, _ALL, needs_levels=True, tank_model="frozen"),
    HiddenEffect("effective_mass", "tank", effective_mass, _ALL, needs_levels=True),
    HiddenEffect("ceiling_impact", "tank", ceiling, _ALL, needs_levels=True),
    HiddenEffect("breakup_delay", "tank", build_up, _ALL, needs_levels=True, tank_model="viscous"),
    HiddenEffect("high_g_saturation", "tank", saturation, _ALL, needs_levels=True, tank_model="viscous"),
    HiddenEffect("faraday_wave", "tank", faraday, _ALL),
    HiddenEffect("lateral_mode", "tank", lateral, ("beam",), needs_frequencies=True),
    HiddenEffect("air_cushion", "tank", air, ("sdof", "shaker"), needs_frequencies=True),
    HiddenEffect("liquid_loss", "tank", loss, _ALL),
    HiddenEffect("external_force", "tank", outside, ("shaker",)),
)
"""Singles; a tank's mass is missing because an effective mass equals it."""
