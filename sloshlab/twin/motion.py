"""How a twin moved, and the forces on its tank: what recorded channels show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

from sloshlab.errors import AnalysisError
from sloshlab.twin.blocks import Blocks
from sloshlab.twin.status import Ending, Status

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """How a twin moved.

    Attributes
    ----------
    twin : Blocks
        Of the twin that was simulated.
    sampling_rate_hz : float
    ending : Ending
    modes : ndarray, shape (n, 3, n_modes)
        Displacement, velocity, acceleration of each mode.
    base_motion : ndarray, shape (n, 3)
        The same of the base; of the tank where there is no structure.
    external_force_n : ndarray, shape (n,)
        On the tank, as prescribed.
    tank_force_n : ndarray, shape (n,)
        Δf, the forces of all terms on the tank.
    """

    twin: Blocks
    sampling_rate_hz: float
    ending: Ending
    modes: FloatArray
    base_motion: FloatArray
    external_force_n: FloatArray
    tank_force_n: FloatArray

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples."""
        return np.arange(self.modes.shape[0]) / self.sampling_rate_hz

    @cached_property
    def places(self) -> FloatArray:
        """Displacement, velocity, acceleration of structure (relative) and tank (absolute), shape (n, 2, 3)."""
        # made when they are asked for: they follow from the modes, and keeping them would cost every simulation
        relative = np.stack([self._relative(order) for order in range(3)], axis=-1)
        return np.stack([relative, relative + self.base_motion], axis=1)

    def place(self, index: int, order: int) -> FloatArray:
        """Displacement, velocity or acceleration of structure (0, relative) or tank (1, absolute), shape (n,).

        Parameters
        ----------
        index : int
            In `sloshlab.twin.terms.PLACES`.
        order : int
            Of the derivative by time.
        """
        return self._relative(order) + index * self.base_motion[:, order]

    def _relative(self, order: int) -> FloatArray:
        """Displacement, velocity or acceleration of the tank relative to the base."""
        if self.twin.structure is None:
            return np.zeros(self.modes.shape[0])
        return np.asarray(self.modes[:, order] @ self.twin.structure.mode_shape)

    @property
    def base_acceleration_m_per_s2(self) -> FloatArray:
        """Acceleration of the base."""
        return self.base_motion[:, 2]

    @cached_property
    def displacement_m(self) -> FloatArray:
        """Displacement of the tank, absolute."""
        return self._relative(0) + self.base_motion[:, 0]

    @cached_property
    def velocity_m_per_s(self) -> FloatArray:
        """Velocity of the tank, absolute."""
        return self._relative(1) + self.base_motion[:, 1]

    @cached_property
    def acceleration_m_per_s2(self) -> FloatArray:
        """Acceleration of the tank, absolute."""
        return self._relative(2) + self.base_motion[:, 2]

    @cached_property
    def interface_force_n(self) -> FloatArray:
        """Force of the structure (or the shaker) on the tank, static weight removed."""
        # (1.19) solved for the force: F_ext = (M_dry + m_l) ü − Δf
        inertia = self.twin.carried_mass_kg * self.acceleration_m_per_s2
        return np.asarray(inertia - self.tank_force_n - self.external_force_n)

    def require_done(self) -> Self:
        """Itself, if it reached its end.

        Raises
        ------
        AnalysisError
            If it did not; the message says how and when.
        """
        if self.ending.status is not Status.DONE:
            raise AnalysisError(
                f"twin: {self.ending}", remedy="check the twin's parameters, or take smaller steps"
            )
        return self
