"""Rivals that find no physics: the commonest answer, and the retuned baseline with a rule on its error."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sealed_trial.scoring.mark import NOTHING_HIDDEN
from studies.rivals.said import Verdict, nothing_missing, unknown
from studies.rivals.seen import Seen
from studies.rivals.training import Known

_LEVEL: Final = 0.95
"""Of development cases with nothing missing, share that the threshold lets pass."""


def always_nothing(seen: Seen) -> Verdict:
    """The commonest right answer, said of every case.

    Parameters
    ----------
    seen : Seen
    """
    del seen
    return nothing_missing({"none": 1.0})


@dataclass(frozen=True)
class RemainingError:
    """Unknown where the retuned baseline leaves more than it does where nothing is missing.

    Attributes
    ----------
    largest : float
        Mean square of the whitened residuals of held-out runs: χ² over its degrees of freedom.
    block : str
        The error has no place: the block in which most is hidden.
    """

    largest: float
    block: str

    @classmethod
    def learnt(cls, cases: Sequence[Known]) -> RemainingError:
        """The 95 % quantile of development cases with nothing missing.

        Parameters
        ----------
        cases : sequence of Known
        """
        complete = [case.seen.judged for case in cases if case.kind in NOTHING_HIDDEN]
        blocks = Counter(block for case in cases for block, _ in case.effects)
        return cls(float(np.quantile(complete, _LEVEL)), blocks.most_common(1)[0][0])

    def say(self, seen: Seen) -> Verdict:
        """The answer to a case.

        Parameters
        ----------
        seen : Seen
        """
        return nothing_missing() if seen.judged <= self.largest else unknown(self.block)
