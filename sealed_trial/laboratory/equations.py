"""Equations of motion of the hidden laboratory, compiled.

With coordinates q relative to the base, ψ their shapes at the tank, M, C, K their matrices with the liquid frozen:

    (M + μ ψψᵀ) q̈ = −C q̇ − K q − (Γ + μ ψ) a_b + ψ (F_structure + Δf + F_friction)

μ collects what is moved beyond the known masses, less the part of the liquid that moves by itself. Without
coordinates the tank follows the table of the base.
"""

from __future__ import annotations

import math

from numba import njit

from sealed_trial.laboratory import kernel_layout as at


@njit(cache=True)
def base_motion(t, step, table, out):  # type: ignore[no-untyped-def]
    """Fifth-order Hermite interpolation of (u, v, a), linear of the modulation, into `out`."""
    k = min(int(t / step), table.shape[0] - 2)
    s = t / step - k
    u0, v0, a0 = table[k, 0], table[k, 1] * step, table[k, 2] * step * step
    u1, v1, a1 = table[k + 1, 0], table[k + 1, 1] * step, table[k + 1, 2] * step * step
    c3 = 10 * (u1 - u0) - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * (u1 - u0) + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * (u1 - u0) - 3 * (v0 + v1) - 0.5 * (a0 - a1)
    out[0] = u0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    out[1] = (v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / step
    out[2] = (a0 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / (step * step)
    out[3] = table[k, 3] + s * (table[k + 1, 3] - table[k, 3])


@njit(cache=True)
def amplitude_g(state):  # type: ignore[no-untyped-def]
    """Amplitude of the tank's acceleration over g, from the running mean square."""
    return math.sqrt(2.0 * max(state[at.S_MEAN_SQUARE_A], 0.0)) / at.GRAVITY


@njit(cache=True)
def elastic_force(t, x, p):  # type: ignore[no-untyped-def]
    """Conservative and prescribed forces of the structure at the displacement x [N]."""
    force = -x * (p[at.STIFFNESS_CHANGE] + x * (p[at.STIFFNESS_QUADRATIC] + x * p[at.STIFFNESS_CUBIC]))
    if p[at.STIFFNESS_MODULATION] != 0.0:
        force -= p[at.STIFFNESS_MODULATION] * math.cos(p[at.STIFFNESS_MODULATION_RATE] * t) * x
    if p[at.STIFFNESS_STEP] != 0.0 and t > p[at.STIFFNESS_STEP_TIME]:
        force -= p[at.STIFFNESS_STEP] * x
    return force + p[at.CONSTANT]


@njit(cache=True)
def outside_force(t, p):  # type: ignore[no-untyped-def]
    """Of a machine that runs by itself, and of blows F sin²(π s/w) that repeat [N]."""
    force = 0.0
    if p[at.TONE_FORCE] != 0.0:
        force += p[at.TONE_FORCE] * math.sin(p[at.TONE_RATE] * t + p[at.TONE_PHASE])
    if p[at.PULSE_FORCE] != 0.0 and t >= p[at.PULSE_START]:
        n = math.floor((t - p[at.PULSE_START]) / p[at.PULSE_PERIOD])
        s = t - p[at.PULSE_START] - n * p[at.PULSE_PERIOD]
        if s < p[at.PULSE_WIDTH]:
            blow = p[at.PULSE_FORCE] * math.sin(math.pi * s / p[at.PULSE_WIDTH]) ** 2
            force += -blow if p[at.PULSE_ALTERNATES] != 0.0 and n % 2 == 1 else blow
    return force


@njit(cache=True)
def slider_pull(x, slider, p):  # type: ignore[no-untyped-def]
    """Force of the spring with play that drags the slider, positive upward on the slider [N]."""
    stretch = x - slider
    half = 0.5 * p[at.SLIDER_PLAY]
    if stretch > half:
        return p[at.SLIDER_STIFFNESS] * (stretch - half)
    if stretch < -half:
        return p[at.SLIDER_STIFFNESS] * (stretch + half)
    return 0.0


@njit(cache=True)
def structure_force(t, place, state, p, conditions):  # type: ignore[no-untyped-def]
    """All of the structure at the place of the tank, x and v there, but dry friction [N]."""
    x, v = place
    force = elastic_force(t, x, p)
    force -= v * (p[at.STRUCTURE_VISCOUS] + p[at.STRUCTURE_DRAG] * abs(v) + p[at.DAMPING_OF_DISPLACEMENT] * x * x)
    force -= state[at.S_HYSTERESIS]
    if p[at.SLIDER_STIFFNESS] != 0.0:
        force -= slider_pull(x, state[at.S_SLIDER], p)
    side = conditions[at.D_CLEARANCE]
    if side != 0:
        force -= p[at.CLEARANCE_STIFFNESS] * (x - side * p[at.CLEARANCE_GAP]) + p[at.CLEARANCE_DAMPING] * v
    if p[at.RELAXATION_GAIN] != 0.0:
        total = 0.0
        for j in range(at.N_RELAXATION):
            total += state[at.S_RELAXATION + j]
        force -= p[at.RELAXATION_GAIN] * total
    if p[at.APPENDAGE_MASS] != 0.0:
        rate = p[at.APPENDAGE_RATE]
        pull = (
            rate * rate * state[at.S_APPENDAGE] + 2 * p[at.APPENDAGE_DAMPING] * rate * state[at.S_APPENDAGE_RATE]
        )
        force += p[at.APPENDAGE_MASS] * pull
    return force


@njit(cache=True)
def slug_force(state, p):  # type: ignore[no-untyped-def]
    """Force of the liquid on its gas spring on the tank [N]."""
    s = state[at.S_SLUG]
    room = max(1.0 - p[at.SLUG_HARDENING] * s, 1e-3)
    return p[at.SLUG_STIFFNESS] * s / room + p[at.SLUG_DAMPING] * state[at.S_SLUG_RATE]


@njit(cache=True)
def loose_force(state, p, conditions):  # type: ignore[no-untyped-def]
    """Force of the flying part of the liquid on the tank: negative on the floor, positive at the ceiling [N]."""
    z, speed = state[at.S_LOOSE], state[at.S_LOOSE_RATE]
    if conditions[at.D_LOOSE] < 0:
        return min(p[at.LOOSE_STIFFNESS] * z + p[at.LOOSE_DAMPING] * speed, 0.0)
    if conditions[at.D_LOOSE] > 0:
        return max(p[at.LOOSE_STIFFNESS] * (z - p[at.LOOSE_GAP]) + p[at.LOOSE_DAMPING] * speed, 0.0)
    return 0.0


@njit(cache=True)
def liquid_damping(state, p, modulation):  # type: ignore[no-untyped-def]
    """Coefficient c of −c u̇ [N s/m]: constant, building up, saturating, or setting in above a threshold."""
    level = amplitude_g(state)
    damping = p[at.TANK_VISCOUS]
    if p[at.BUILD_UP_TIME] > 0.0:
        damping *= 1.0 - math.exp(-state[at.S_VIOLENCE] / p[at.BUILD_UP_TIME])
    if p[at.SATURATION] > 0.0 and level > p[at.SATURATION]:
        damping *= (p[at.SATURATION] / level) ** 2
    if p[at.SLOSHING_PEAK] != 0.0 and level > p[at.SLOSHING_THRESHOLD]:
        beyond = (level - p[at.SLOSHING_THRESHOLD]) / p[at.SLOSHING_THRESHOLD]
        rate = math.sqrt(state[at.S_MEAN_SQUARE_A] / max(state[at.S_MEAN_SQUARE_V], 1e-12))
        w_bar = p[at.SLOSHING_PEAK] * 2.0 * beyond / (1.0 + beyond * beyond)
        damping += p[at.LIQUID_MASS] * rate * w_bar / math.pi
    return damping * (1.0 + modulation)


@njit(cache=True)
def tank_force(velocity, state, p, conditions, modulation):  # type: ignore[no-untyped-def]
    """Δf less what is inertia of the tank's own acceleration [N]."""
    force = -velocity * (liquid_damping(state, p, modulation) + p[at.TANK_DRAG] * abs(velocity))
    if velocity < 0.0:
        force -= p[at.TANK_ONE_SIDED] * velocity
    if p[at.WAVE_MASS] != 0.0:
        force += p[at.WAVE_MASS] * p[at.WAVE_RATE] ** 2 * state[at.S_WAVE]
    if p[at.SLUG_MASS] != 0.0:
        force += slug_force(state, p)
    if p[at.LOOSE_MASS] != 0.0:
        force += loose_force(state, p, conditions) + p[at.LOOSE_MASS] * at.GRAVITY
    return force


@njit(cache=True)
def tank_extra_mass(t, state, p):  # type: ignore[no-untyped-def]
    """What moves with the tank beyond M_dry + m_l [kg]; negative where liquid moves by itself or is lost."""
    extra = p[at.TANK_MASS] - p[at.SLUG_MASS] - p[at.LOOSE_MASS] - p[at.LOSS_RATE] * t
    if p[at.EFFECTIVE_MASS] != 0.0:
        faded = 1.0 + (amplitude_g(state) / p[at.EFFECTIVE_MASS_FADE]) ** 2
        extra += p[at.EFFECTIVE_MASS] * p[at.LIQUID_MASS] / faded
    return extra


@njit(cache=True)
def friction_limit(direction, v, p):  # type: ignore[no-untyped-def]
    """What friction can hold or pulls against motion in `direction` [N]."""
    limit = p[at.FRICTION_UP] if direction > 0 else p[at.FRICTION_DOWN]
    if p[at.FRICTION_STATIC_EXTRA] != 0.0:
        limit += p[at.FRICTION_STATIC_EXTRA] * math.exp(-((v / p[at.FRICTION_STRIBECK]) ** 2))
    return limit


@njit(cache=True)
def state_rates(rates, state, motion, p, conditions):  # type: ignore[no-untyped-def]
    """Rates of the states but those of the relaxing springs, which are set to zero.

    `motion` is the relative velocity v, and velocity and acceleration of the tank.
    """
    v, tank_velocity, tank_acceleration = motion
    for j in range(at.N_STATES):
        rates[j] = 0.0
    if p[at.HYSTERESIS_STIFFNESS] != 0.0:
        z = state[at.S_HYSTERESIS]
        share = 1.0
        if v * z > 0.0:
            share -= (abs(z) / p[at.HYSTERESIS_YIELD]) ** p[at.HYSTERESIS_EXPONENT]
        rates[at.S_HYSTERESIS] = p[at.HYSTERESIS_STIFFNESS] * v * share
    if conditions[at.D_SLIDER] != 0:
        rates[at.S_SLIDER] = v
    rates[at.S_MEAN_SQUARE_A] = (tank_acceleration**2 - state[at.S_MEAN_SQUARE_A]) / at.AVERAGING_TIME
    rates[at.S_MEAN_SQUARE_V] = (tank_velocity**2 - state[at.S_MEAN_SQUARE_V]) / at.AVERAGING_TIME
    if p[at.BUILD_UP_TIME] > 0.0:
        rates[at.S_VIOLENCE] = 0.5 * (1.0 + math.tanh((amplitude_g(state) - p[at.BUILD_UP_START]) / 0.05))
    if p[at.WAVE_MASS] != 0.0:
        rate, wave = p[at.WAVE_RATE], state[at.S_WAVE]
        spring = 1.0 + p[at.WAVE_COUPLING] * tank_acceleration / at.GRAVITY + p[at.WAVE_HARDENING] * wave * wave
        rates[at.S_WAVE] = state[at.S_WAVE_RATE]
        rates[at.S_WAVE_RATE] = -rate * (2 * p[at.WAVE_DAMPING] * state[at.S_WAVE_RATE] + rate * spring * wave)
    if p[at.SLUG_MASS] != 0.0:
        rates[at.S_SLUG] = state[at.S_SLUG_RATE]
        rates[at.S_SLUG_RATE] = -slug_force(state, p) / p[at.SLUG_MASS] - tank_acceleration
    if p[at.LOOSE_MASS] != 0.0:
        rates[at.S_LOOSE] = state[at.S_LOOSE_RATE]
        push = loose_force(state, p, conditions) / p[at.LOOSE_MASS]
        rates[at.S_LOOSE_RATE] = -at.GRAVITY - push - tank_acceleration
    if p[at.APPENDAGE_MASS] != 0.0:
        rate = p[at.APPENDAGE_RATE]
        pull = rate * (rate * state[at.S_APPENDAGE] + 2 * p[at.APPENDAGE_DAMPING] * state[at.S_APPENDAGE_RATE])
        rates[at.S_APPENDAGE] = state[at.S_APPENDAGE_RATE]
        rates[at.S_APPENDAGE_RATE] = -pull - tank_acceleration


@njit(cache=True)
def relaxation_rates(rates, state, v, bank):  # type: ignore[no-untyped-def]
    """Rates of the relaxing springs; `bank` is rate and weight of every one."""
    for j in range(at.N_RELAXATION):
        rates[at.S_RELAXATION + j] = bank[j, 1] * v - bank[j, 0] * state[at.S_RELAXATION + j]
