"""A structure and its tank of liquid and gas, each moved by the other in the same instant.

Fluids that are not compressed push back on an acceleration at once, as a mass does: their force over a step is

    f(a) = f₀ − m a,    0 ≤ m ≤ mass of both fluids,

as far as the step does not change how they are carried. The structure answers a force with an acceleration S(f).
Taking turns would answer each with the other of the step before, an error that grows with the ratio of masses.
So the step of the fluids is repeated, from the same state, until the acceleration that it was given is the one
that the structure answers its force with: S(f(a)) = a, by the secant method, mostly after two or three trials.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.numerical_tank.carried_tank import SloshingTank, StructureHistory, as_base
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.structure_motion import HANDED_OVER, step_structure
from acquisition.numerical_tank.structures import Structure
from acquisition.two_phase_tank.setup import TwoPhaseSetup
from acquisition.two_phase_tank.simulation import TwoPhaseTank

FloatArray = NDArray[np.float64]

TOLERANCE: Final = 1e-6
"""Of the acceleration, over its size and gravity."""
MOST_TRIALS: Final = 8
"""What is left after them goes into the next step: a step in one part more or less makes f(a) jump a little."""
_CARRIED: Final = 4
_FORCE, _ACCELERATION, _MASS, _BEHIND = range(_CARRIED)
"""Of the last step: force without weight [N] and acceleration [m/s²]; m [kg]; velocity by which the tank that the
fluids feel lags behind the structure [m/s]."""


class CoupledTwoPhaseTank(SloshingTank):
    """A tank of liquid and gas on a structure.

    Parameters
    ----------
    setup : TwoPhaseSetup
        Box, fluids, grid, seed; its time step is that of both.
    structure : Structure
        Without the liquid.

    Examples
    --------
    >>> from acquisition.numerical_tank.structures import Mode
    >>> from acquisition.numerical_tank.tank import Box
    >>> from acquisition.two_phase_tank.setup import filled_two_phase_tank
    >>> on_spring = Structure((Mode(2.0, 3800.0, 0.0, 1.0, 2.0),))
    >>> tank = CoupledTwoPhaseTank(filled_two_phase_tank(Box(0.06, 0.03, 0.05), 0.5, 12), on_spring)
    >>> tank.deflect(-0.005)
    >>> history = tank.advance(np.zeros(10))
    >>> bool(history.tank_acceleration_m_per_s2[0] > 9.0)
    True
    """

    def __init__(self, setup: TwoPhaseSetup, structure: Structure) -> None:
        carried = np.zeros(_CARRIED)
        carried[_MASS] = setup.fluid_mass_kg
        super().__init__(TwoPhaseTank(setup), structure, carried)

    def advance(self, base_acceleration_m_per_s2: ArrayLike) -> StructureHistory:
        """Take one step for each acceleration of the base.

        Parameters
        ----------
        base_acceleration_m_per_s2 : array_like, shape (n_steps,)
            Upward, mean over every step.

        Raises
        ------
        InputError
            If an acceleration is not finite.
        InstabilityError
            If the computation cannot go on; its `valid` is the history of the steps before.
        """
        base = as_base(base_acceleration_m_per_s2)
        rows, forces = np.zeros((base.size, 3 * self.structure.n_modes)), np.zeros(base.size)
        first = self.n_steps
        try:
            for k in range(base.size):
                forces[k] = self._step(float(base[k]), rows[k])
        except InstabilityError as error:
            done = self.n_steps - first
            valid = self._history(base[:done], rows[:done], forces[:done], first)
            raise InstabilityError(error.reason, self.time_s, error.place_m, valid, error.remedy) from error
        return self._history(base, rows, forces, first)

    def _step(self, base: float, row: FloatArray) -> float:
        """Take one step of both; return the force of the fluids without their weight [N]."""
        force, acceleration, mass, behind = (float(value) for value in self._carried)
        step_s, heaviest = self.step_s, self.tank.setup.fluid_mass_kg
        mobility = self._moving.system.mobility / step_s
        before = self.tank.checkpoint_arrays()
        # the answer to the force of the step before, as far as fluids of the mass m would change it
        missing = self._answer(force, base, row) + behind / step_s - acceleration
        tried = acceleration + missing / (1 + mobility * mass)
        for trial in range(MOST_TRIALS):
            if trial:
                self.tank.restore(before)
            given = self.tank.step(tried)[0] + heaviest * self.tank.setup.gravity_m_per_s2
            if trial and tried != acceleration:
                # bounded by what fluids can weigh: two trials that are close say little
                mass = min(max((force - given) / (tried - acceleration), 0.0), heaviest)
            force, acceleration = given, tried
            missing = self._answer(force, base, row) + behind / step_s - acceleration
            if abs(missing) <= TOLERANCE * (abs(acceleration) + self.tank.setup.gravity_m_per_s2):
                break
            tried = acceleration + missing / (1 + mobility * mass)
        velocity = self.tank_velocity_m_per_s
        answered = step_structure(self._moving, force, base, row)
        more_behind = step_s * (answered - acceleration)
        # the fluids felt a tank that lags by what was left of this step and of those before
        felt = 0.5 * (velocity + self.tank_velocity_m_per_s) - behind - 0.5 * more_behind
        self._energies[HANDED_OVER] += step_s * force * felt
        self._carried[:] = force, acceleration, mass, behind + more_behind
        return force

    def _answer(self, force: float, base: float, row: FloatArray) -> float:
        """Acceleration of the tank that the structure answers a force with; its state stays as it is."""
        q, p, energies = self._motion.q.copy(), self._motion.p.copy(), self._energies.copy()
        answer = float(step_structure(self._moving, force, base, row))
        self._motion.q[:], self._motion.p[:], self._energies[:] = q, p, energies
        return answer
