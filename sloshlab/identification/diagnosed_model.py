"""What a search needs of a simulation: the twin of a rig file is one, a user's own twin another."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.identification.case import CaseRun
from sloshlab.missing_physics.candidate import Candidate, Effect
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.twin.lane_preparation import Executor
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
EXACT: Final = 0.01
"""Of a motion and of its numbers, to which a simulation describes a rig: as gains are known. Less is no physics of
its own."""


@dataclass(frozen=True, eq=False)
class Request:
    """A simulation that is asked for.

    Attributes
    ----------
    run : CaseRun
    values : mapping
        Of the parameters of a model; absent ones are as believed.
    extension : Extension
    only : collection of str
        Channels that are asked for; all of them by default.
    """

    run: CaseRun
    values: Mapping[str, float]
    extension: Extension
    only: Collection[str] = ()


Readings = dict[str, FloatArray]
"""What channels read, by name."""


class DiagnosedModel(Protocol):
    """A simulation that can be retuned and extended.

    Attributes
    ----------
    runs : tuple of CaseRun
    parameters : tuple of BaselineParameter
        Those whose names end with ``release of RUN`` or ``in RUN`` belong to that run alone.
    blocks : tuple of str
        Of `sloshlab.missing_physics.candidate.BLOCKS`, those in which something may be missing.
    executor : Executor
        Shares simulations and fits among its workers; results do not depend on it.
    """

    runs: tuple[CaseRun, ...]
    parameters: tuple[BaselineParameter, ...]
    blocks: tuple[str, ...]
    executor: Executor

    @property
    def twin(self) -> Twin:
        """The baseline, or what stands for it where effects ask for masses and stiffnesses."""

    @property
    def moving_mass_kg(self) -> float:
        """What the forces of effects accelerate, about."""

    @property
    def believed(self) -> dict[str, float]:
        """Values of all parameters as the laboratory believes them."""

    def compared(self, run: CaseRun) -> list[str]:
        """Channels of a run that the simulation shows too."""

    def driving(self, run: CaseRun) -> tuple[str, ...]:
        """Channels that drive the simulation of a run."""

    def simulate(
        self, run: CaseRun, values: Mapping[str, float], extension: Extension, only: Collection[str] = ()
    ) -> Readings:
        """What the compared channels of a run read, all or some; raises `AnalysisError` where it does not end."""

    def simulate_many(self, requests: Sequence[Request]) -> list[Readings | SloshlabError]:
        """The same of many simulations; in place of those that do not reach their end, why."""

    def motion(self, run: CaseRun, values: Mapping[str, float], extension: Extension = NOTHING) -> FloatArray:
        """Displacement, velocity, acceleration of the place where effects act, shape (n, 3)."""

    def save_extended(self, values: Mapping[str, float], candidates: Sequence[Candidate], path: Path) -> None:
        """Write the simulation with retuned numbers and effects."""


@runtime_checkable
class ModelOfBlocks(Protocol):
    """A model of several blocks that says itself what may be missing in each, and how that shows.

    Attributes
    ----------
    effects : tuple of Effect
        Beside those of sensors.
    """

    effects: tuple[Effect, ...]

    def block_transfers(
        self, run: CaseRun, values: Mapping[str, float], frequencies_hz: FloatArray
    ) -> Mapping[str, ComplexArray]:
        """Readings of the compared channels per unit of what a place lacks, shape (n_frequencies, n_channels).

        Names of places begin with their block, as ``tank 2``; the unit is that of the place.
        """
