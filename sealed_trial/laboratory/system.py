"""A structure with a tank as matrices, and one run of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.compiled_system import CompiledSystem
from sealed_trial.laboratory.integrator import integrated
from sealed_trial.laboratory.prescribed_motion import Motion

FloatArray = npt.NDArray[np.float64]

SLOWEST_RELAXATION_PER_S: Final = 0.5
FASTEST_RELAXATION_PER_S: Final = 5000.0


@dataclass(frozen=True, eq=False)
class System:
    """Matrices of the coordinates relative to the base, and the kernel's parameters.

    Attributes
    ----------
    mass, damping, stiffness : ndarray, shape (n, n)
        With the liquid frozen; n = 0 is a tank that follows the shaker.
    base_kg, shape : ndarray, shape (n,)
        Γ, and ψ at the tank.
    parameters : ndarray, shape (N_PARAMETERS,)
    relaxation_exponent : float
        How the weights of the relaxing springs grow with their rate: 0 gives a loss that no frequency changes.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    base_kg: FloatArray
    shape: FloatArray
    parameters: FloatArray
    relaxation_exponent: float = 0.0

    def compiled(self, motion: Motion) -> CompiledSystem:
        """What the kernel takes, with the contacts of a rig at rest."""
        inverse = np.linalg.inv(self.mass) if self.shape.size else np.zeros((0, 0))
        return CompiledSystem(
            np.ascontiguousarray(inverse),
            self.damping,
            self.stiffness,
            self.base_kg,
            self.shape,
            self.parameters,
            relaxing_springs(self.relaxation_exponent),
            motion.step_s,
            motion.table,
            initial_conditions(self),
        )

    def with_parameters(self, changes: dict[int, float]) -> System:
        """The same system with some of the kernel's parameters set."""
        parameters = self.parameters.copy()
        for place, value in changes.items():
            parameters[place] = value
        return replace(self, parameters=parameters)


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """What happens in one run, at the samples.

    Attributes
    ----------
    start : ndarray, shape (N_OUTPUTS,)
        What is seen at the start, which need not be a sample.
    seen : ndarray, shape (n_samples, N_OUTPUTS)
    events : ndarray, shape (n_events, 3)
    final : ndarray
        All coordinates, velocities and states at the end.
    """

    start: FloatArray
    seen: FloatArray
    events: FloatArray
    final: FloatArray


def relaxing_springs(exponent: float) -> FloatArray:
    """Rates and weights of springs in series with dampers, evenly spaced on a logarithmic axis.

    With equal weights w and spacing d of ln r the sum of the loss moduli w ω r/(ω² + r²) is w π/(2 d) at any ω
    well inside the band; the weights here make it 1. With weights ∝ r^p it grows as ω^p.
    """
    rates = np.geomspace(SLOWEST_RELAXATION_PER_S, FASTEST_RELAXATION_PER_S, at.N_RELAXATION)
    spacing = math.log(rates[1] / rates[0])
    weights = 2 * spacing / math.pi * math.cos(math.pi * exponent / 2) * rates**exponent
    return np.stack([rates, weights], axis=1)


def storage_of_springs(exponent: float, rate_rad_per_s: float) -> float:
    """Stiffness that the relaxing springs add at a frequency, per unit of gain."""
    springs = relaxing_springs(exponent)
    return float(np.sum(springs[:, 1] * rate_rad_per_s**2 / (rate_rad_per_s**2 + springs[:, 0] ** 2)))


def initial_state(system: System, deflection_m: float) -> FloatArray:
    """At rest, deflected by a static force at the tank."""
    n = system.shape.size
    state = np.zeros(2 * n + at.N_STATES)
    if n and deflection_m:
        pattern = np.linalg.solve(system.stiffness, system.shape)
        state[:n] = pattern * deflection_m / float(system.shape @ pattern)
    p = system.parameters
    # let go into a deflection the slider has followed, it is not pulled
    if p[at.SLIDER_STIFFNESS]:
        state[2 * n + at.S_SLIDER] = deflection_m
    if p[at.LOOSE_MASS]:
        state[2 * n + at.S_LOOSE] = -p[at.LOOSE_MASS] * at.GRAVITY / p[at.LOOSE_STIFFNESS]
    if p[at.WAVE_MASS]:
        state[2 * n + at.S_WAVE] = 3e-5
    return state


def initial_conditions(system: System) -> npt.NDArray[np.int64]:
    """Contact conditions of a rig at rest; what a release leaves at once the integration finds."""
    conditions = np.zeros(at.N_CONDITIONS, dtype=np.int64)
    if system.parameters[at.LOOSE_MASS]:
        conditions[at.D_LOOSE] = -1
    return conditions


def simulate(
    system: System,
    motion: Motion,
    duration_s: float,
    sampling_rate_hz: float,
    *,
    deflection_m: float = 0.0,
    first_s: float = 0.0,
    relative_tolerance: float = 1e-9,
) -> SimulatedRun:
    """One run from rest, at samples from an instant on that is less than a sample after its start.

    Raises
    ------
    ArithmeticError
        If the motion diverges.
    """
    n_samples = round(duration_s * sampling_rate_hz) + 1
    compiled, state = system.compiled(motion), initial_state(system, deflection_m)
    start = None
    if first_s > 0.0:
        # the clock of what follows begins there; nothing but instants of a hidden change could tell
        start, state, _ = integrated(state, 2, first_s, compiled, relative_tolerance=relative_tolerance)
    seen, final, events = integrated(
        state,
        n_samples,
        1.0 / sampling_rate_hz,
        compiled,
        relative_tolerance=relative_tolerance,
    )
    return SimulatedRun((seen if start is None else start)[0], seen, events, final)
