"""The fill level of the tank as an input of the network: one regressor that is constant during a run.

Forces of such a model are per mass of the liquid, or of one reference mass: what grows with the mass alone need
not be learnt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

MARGIN: Final = 0.02
"""Of the fill level beyond those of the training at which a model may still be asked."""


@dataclass(frozen=True)
class FillInput:
    """How the fill level enters, and at which one the model is asked.

    Attributes
    ----------
    lowest, highest : float
        Of the training runs.
    offset, scale : float
        The regressor is (fill level − offset)/scale.
    level : float, optional
        Of the tank that the model stands for now; `ReducedOrderModel.at_fill` sets it.
    """

    lowest: float
    highest: float
    offset: float
    scale: float
    level: float | None = None

    def __post_init__(self) -> None:
        numbers = np.array([self.lowest, self.highest, self.offset, self.scale])
        if not np.isfinite(numbers).all() or not 0 < self.lowest < self.highest < 1 or not self.scale > 0:
            raise InputError(
                "fill levels of a model", got=str(numbers.tolist()), allowed="0 < lowest < highest < 1"
            )
        if self.level is not None and not self.lowest - MARGIN <= self.level <= self.highest + MARGIN:
            raise InputError(
                "fill level",
                got=f"{self.level:g}",
                allowed=f"{self.lowest:g} … {self.highest:g}, as the model was trained",
                remedy="train a model at that fill level, too",
            )

    @classmethod
    def fitted(cls, levels: Sequence[float | None], spread: float) -> FillInput:
        """What makes the regressor of some runs spread as wanted.

        Parameters
        ----------
        levels : sequence of float
            Of the training runs, two different ones at least.
        spread : float
            Standard deviation of the regressor over the runs.

        Raises
        ------
        InputError
            If a run does not tell its fill level, or all are the same.

        Examples
        --------
        >>> fill = FillInput.fitted([0.25, 0.75], 1.0)
        >>> fill.offset, fill.scale, fill.at(0.75).regressor(2).tolist()
        (0.5, 0.25, [1.0, 1.0])
        """
        known = [level for level in levels if level is not None]
        if len(known) < len(levels) or len(set(known)) < 2:
            got = f"{len(set(known))} different ones, {len(levels) - len(known)} runs without"
            raise InputError("fill levels of the training runs", got=got, allowed="two different ones at least")
        values = np.array(known)
        return cls(float(values.min()), float(values.max()), float(values.mean()), float(values.std()) / spread)

    def at(self, level: float) -> FillInput:
        """Return it for a tank filled to a level.

        Raises
        ------
        InputError
            If the level is beyond those of the training.
        """
        return replace(self, level=level)

    def regressor(self, n_samples: int, level: float | None = None) -> FloatArray:
        """Return the regressor along a run, shape (n_samples,).

        Parameters
        ----------
        n_samples : int
        level : float, optional
            Of the run; by default the one that was set.

        Raises
        ------
        InputError
            If neither tells a level.
        """
        chosen = self.level if level is None else level
        if chosen is None:
            raise InputError(
                "fill level", got="none", allowed=f"{self.lowest:g} … {self.highest:g}", remedy="set it by at_fill"
            )
        return np.full(n_samples, (chosen - self.offset) / self.scale)

    def facts(self) -> dict[str, Any]:
        """Return what makes it again."""
        return asdict(self)

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> FillInput:
        """Make it from what `facts` gave."""
        return cls(**facts)
