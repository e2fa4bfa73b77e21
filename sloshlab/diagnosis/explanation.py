"""Explanations of what a simulation misses, and everything that a verdict is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.candidate import Surroundings, channels_of
from sloshlab.diagnosis.case import Case
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.extension import Extension
from sloshlab.diagnosis.free_run_problem import FreeRunFit, extension_of
from sloshlab.diagnosis.observations import Observation
from sloshlab.diagnosis.split import Split

FloatArray = NDArray[np.float64]
_Place = TypeVar("_Place")
LARGEST_REMAINDER: Final = 1.25
"""Held-out error in noise floors, as repeats tell it, beyond which something is left whatever was found."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """A simulation with some effects, fitted, and how it does on runs that chose nothing.

    Attributes
    ----------
    fit : FreeRunFit
    held_out : float
        Huber cost of the weighted residuals of the held-out runs.
    held_out_rms : float
        Root mean square of the weighted residuals where the recording stands out of the noise.
    by_channel : dict
        Mean Huber cost of the same per channel.
    by_run : dict
        The same per run and channel, of fitted and held-out runs.
    rms_without_bursts : float
        As `held_out_rms`, of the quieter three quarters of the times of every channel and run.
    repeatable : dict
        Repeatable mean square: what repeats of a test have in common of their residuals, per name of the test's
        first run and channel.
    spread : dict
        Of the effects' parameters over fits with randomised baselines; empty where none were made.
    scatter : dict
        Cluster-robust standard errors of the same; empty where they are not known.
    """

    fit: FreeRunFit
    held_out: float
    held_out_rms: float
    by_channel: dict[str, float] = field(default_factory=dict)
    by_run: dict[tuple[str, str], float] = field(default_factory=dict)
    rms_without_bursts: float = 0.0
    repeatable: dict[tuple[str, str], float] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)
    scatter: dict[str, float] = field(default_factory=dict)

    @property
    def repeatable_by_test(self) -> list[list[float]]:
        """`repeatable` of every test, one number per channel."""
        by_test: dict[str, list[float]] = {}
        for (test, _), in_common in self.repeatable.items():
            by_test.setdefault(test, []).append(in_common)
        # Per test and not in one mean: what one test shares is left, however little others do.
        return list(by_test.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects, sorted."""
        return tuple(sorted(candidate.effect.known_as for candidate in self.fit.candidates))

    @property
    def keys(self) -> tuple[str, ...]:
        """Blocks, names and channels of its effects."""
        return tuple(candidate.key for candidate in self.fit.candidates)

    @property
    def names_with_blocks(self) -> tuple[str, ...]:
        """Blocks and names of its effects, sorted; several channels may have the same."""
        return tuple(
            sorted(f"{candidate.effect.block}.{candidate.effect.known_as}" for candidate in self.fit.candidates)
        )

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels on which its effects act."""
        return tuple(
            name
            for candidate in self.fit.candidates
            if candidate.channel
            for name in channels_of(candidate.channel)
        )

    @property
    def has_effect_at_bound(self) -> bool:
        """Whether a parameter rests at a bound of its effect: then something else is missing."""
        # A bound of zero is none: what ends there is nothing, and its size says so.
        return any(
            bound != 0
            and not parameter.may_rest
            and abs(self.fit.values[f"{candidate.key}.{parameter.name}"] - bound) <= 1e-6 * abs(bound)
            for candidate in self.fit.candidates
            for parameter in candidate.effect.parameters
            for bound in candidate.bounds(parameter)
        )

    @property
    def n_numbers(self) -> int:
        """Numbers of its effects."""
        return sum(len(candidate.effect.parameters) for candidate in self.fit.candidates)


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything that a verdict is made of.

    Attributes
    ----------
    case : Case
    model : DiagnosedModel
    split : Split
    surroundings : Surroundings
    fitting, held_out : list of list of Observation
    believed, retuned : Explanation
    explanations : list of Explanation
        With one effect or more, in the order in which they were tried.
    ceilings : list of Explanation
        What a name is compared with: force surfaces, and rejected pairs.
    failed : dict
        Candidates that could not be fitted, and why.
    screened : dict
        Candidates whose score test predicts too little, and the gain that it predicts.
    """

    case: Case
    model: DiagnosedModel
    split: Split
    surroundings: Surroundings
    fitting: list[list[Observation]]
    held_out: list[list[Observation]]
    believed: Explanation
    retuned: Explanation
    explanations: list[Explanation]
    ceilings: list[Explanation]
    failed: dict[str, str]
    screened: dict[str, float]

    def readings(self, explanation: Explanation) -> dict[str, dict[str, FloatArray]]:
        """What every channel of every run reads in an explanation."""
        return {
            run.name: self.model.simulate(run, explanation.fit.values, explained_extension(explanation))
            for run in self.case.runs
        }

    @property
    def has_repeats(self) -> bool:
        """Whether runs of one test tell what the recordings' scatter is."""
        return any(len(test) > 1 for test in self.case.tests())

    @property
    def held_out_tests(self) -> frozenset[str]:
        """Names of the first runs of tests of which runs are held out."""
        judged = {run.name for run in self.split.held_out}
        tests = self.case.names_by_test()
        return frozenset(test[0] for test in tests if not judged.isdisjoint(test))

    @property
    def n_fitting(self) -> int:
        """Coefficients of the fitting runs."""
        return sum(observation.spectra.size for run in self.fitting for observation in run)

    @property
    def n_held_out(self) -> int:
        """Coefficients of the held-out runs."""
        return sum(observation.spectra.size for run in self.held_out for observation in run)


def explained_extension(explanation: Explanation) -> Extension:
    """What an explanation adds to the baseline."""
    return extension_of(explanation.fit.candidates, explanation.fit.values)


def largest_strength(before: Mapping[_Place, float], after: Mapping[_Place, float]) -> float:
    """Effect size: √(before/after − 1) of the place that shows most, neither below the noise floor."""
    # What is removed below the noise floor is what one run happened to have.
    removed = [max(before[place], 1.0) / max(left, 1.0) - 1.0 for place, left in after.items() if place in before]
    return float(np.sqrt(max([0.0, *removed])))
