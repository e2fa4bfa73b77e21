"""A mass on a spring in the hidden laboratory, for tests with closed forms."""

from __future__ import annotations

import numpy as np

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.prescribed_motion import Motion, at_rest
from sealed_trial.laboratory.system import SimulatedRun, System, simulate

MASS_KG, STIFFNESS_N_PER_M = 2.0, 3200.0
OMEGA = 40.0  # √(3200/2) rad/s
RATE_HZ = 512.0


def oscillator(damping: float = 0.0, **parameters: float) -> System:
    """m = 2 kg, k = 3200 N/m, and parameters of the kernel by their names."""
    values = np.zeros(at.N_PARAMETERS)
    for place in (at.HYSTERESIS_YIELD, at.FRICTION_STRIBECK, at.SLOSHING_THRESHOLD, at.EFFECTIVE_MASS_FADE):
        values[place] = 1.0
    values[at.CARRIED_MASS], values[at.LIQUID_MASS] = MASS_KG, 0.2
    unity = np.ones((1, 1))
    plain = System(
        MASS_KG * unity, damping * unity, STIFFNESS_N_PER_M * unity, np.array([MASS_KG]), np.ones(1), values
    )
    return plain.with_parameters({getattr(at, name): value for name, value in parameters.items()})


def released(system: System, deflection_m: float, duration_s: float) -> tuple[np.ndarray, SimulatedRun]:
    """Time and run of a release from rest."""
    run = simulate(system, at_rest(duration_s), duration_s, RATE_HZ, deflection_m=deflection_m)
    return np.arange(run.seen.shape[0]) / RATE_HZ, run


def driven(system: System, motion: Motion, duration_s: float) -> tuple[np.ndarray, SimulatedRun]:
    """Time and run on a moving base."""
    run = simulate(system, motion, duration_s, RATE_HZ)
    return np.arange(run.seen.shape[0]) / RATE_HZ, run


def peaks(run: SimulatedRun) -> np.ndarray:
    """Positive peaks of the displacement, by a parabola through three samples."""
    x = run.seen[:, at.O_DISPLACEMENT]
    inner = np.flatnonzero((x[1:-1] > x[:-2]) & (x[1:-1] >= x[2:])) + 1
    left, middle, right = x[inner - 1], x[inner], x[inner + 1]
    return middle + (right - left) ** 2 / (8 * (2 * middle - left - right))
