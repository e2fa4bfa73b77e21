"""What a twin did: motions, forces, memory, works and events over time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.channel_names import ACCELERATION_ROOT, ACCELERATION_TIP, DISPLACEMENT_TANK, FORCE_INTERFACE
from sloshlab.errors import InputError
from sloshlab.twin.motion import Motion
from sloshlab.twin.terms import PLACES

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Simulation(Motion):
    """What a twin did, beyond how it moved.

    Attributes
    ----------
    forces_n : ndarray, shape (n, n_terms)
        Each term's force at its place, upward positive.
    memory : ndarray, shape (n, n_memory)
        States of the terms, one after the other, each followed by its switches; those of equations first.
    works_j : ndarray, shape (n, 2 n_terms + 3)
        Work since the start: of each term on the modes and in the frame of its place, then modal damping,
        inertia of the base motion, external force, on the modes.
    events : ndarray, shape (n_events, 4)
        Time [s], term (−1 dry friction), number of its event, new value of the switch.
    n_events : int
        All of them; `events` holds the first ones.
    """

    forces_n: FloatArray
    memory: FloatArray
    works_j: FloatArray
    events: FloatArray
    n_events: int = field(default=0)

    @property
    def work_of_terms_j(self) -> FloatArray:
        """Work of each term in the frame of its place, shape (n, n_terms); dissipated is negative."""
        return self.works_j[:, 1 : 2 * len(self.twin.terms) : 2]

    @property
    def mechanical_energy_j(self) -> FloatArray:
        """Kinetic and elastic energy of the modes, the liquid frozen."""
        structure = self.twin.structure
        if structure is None:
            return np.zeros(self.modes.shape[0])
        kinetic = self.modes[:, 1] ** 2 @ structure.masses_kg
        return np.asarray(0.5 * (kinetic + self.modes[:, 0] ** 2 @ structure.stiffnesses_n_per_m))

    @cached_property
    def energy_residual_j(self) -> FloatArray:
        """Energy gained less the works that gave it; zero but for the integrator's error."""
        n = len(self.twin.terms)
        # works on the modes: in the frame of its place a force of the tank also takes from the moving base
        given = self.works_j[:, 0 : 2 * n : 2].sum(axis=1) + self.works_j[:, 2 * n :].sum(axis=1)
        return np.asarray(self.mechanical_energy_j - self.mechanical_energy_j[0] - given)

    @property
    def relative_energy_error(self) -> float:
        """Largest residual of the energy over what was passed on: largest work and largest energy together."""
        passed = float(np.abs(self.works_j).max(initial=0.0)) + float(self.mechanical_energy_j.max())
        return float(np.abs(self.energy_residual_j).max()) / passed if passed else 0.0

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What the forces have to say, each on its motion and memory: regions that they were not measured in."""
        lines: list[str] = []
        at = 0 if self.twin.equations is None else self.twin.n_states_before_terms
        for term in self.twin.terms:
            n_memory = len(term.kind.memory(term.values, term.table)) + term.kind.n_switches
            if term.kind.remarks is not None:
                motion = self.places[:, PLACES.index(term.place)]
                lines += term.kind.remarks(term, self.time_s, motion, self.memory[:, at : at + n_memory])
            at += n_memory
        return tuple(lines)

    def to_dataset(self, *, seed: int | None = None) -> xr.Dataset:
        """Channels under the names of recordings, as the sensors read them; channels without a sensor are true."""
        channels = {
            ACCELERATION_TIP: (self.acceleration_m_per_s2, "m s-2"),
            ACCELERATION_ROOT: (self.base_acceleration_m_per_s2, "m s-2"),
            DISPLACEMENT_TANK: (self.displacement_m, "m"),
            FORCE_INTERFACE: (self.interface_force_n, "N"),
        }
        generator = None if seed is None else np.random.default_rng(seed)
        for sensor in self.twin.sensors:
            if sensor.channel not in channels:
                raise InputError(f"sensor {sensor.channel}", allowed=", ".join(channels))
            truth, units = channels[sensor.channel]
            channels[sensor.channel] = (sensor.reading(truth, self.sampling_rate_hz, generator=generator), units)
        return xr.Dataset(
            {
                name: ("time", values, {"units": units, "quantity": name.split("_")[0]})
                for name, (values, units) in channels.items()
            },
            coords={"time": self.time_s},
        )
