"""What a twin consists of, as data that the engine's preparation and the simulation both read."""

from __future__ import annotations

from dataclasses import dataclass

from sloshlab.twin.sensors import Sensor
from sloshlab.twin.state_equations import StateEquations
from sloshlab.twin.structure import Structure
from sloshlab.twin.terms import Term


@dataclass(frozen=True, eq=False)
class Blocks:
    """Structure, or equations in its place, forces and sensors.

    Attributes
    ----------
    structure : Structure or None
        None: the tank's motion is prescribed.
    terms : tuple of Term
        Forces of structure and tank. A frozen liquid has none.
    sensors : tuple of Sensor
    carried_mass_kg : float
        Tank with frozen liquid, all that the interface force moves.
    equations : StateEquations or None
        In place of a structure.
    """

    structure: Structure | None
    terms: tuple[Term, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    carried_mass_kg: float = 0.0
    equations: StateEquations | None = None

    @property
    def n_states_before_terms(self) -> int:
        """Of the equations, or of the modes: the memories of terms follow."""
        if self.equations is not None:
            return len(self.equations.compiled.states)
        return 0 if self.structure is None else 2 * self.structure.masses_kg.size
