"""A structure that carries a tank, deflected and let go or moved at its base; without a liquid that sloshes.

`CoupledTank` of `coupling` is the one whose liquid is computed as particles, `CoupledTwoPhaseTank` that of liquid
and gas; what all tell is a `StructureHistory`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.numerical_tank.checkpoint_file import take_up
from acquisition.numerical_tank.structure_motion import (
    TERMS,
    Motion,
    MovingStructure,
    StructureAccount,
    account_of,
    advance_structure,
    stored_energy_j,
    system_of,
)
from acquisition.numerical_tank.structures import Structure
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

LARGEST_PHASE_PER_STEP = 1.0
"""ω Δt of the fastest mode; the leapfrog is unstable from 2 on."""


@dataclass(frozen=True)
class StructureHistory:
    """Motion of the structure and force of the liquid, in the middle of every step.

    Attributes
    ----------
    time_s : ndarray, shape (n_steps,)
        Since the start of the run.
    base_acceleration_m_per_s2 : ndarray, shape (n_steps,)
        As given.
    modal_displacement_m, modal_velocity_m_per_s, modal_acceleration_m_per_s2 : ndarray, shape (n_steps, n_modes)
        Relative to the base; the velocity is the mean of those before and after the step.
    liquid_force_n : ndarray, shape (n_steps,)
        Of the liquid on the tank, upward, without its static weight.
    shape_at_tank : ndarray, shape (n_modes,)
        ψ.
    """

    time_s: FloatArray
    base_acceleration_m_per_s2: FloatArray
    modal_displacement_m: FloatArray
    modal_velocity_m_per_s: FloatArray
    modal_acceleration_m_per_s2: FloatArray
    liquid_force_n: FloatArray
    shape_at_tank: FloatArray

    @property
    def tank_displacement_m(self) -> FloatArray:
        """Displacement of the tank relative to the base."""
        return np.asarray(self.modal_displacement_m @ self.shape_at_tank)

    @property
    def tank_velocity_m_per_s(self) -> FloatArray:
        """Velocity of the tank relative to the base."""
        return np.asarray(self.modal_velocity_m_per_s @ self.shape_at_tank)

    @property
    def tank_acceleration_m_per_s2(self) -> FloatArray:
        """Absolute acceleration of the tank."""
        return np.asarray(self.base_acceleration_m_per_s2 + self.modal_acceleration_m_per_s2 @ self.shape_at_tank)


class CarriedTank:
    """What all structures with a tank have in common: they are deflected and let go, and moved at the base.

    Parameters
    ----------
    structure : Structure
        Without the liquid; a frozen one included.
    step_s : float
        Time step [s].
    """

    def __init__(self, structure: Structure, step_s: float) -> None:
        _check_step(structure, step_s)
        self.structure, self.step_s = structure, step_s
        self._motion = Motion(np.zeros(structure.n_modes), np.zeros(structure.n_modes))
        self._energies = np.zeros(TERMS)
        self._moving = MovingStructure(system_of(structure, step_s), self._motion, self._energies)
        self._start_j = 0.0

    @property
    def n_steps(self) -> int:
        """Steps done since the start."""
        raise NotImplementedError

    @property
    def time_s(self) -> float:
        """Time since the start."""
        return self.n_steps * self.step_s

    @property
    def tank_velocity_m_per_s(self) -> float:
        """Velocity of the tank relative to the base, now."""
        return float(self.structure.shape_at_tank @ self._motion.p)

    def deflect(self, displacement_m: float) -> None:
        """Hold the tank at a place by a static force, let go when time starts.

        Parameters
        ----------
        displacement_m : float
            Of the tank, upward, from the equilibrium with the liquid.

        Raises
        ------
        InputError
            If the run has begun or the number is not finite.
        """
        if self.n_steps or not math.isfinite(displacement_m):
            raise InputError("initial displacement", got=f"{displacement_m} m after {self.n_steps} steps")
        self._motion.q[:], self._motion.p[:] = self.structure.deflected(displacement_m), 0.0
        self._start_j = stored_energy_j(self.structure, self._motion, self.step_s)

    def times_s(self, n_steps: int) -> FloatArray:
        """Return the middles of the next steps.

        Parameters
        ----------
        n_steps : int
        """
        return np.asarray((self.n_steps + np.arange(n_steps) + 0.5) * self.step_s, np.float64)

    def account(self) -> StructureAccount:
        """Return where the energy of the structure went since the start."""
        return account_of(self.structure, self._motion, self.step_s, self._energies, self._start_j)

    def _history(self, base: FloatArray, rows: FloatArray, forces: FloatArray, first: int) -> StructureHistory:
        n, time_s = self.structure.n_modes, (first + np.arange(base.size) + 0.5) * self.step_s
        q, p, a = (np.ascontiguousarray(rows[:, k * n : (k + 1) * n]) for k in range(3))
        return StructureHistory(np.asarray(time_s), base, q, p, a, forces, self.structure.shape_at_tank)


class SloshingTank(CarriedTank):
    """What structures with a computed liquid have in common: a state that a checkpoint keeps.

    Parameters
    ----------
    tank : object
        Of the liquid, with ``setup`` and ``n_steps``.
    structure : Structure
        Without the liquid.
    carried : ndarray
        What one step hands to the next beside the states of tank and structure; changed.
    """

    def __init__(self, tank: Any, structure: Structure, carried: FloatArray) -> None:
        super().__init__(structure, tank.setup.step_s)
        self.tank: Any = tank
        self._carried = carried

    @property
    def n_steps(self) -> int:
        """Steps done since the start."""
        return int(self.tank.n_steps)

    def advance(self, base_acceleration_m_per_s2: ArrayLike) -> StructureHistory:
        """Take one step for each acceleration of the base, as the kind of liquid does."""
        raise NotImplementedError

    def structure_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of what a later step depends on beside the tank, for `coupled_checkpoint.save`."""
        own = {f"structure_{name}": value.copy() for name, value in self._kept().items()}
        return {**own, "structure_start": np.array([self._start_j])}

    def restore_structure(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take up the state that `structure_arrays` returned.

        Parameters
        ----------
        arrays : mapping of str to ndarray

        Raises
        ------
        KeyError
            If one is missing.
        InputError
            If one does not belong to this structure or is not finite.
        """
        start = np.zeros(1)
        targets = {f"structure_{name}": target for name, target in {**self._kept(), "start": start}.items()}
        take_up(targets, arrays)
        self._start_j = float(start[0])

    def _kept(self) -> dict[str, FloatArray]:
        q, p = self._motion
        return {"q": q, "p": p, "energies": self._energies, "carried": self._carried}


class FrozenTank(CarriedTank):
    """A tank whose liquid is a rigid mass, on a structure; with a mass of zero it is empty.

    Parameters
    ----------
    mass_kg : float
        Of the frozen liquid.
    structure : Structure
        Without the liquid.
    step_s : float
        Time step [s].

    Examples
    --------
    >>> from acquisition.numerical_tank.structures import Mode
    >>> frozen = FrozenTank(1.0, Structure((Mode(3.0, 400.0, 0.0, 1.0, 3.0),)), 1e-3)
    >>> frozen.deflect(0.01)
    >>> round(float(frozen.advance([0.0]).tank_acceleration_m_per_s2[0]), 6)
    -1.0
    """

    def __init__(self, mass_kg: float, structure: Structure, step_s: float) -> None:
        if not (math.isfinite(mass_kg) and mass_kg >= 0):
            raise InputError("mass of the frozen liquid", got=f"{mass_kg}", allowed="≥ 0")
        super().__init__(structure.with_mass_at_tank(mass_kg), step_s)
        self.mass_kg = mass_kg
        self._n_steps = 0

    @property
    def n_steps(self) -> int:
        """Steps done since the start."""
        return self._n_steps

    def advance(self, base_acceleration_m_per_s2: ArrayLike) -> StructureHistory:
        """Take one step for each acceleration of the base.

        Parameters
        ----------
        base_acceleration_m_per_s2 : array_like, shape (n_steps,)
            Upward, in the middle of every step.

        Raises
        ------
        InputError
            If an acceleration is not finite.
        """
        base = as_base(base_acceleration_m_per_s2)
        rows, forces = np.zeros((base.size, 3 * self.structure.n_modes)), np.zeros(base.size)
        advance_structure(self._moving, self.mass_kg, base, rows, forces)
        first, self._n_steps = self._n_steps, self._n_steps + base.size
        return self._history(base, rows, forces, first)


def _check_step(structure: Structure, step_s: float) -> None:
    if not 0 < step_s < math.inf:
        raise InputError("step_s", got=f"{step_s}", allowed="> 0")
    fastest = float(structure.natural_frequencies_hz()[-1])
    longest = LARGEST_PHASE_PER_STEP / (2 * math.pi * fastest)
    if step_s > longest:
        raise InputError(
            "time step for the structure",
            got=f"{step_s:.3g} s",
            allowed=f"at most {longest:.3g} s for its mode of {fastest:.4g} Hz",
            remedy="take finer particles, a higher sampling rate, or fewer modes",
        )


def as_base(acceleration_m_per_s2: ArrayLike) -> FloatArray:
    """Return the acceleration of the base as the compiled loops take it.

    Parameters
    ----------
    acceleration_m_per_s2 : array_like, shape (n_steps,)

    Raises
    ------
    InputError
        If its shape is another or a number is not finite.
    """
    base = np.array(acceleration_m_per_s2, np.float64)
    if base.ndim != 1 or not np.isfinite(base).all():
        raise InputError("acceleration of the base", got=f"shape {base.shape}", allowed="(n_steps,), all finite")
    return base
