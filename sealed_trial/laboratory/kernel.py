"""The rates of all coordinates and states, and what switches contact and friction, compiled.

A system is handed over as a `CompiledSystem`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.equations import (
    base_motion,
    friction_limit,
    outside_force,
    relaxation_rates,
    slider_pull,
    state_rates,
    structure_force,
    tank_extra_mass,
    tank_force,
)

STANDSTILL = 1e-10
"""Velocity that counts as none [m/s]."""
EQUAL_FORCES = 1e-9
"""Share of its friction by which a slider that rests may be pulled more than it holds: it came to rest there."""


@njit(cache=True)
def _friction_of_driven(sliding, p):  # type: ignore[no-untyped-def]
    """Friction on a tank whose motion is given."""
    if sliding == 0.0:
        return 0.0
    direction = 1 if sliding > 0 else -1
    return -direction * friction_limit(direction, sliding, p)


@njit(cache=True)
def _coordinate_rates(y, rates, at_tank, forces, moved, system):  # type: ignore[no-untyped-def]
    """Rates of the coordinates; `at_tank` is relative velocity, sliding velocity and the acceleration of the base.

    Returns friction, the force that would hold the slider, the acceleration of the tank and the power lost.
    """
    inverse_mass, damping, stiffness, gamma, psi, p, _, _, _, conditions = system
    n = psi.size
    (v, sliding, base_acceleration), (on_structure, on_tank) = at_tank, forces
    slides_at_tank = p[at.FRICTION_AT_TANK]
    direct, accelerations, answer = np.empty(n), np.empty(n), np.empty(n)
    freely = mobility = friction = 0.0
    place = on_structure + on_tank - moved * base_acceleration
    for j in range(n):
        total = -gamma[j] * base_acceleration + psi[j] * place
        for k in range(n):
            total -= damping[j, k] * y[n + k] + stiffness[j, k] * y[k]
        direct[j] = total
    for j in range(n):
        accelerations[j] = answer[j] = 0.0
        for k in range(n):
            accelerations[j] += inverse_mass[j, k] * direct[k]
            answer[j] += inverse_mass[j, k] * psi[k]
        freely += psi[j] * accelerations[j]
        mobility += psi[j] * answer[j]
    heavier = 1.0 + moved * mobility
    hold = (-slides_at_tank * base_acceleration * heavier - freely) / mobility
    side = conditions[at.D_FRICTION]
    if p[at.FRICTION_UP] != 0.0 or p[at.FRICTION_DOWN] != 0.0:
        friction = hold if side == 0 else -side * friction_limit(side, sliding, p)
    correction = friction - moved * (freely + friction * mobility) / heavier
    tank_acceleration = base_acceleration + freely + correction * mobility
    loss = 0.0
    for j in range(n):
        rates[j] = y[n + j]
        rates[n + j] = accelerations[j] + correction * answer[j]
        for k in range(n):
            loss += y[n + j] * damping[j, k] * y[n + k]
    place_acceleration = tank_acceleration - base_acceleration
    loss -= v * (on_structure + on_tank + friction - moved * (place_acceleration + base_acceleration))
    return friction, hold, tank_acceleration, loss


@njit(cache=True)
def evaluate(t, y, rates, seen, system):  # type: ignore[no-untyped-def]
    """Rates dy/dt and what is seen (outputs, then hold force, upper and lower limit, sliding velocity)."""
    psi, p, conditions, n = system.psi, system.p, system.conditions, system.psi.size
    state = y[2 * n :]
    base = np.empty(4)
    base_motion(t, system.step, system.table, base)
    x = v = 0.0
    for j in range(n):
        x += psi[j] * y[j]
        v += psi[j] * y[n + j]
    velocity = base[1] + v
    slides_at_tank = p[at.FRICTION_AT_TANK]
    extra = tank_extra_mass(t, state, p)
    on_structure = structure_force(t, (x, v), state, p, conditions)
    on_tank = tank_force(velocity, state, p, conditions, base[3])
    outside = outside_force(t, p)
    if p[at.OUTSIDE_AT_TANK] != 0.0:
        on_tank += outside
    else:
        on_structure += outside
    sliding = v + slides_at_tank * base[1]
    if n == 0:
        friction, hold, acceleration, loss = _friction_of_driven(sliding, p), 0.0, base[2], 0.0
    else:
        friction, hold, acceleration, loss = _coordinate_rates(
            y, rates, (v, sliding, base[2]), (on_structure, on_tank), extra + p[at.STRUCTURE_MASS], system
        )
    state_rates(rates[2 * n :], state, (v, velocity, acceleration), p, conditions)
    if p[at.RELAXATION_GAIN] != 0.0:
        relaxation_rates(rates[2 * n :], state, v, system.bank)
    if n > 0:
        rates[2 * n + at.S_DISSIPATED] = loss
    seen[at.O_DISPLACEMENT] = base[0] + x
    seen[at.O_ACCELERATION] = acceleration
    seen[at.O_LIQUID_FORCE] = on_tank - extra * acceleration + slides_at_tank * friction
    seen[at.O_INTERFACE_FORCE] = p[at.CARRIED_MASS] * acceleration - seen[at.O_LIQUID_FORCE]
    seen[at.O_RELATIVE_DISPLACEMENT] = x
    seen[at.O_RELATIVE_VELOCITY] = v
    seen[at.N_OUTPUTS] = hold
    seen[at.N_OUTPUTS + 1] = friction_limit(1, 0.0, p)
    seen[at.N_OUTPUTS + 2] = friction_limit(-1, 0.0, p)
    seen[at.N_OUTPUTS + 3] = sliding


@njit(cache=True)
def margins(y, seen, conditions, p, out):  # type: ignore[no-untyped-def]
    """How far each condition is from being left; negative where it has been."""
    n = (y.size - at.N_STATES) // 2
    out[:] = 1.0
    if n > 0 and (p[at.FRICTION_UP] != 0.0 or p[at.FRICTION_DOWN] != 0.0):
        side = conditions[at.D_FRICTION]
        if side == 0:
            hold = seen[at.N_OUTPUTS]
            out[at.D_FRICTION] = min(hold + seen[at.N_OUTPUTS + 1], seen[at.N_OUTPUTS + 2] - hold)
        else:
            out[at.D_FRICTION] = side * seen[at.N_OUTPUTS + 3] + STANDSTILL
    if p[at.CLEARANCE_STIFFNESS] != 0.0:
        x, gap, side = seen[at.O_RELATIVE_DISPLACEMENT], p[at.CLEARANCE_GAP], conditions[at.D_CLEARANCE]
        out[at.D_CLEARANCE] = gap - abs(x) if side == 0 else side * x - gap
    if p[at.SLIDER_STIFFNESS] != 0.0:
        pull = slider_pull(seen[at.O_RELATIVE_DISPLACEMENT], y[2 * n + at.S_SLIDER], p)
        side = conditions[at.D_SLIDER]
        if side == 0:
            spare = EQUAL_FORCES * (p[at.SLIDER_UP] + p[at.SLIDER_DOWN])
            out[at.D_SLIDER] = min(p[at.SLIDER_UP] - pull, p[at.SLIDER_DOWN] + pull) + spare
        else:
            out[at.D_SLIDER] = side * seen[at.O_RELATIVE_VELOCITY] + STANDSTILL
    if p[at.LOOSE_MASS] != 0.0:
        z, side = y[2 * n + at.S_LOOSE], conditions[at.D_LOOSE]
        if side == 0:
            out[at.D_LOOSE] = min(z, p[at.LOOSE_GAP] - z)
        else:
            out[at.D_LOOSE] = -z if side < 0 else z - p[at.LOOSE_GAP]


@njit(cache=True)
def switch(which, y, seen, conditions, p):  # type: ignore[no-untyped-def]
    """Take the condition `which` to the one beyond its margin."""
    n = (y.size - at.N_STATES) // 2
    if which == at.D_FRICTION:
        hold, up, down = seen[at.N_OUTPUTS], seen[at.N_OUTPUTS + 1], seen[at.N_OUTPUTS + 2]
        if hold < -up:
            conditions[which] = 1
        elif hold > down:
            conditions[which] = -1
        else:
            conditions[which] = 0
    elif which == at.D_CLEARANCE:
        if conditions[which] != 0:
            conditions[which] = 0
        else:
            conditions[which] = 1 if seen[at.O_RELATIVE_DISPLACEMENT] > 0 else -1
    elif conditions[which] != 0:
        conditions[which] = 0
    elif which == at.D_SLIDER:
        conditions[which] = 1 if seen[at.O_RELATIVE_DISPLACEMENT] > y[2 * n + at.S_SLIDER] else -1
    else:
        conditions[which] = -1 if y[2 * n + at.S_LOOSE] < 0.5 * p[at.LOOSE_GAP] else 1
