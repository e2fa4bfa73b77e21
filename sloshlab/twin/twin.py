"""The twin: blocks put together, simulated in one go (closed loop) or each on a measured input (open loop).

>>> from sloshlab.twin.excitation import free
>>> from sloshlab.twin.structure import single_degree_of_freedom
>>> from sloshlab.twin.structure_forces import COULOMB_FRICTION
>>> twin = Twin(single_degree_of_freedom(2.241, 3808.8)).with_term(COULOMB_FRICTION(force_n=0.37))
>>> result = twin.simulate(free(3.0, 1000.0), initial_displacement_m=0.002)
>>> print(result.ending)
simulated to the end
>>> abs(float(result.displacement_m[-1])) <= 0.37 / 3808.8
True
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from sloshlab.errors import InputError
from sloshlab.rig import Rig
from sloshlab.twin.blocks import Blocks
from sloshlab.twin.excitation import Excitation
from sloshlab.twin.preparation import Watch, run
from sloshlab.twin.sensors import Sensor
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.structure import guide_friction_n, structure_of_rig
from sloshlab.twin.structure_forces import COULOMB_FRICTION
from sloshlab.twin.tank_models import tank_terms
from sloshlab.twin.terms import Term

__all__ = ["Simulation", "Twin"]


@dataclass(frozen=True, eq=False)
class Twin(Blocks):
    """Structure, forces and sensors, put together from a rig or block by block, and simulated."""

    @classmethod
    def from_rig(cls, rig: Rig, *, folder: Path | None = None) -> Twin:
        """The twin of a rig file's [structure] and [twin] tables.

        Parameters
        ----------
        rig : Rig
        folder : Path, optional
            Where files that [twin] names are looked for: that of the rig file.

        Raises
        ------
        RigError
            If the tank model's parameters are missing or impossible, or the model is not available.
        """
        structure = None if rig.structure is None else structure_of_rig(rig)
        friction = guide_friction_n(rig)
        # a term, not a property of the structure: it sticks
        terms = (COULOMB_FRICTION(force_n=friction),) if friction > 0 else ()
        carried = rig.tank.dry_mass_kg + rig.liquid_mass_kg
        return cls(structure, (*terms, *tank_terms(rig, folder)), carried_mass_kg=carried)

    def with_term(self, term: Term) -> Twin:
        """The twin with one more force."""
        return replace(self, terms=(*self.terms, term))

    def with_sensor(self, sensor: Sensor) -> Twin:
        """The twin with one more sensor."""
        return replace(self, sensors=(*self.sensors, sensor))

    def tank_alone(self) -> Twin:
        """The tank on a prescribed (measured) motion: open loop."""
        return replace(self, structure=None, terms=tuple(term for term in self.terms if term.place == "tank"))

    def structure_alone(self) -> Twin:
        """The structure on a prescribed (measured) force of the liquid: open loop. So is a frozen liquid."""
        return replace(self, terms=tuple(term for term in self.terms if term.place == "structure"))

    def simulate(
        self,
        excitation: Excitation,
        *,
        initial_displacement_m: float = 0.0,
        initial_velocity_m_per_s: float = 0.0,
        n_substeps: int = 1,
        watch: Watch | None = None,
    ) -> Simulation:
        """Free run of all blocks together.

        Parameters
        ----------
        excitation : Excitation
            Also sets the rate and the length of the output.
        initial_displacement_m : float
            Deflection of the tank by a static force, released at t = 0.
        initial_velocity_m_per_s : float
            Velocity of the tank at t = 0, shared among the modes as the deflection is.
        n_substeps : int
            Integration steps per output sample.
        watch : callable, optional
            Told from time to time how many samples are done, and of how many.

        Returns
        -------
        Simulation
            Up to where it ended; `ending` says how.

        Raises
        ------
        InputError
            If the blocks contradict each other.
        """
        if not 1 <= n_substeps <= 1000:
            raise InputError("n_substeps", got=str(n_substeps), allowed="1 … 1000")
        start = (initial_displacement_m, initial_velocity_m_per_s)
        return run(self, excitation, start, n_substeps, watch)
