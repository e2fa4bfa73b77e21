"""A twin of several blocks as a model to be retuned and extended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.case import CaseRun
from sloshlab.missing_physics.candidate import Effect
from sloshlab.twin.lane_preparation import IN_TURN, Executor
from sloshlab.user_twin.description import BlockTwin
from sloshlab.user_twin.model import UserTwinModel


class BlockTwinModel(UserTwinModel):
    """A twin of several blocks and the runs it is compared with (`ModelOfBlocks`).

    Parameters
    ----------
    twin : BlockTwin
    runs : sequence of CaseRun
    name : str
        For messages.
    executor : Executor, optional
        Shares fits among its workers.

    Raises
    ------
    InputError
        If a run lacks a channel or has it in other units, or the twin cannot run as believed.
    """

    def __init__(
        self, twin: BlockTwin, runs: Sequence[CaseRun], *, name: str = "twin", executor: Executor = IN_TURN
    ) -> None:
        super().__init__(twin, runs, name=name, executor=executor)
        self._twin = twin
        self.effects: tuple[Effect, ...] = twin.effects
        self.blocks = (*dict.fromkeys(effect.block for effect in twin.effects), "sensor")

    def driving(self, run: CaseRun) -> tuple[str, ...]:
        """None: faults of what drives are effects of the twin itself."""
        del run
        return ()

    def block_transfers(
        self, run: CaseRun, values: Mapping[str, float], frequencies_hz: NDArray[np.float64]
    ) -> Mapping[str, NDArray[np.complex128]]:
        """Readings of the compared channels per unit of what a place lacks, shape (n_frequencies, n_channels)."""
        gains = np.array([values.get(f"gain of {name}", 1.0) for name in self.compared(run)])
        names = list(self._twin.compared)
        chosen = [names.index(name) for name in self.compared(run)]
        found = self._twin.transfers(self._views[run.name], self._own(run, values), frequencies_hz)
        return {place: gains * transfers[:, chosen] for place, transfers in found.items()}
