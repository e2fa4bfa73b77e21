"""One leapfrog step of a structure, compiled: the same step as that of the liquid.

    q½ = q + ½Δt p      M (p′ − p)/Δt = −K q½ − C (p + p′)/2 + ψ (f + F) − Γ a_s      q′ = q½ + ½Δt p′

Viscous damping is the implicit mid-point rule, which is stable however strong it is. Friction F is the
force, F_c at most, that brings the tank to rest at the end of the step: what is at rest stays there.

Each force times the mean velocity of the step is its work; with these works the energy
½ p·Mp + ½ q·Kq − ⅛ Δt² p·Kp changes by exactly what they say. Its last term, of second order in the step,
belongs to the leapfrog's momentary potential energy.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acquisition.numerical_tank.structures import Structure

FloatArray = NDArray[np.float64]

TERMS = 5
LIQUID_WORK, BASE_WORK, VISCOSITY, FRICTION, HANDED_OVER = range(TERMS)
"""Entries of the energies [J]: given by the liquid and by the base; taken by damping and by friction; the
work of the liquid as the liquid felt it."""


class System(NamedTuple):
    """A structure as the compiled loop takes it; n modes.

    Attributes
    ----------
    step : float
        Δt [s].
    stiffness, shape, participation : ndarray, shape (n,)
        K, ψ, Γ.
    damping : ndarray, shape (n, n)
        C + b ψψᵀ.
    keep, give : ndarray, shape (n, n)
        p′ = keep p + give (forces), with A = M + ½Δt C: A⁻¹ (M − ½Δt C) and Δt A⁻¹.
    reaction : ndarray, shape (n,)
        give ψ.
    mobility : float
        ψ·give ψ: change of the tank's velocity for a force of one during a step [m/(N s)].
    coulomb : float
        F_c [N].
    """

    step: float
    stiffness: FloatArray
    shape: FloatArray
    participation: FloatArray
    damping: FloatArray
    keep: FloatArray
    give: FloatArray
    reaction: FloatArray
    mobility: float
    coulomb: float


class Motion(NamedTuple):
    """State of a structure: modal displacements q [m] and velocities p [m/s], changed in place."""

    q: FloatArray
    p: FloatArray


class MovingStructure(NamedTuple):
    """A structure as the compiled loops take it.

    Attributes
    ----------
    system : System
    motion : Motion
        Changed.
    energies : ndarray, shape (5,)
        Added to.
    """

    system: System
    motion: Motion
    energies: FloatArray


def system_of(structure: Structure, step_s: float) -> System:
    """Return what the compiled loop needs to know of a structure.

    Parameters
    ----------
    structure : Structure
    step_s : float
        Time step [s].
    """
    damping, shape = structure.damping_matrix_kg_per_s, structure.shape_at_tank
    # damping by the implicit mid-point rule, stable however strong it is; K is explicit, as in the liquid's step
    inverse = np.linalg.inv(structure.mass_matrix_kg + 0.5 * step_s * damping)
    give = step_s * inverse
    return System(
        float(step_s),
        structure.stiffness_n_per_m,
        shape,
        structure.participation_kg,
        damping,
        np.ascontiguousarray(inverse @ (structure.mass_matrix_kg - 0.5 * step_s * damping)),
        np.ascontiguousarray(give),
        give @ shape,
        float(shape @ give @ shape),
        float(structure.coulomb_force_n),
    )


@njit(cache=True)
def step_structure(structure: MovingStructure, force: float, base: float, row: FloatArray) -> float:
    """Take one step; return the absolute acceleration of the tank during it.

    Parameters
    ----------
    structure : MovingStructure
    force : float
        Of the liquid on the tank, without static weight, upward [N].
    base : float
        Acceleration of the base [m/s²].
    row : ndarray, shape (3 n,)
        Written: q in the middle, mean velocity and acceleration of the step.
    """
    system, motion, energies = structure.system, structure.motion, structure.energies
    n, half = system.shape.size, 0.5 * system.step
    q, p = motion.q, motion.p
    for i in range(n):
        q[i] += half * p[i]
        row[i] = q[i]
    velocity = 0.0
    for i in range(n):
        new = 0.0
        for j in range(n):
            modal = -system.stiffness[j] * q[j] + system.shape[j] * force - system.participation[j] * base
            new += system.keep[i, j] * p[j] + system.give[i, j] * modal
        row[2 * n + i] = new
        velocity += system.shape[i] * new
    # as much as stops the tank within the step, but no more than Coulomb's force, so that what is at rest stays
    # there; the sign of the velocity would make it chatter
    friction = min(max(-velocity / system.mobility, -system.coulomb), system.coulomb)
    acceleration, mean = base, 0.0
    for i in range(n):
        new = row[2 * n + i] + friction * system.reaction[i]
        row[n + i], row[2 * n + i] = 0.5 * (p[i] + new), (new - p[i]) / system.step
        p[i] = new
        q[i] += half * new
        mean += system.shape[i] * row[n + i]
        acceleration += system.shape[i] * row[2 * n + i]
        energies[BASE_WORK] -= system.step * system.participation[i] * base * row[n + i]
    for i in range(n):
        for j in range(n):
            energies[VISCOSITY] += system.step * row[n + i] * system.damping[i, j] * row[n + j]
    energies[LIQUID_WORK] += system.step * force * mean
    energies[FRICTION] -= system.step * friction * mean
    return acceleration


@njit(cache=True)
def advance_structure(
    structure: MovingStructure, rigid_mass_kg: float, base: FloatArray, rows: FloatArray, forces: FloatArray
) -> None:
    """Take one step for each acceleration of the base, without liquid.

    Parameters
    ----------
    structure : MovingStructure
    rigid_mass_kg : float
        A mass at the tank that the structure contains; its force on the tank is given.
    base, rows : ndarray, shape (n_steps,) and (n_steps, 3 n)
        As in `step_structure`, one row for each step.
    forces : ndarray, shape (n_steps,)
        Written: −m ü.
    """
    for k in range(base.size):
        forces[k] = -rigid_mass_kg * step_structure(structure, 0.0, base[k], rows[k])


@dataclass(frozen=True)
class StructureAccount:
    """Energies [J] of a structure since the start of its run; losses are positive.

    Attributes
    ----------
    stored_j : float
        Gained in motion and deformation, a frozen liquid included.
    liquid_work_j, base_work_j : float
        Given by the force of the liquid and by the inertial force of the moving base.
    viscosity_j, friction_j : float
        Taken by viscous damping and by Coulomb friction.
    handed_over_j : float
        What the liquid gave; `liquid_work_j` but for impulses at walls, which arrive one step later.
    """

    stored_j: float
    liquid_work_j: float
    base_work_j: float
    viscosity_j: float
    friction_j: float
    handed_over_j: float

    @property
    def residual_j(self) -> float:
        """What nobody accounts for."""
        return self.stored_j + self.viscosity_j + self.friction_j - self.liquid_work_j - self.base_work_j

    @property
    def residual_share(self) -> float:
        """Residual over the largest term; 0 where nothing happened."""
        largest = max(abs(getattr(self, field.name)) for field in fields(self))
        return self.residual_j / largest if largest > 0 else 0.0


def stored_energy_j(structure: Structure, motion: Motion, step_s: float) -> float:
    """Return ½ p·Mp + ½ q·Kq − ⅛ Δt² p·Kp.

    Parameters
    ----------
    structure : Structure
    motion : Motion
    step_s : float
    """
    q, p, stiffness = motion.q, motion.p, structure.stiffness_n_per_m
    kinetic = 0.5 * p @ structure.mass_matrix_kg @ p
    # with the term of second order the account closes to rounding and not to the square of the step
    potential = 0.5 * stiffness @ q**2 - step_s**2 / 8 * stiffness @ p**2
    return float(kinetic + potential)


def account_of(
    structure: Structure, motion: Motion, step_s: float, energies: NDArray[Any], start_j: float
) -> StructureAccount:
    """Return the account.

    Parameters
    ----------
    structure, motion, step_s
        As they are now.
    energies : ndarray, shape (5,)
        Of the compiled loop.
    start_j : float
        Stored energy at the start.
    """
    gained = stored_energy_j(structure, motion, step_s) - start_j
    return StructureAccount(gained, *(float(value) for value in energies))
