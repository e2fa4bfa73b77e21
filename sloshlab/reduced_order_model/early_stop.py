"""When a training ends because the validation error says so."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

EPOCHS_PER_RISE: Final = 2


@dataclass
class EarlyStop:
    """Watches the validation error of one training.

    Attributes
    ----------
    patience : int
        Rises one after another after which it ends. It also ends after twice as many epochs without an error
        below the lowest so far: an error that wavers rises and falls for ever.

    Examples
    --------
    >>> stop = EarlyStop(2)
    >>> [stop.reason(error) for error in (3.0, 2.0, 2.5, 2.6)]
    ['', '', '', 'validation error rose 2 times']
    """

    patience: int
    _lowest: float = math.inf
    _before: float = math.inf
    _rises: int = 0
    _epochs_since: int = 0

    def reason(self, validation: float) -> str:
        """Take the error of an epoch; return why training ends, or nothing.

        Parameters
        ----------
        validation : float
        """
        self._rises = self._rises + 1 if validation > self._before else 0
        self._epochs_since = 0 if validation < self._lowest else self._epochs_since + 1
        self._before, self._lowest = validation, min(self._lowest, validation)
        if self._rises >= self.patience:
            return f"validation error rose {self._rises} times"
        if self._epochs_since >= EPOCHS_PER_RISE * self.patience:
            return f"validation error no lower for {self._epochs_since} epochs"
        return ""
