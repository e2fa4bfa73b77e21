"""The cases of a sensitivity study, what came of each, and which model it recommends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sloshlab.errors import AnalysisError

NEARLY_THE_SAME: Final = 1.02
"""RMS errors that differ by less than this factor are not worth more parameters."""


@dataclass(frozen=True)
class StudyCase:
    """One combination.

    Attributes
    ----------
    structure : {"nfir", "noe"}
    delays, output_delays, neurons : int
    network : str
    """

    structure: str
    delays: int
    output_delays: int
    neurons: int
    network: str = "normalised_rbf"

    @property
    def name(self) -> str:
        """Folder of the case.

        Examples
        --------
        >>> StudyCase("nfir", 70, 0, 35).name
        'nfir_70_35'
        """
        middle = f"{self.delays}" + (f"+{self.output_delays}" if self.output_delays else "")
        kind = "" if self.network == "normalised_rbf" else f"_{self.network}"
        return f"{self.structure}_{middle}_{self.neurons}{kind}"

    @property
    def cost(self) -> float:
        """About how long an epoch takes, in no unit; for the order of the cases and the time left."""
        size = self.neurons * (self.delays + self.output_delays)
        if self.output_delays:
            return 20.0 * size**2  # sample by sample, first one step ahead and then free
        return float(size**2) if self.network != "multilayer" else 5.0 * size**2


SOURCE_CASES: Final = (
    *(StudyCase("nfir", delays, 0, neurons) for delays in (50, 60, 70) for neurons in range(5, 45, 5)),
    *(StudyCase("noe", 2, 2, neurons) for neurons in (10, 15, 20)),
)
"""24 NFIR and 3 NOE, as in the source."""

FURTHER_CASES: Final = (
    StudyCase("nfir", 30, 0, 20),
    StudyCase("nfir", 100, 0, 35),
    StudyCase("nfir", 70, 0, 35, "rbf"),
    StudyCase("nfir", 70, 0, 20, "multilayer"),
    StudyCase("noe", 8, 2, 15),
)
"""Shorter and longer delay lines, the other networks, and an NOE with more delays of the velocity."""


@dataclass(frozen=True)
class CaseResult:
    """What a case gave.

    Attributes
    ----------
    case : StudyCase
    training_mse, validation_mse : float
        In the square of the output's unit; infinite if it could not be trained.
    n_parameters, n_epochs : int
    seconds : float
        Of training.
    ended : str
        Why training ended, or failed.
    """

    case: StudyCase
    training_mse: float
    validation_mse: float
    n_parameters: int
    n_epochs: int
    seconds: float
    ended: str

    @property
    def is_trained(self) -> bool:
        """Whether there is a model."""
        return math.isfinite(self.validation_mse)

    @property
    def mean_mse(self) -> float:
        """Mean of both, which is what the source shows."""
        return 0.5 * (self.training_mse + self.validation_mse)


@dataclass(frozen=True)
class Pick:
    """The model that the study recommends.

    Attributes
    ----------
    best : CaseResult
        Smallest validation error.
    lighter : CaseResult
        Fewest parameters among those with nearly the same error; may be the best itself.
    reason : str
        Why, in one line.
    """

    best: CaseResult
    lighter: CaseResult
    reason: str


def picked(results: Sequence[CaseResult]) -> Pick:
    """Pick by validation error, and say why.

    Parameters
    ----------
    results : sequence of CaseResult

    Raises
    ------
    AnalysisError
        If no case could be trained.
    """
    trained = sorted(
        (result for result in results if result.is_trained),
        key=lambda result: (result.validation_mse, result.n_parameters),
    )
    if not trained:
        raise AnalysisError("study", got="no case that could be trained", remedy="see the reasons in its table")
    best = trained[0]
    near = [
        result for result in trained if result.validation_mse**0.5 <= NEARLY_THE_SAME * best.validation_mse**0.5
    ]
    lighter = min(near, key=lambda result: result.n_parameters)
    error = best.validation_mse**0.5
    reason = f"{best.case.name} has the smallest error on the validation runs, {error:.4g} N RMS"
    if len(trained) > 1:
        behind = 100 * (trained[1].validation_mse ** 0.5 / error - 1)
        reason += f"; next is {trained[1].case.name}, {behind:.2g} % behind"
    if lighter is not best:
        more = 100 * (lighter.validation_mse**0.5 / error - 1)
        reason += (
            f"; lightest within {100 * (NEARLY_THE_SAME - 1):.0f} % is {lighter.case.name}, "
            f"{lighter.n_parameters} "
            f"instead of {best.n_parameters} parameters, {more:.2g} % behind"
        )
    return Pick(best, lighter, reason)
