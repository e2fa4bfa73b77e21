"""When a training ends because the validation error says so."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

EPOCHS_PER_RISE: Final = 2


@dataclass
class EarlyStop:
    """Watches the validation error of one training.

    Attributes
    ----------
    patience : int
        Rises one after another after which it ends.
    least_gain : float
        Share by which the lowest error must fall within twice as many epochs, or it ends, too: an error that
        rises and falls in turn never rises often enough in a row, and one that falls by little never rises.

    Examples
    --------
    >>> stop = EarlyStop(2)
    >>> [stop.reason(error) for error in (3.0, 2.0, 2.5, 2.6)]
    ['', '', '', 'validation error rose 2 times']
    """

    patience: int
    least_gain: float = 0.0
    _before: float = math.inf
    _rises: int = 0
    _lowest: list[float] = field(default_factory=list)

    def reason(self, validation: float) -> str:
        """Take the error of an epoch; return why training ends, or nothing.

        Parameters
        ----------
        validation : float
        """
        # in a row: six in the source (2.2)
        self._rises = self._rises + 1 if validation > self._before else 0
        self._before = validation
        self._lowest.append(min(validation, self._lowest[-1] if self._lowest else math.inf))
        if self._rises >= self.patience:
            return f"validation error rose {self._rises} times"
        n_epochs = EPOCHS_PER_RISE * self.patience
        if len(self._lowest) <= n_epochs:
            return ""
        before, now = self._lowest[-1 - n_epochs], self._lowest[-1]
        # a training that wavers never rises often enough in a row
        if now == before:
            return f"validation error no lower for {n_epochs} epochs"
        # one that creeps never rises: 70 delays and 35 neurons went on for a hundred epochs for 0.3 per cent
        gain = 1.0 - now / before if math.isfinite(before) else 1.0
        if gain < self.least_gain:
            return f"validation error only {100 * gain:.2g} % lower after {n_epochs} epochs"
        return ""
