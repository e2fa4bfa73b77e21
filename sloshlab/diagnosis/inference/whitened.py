"""Residuals of a model in standard deviations of the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.diverging_motions import DivergingMotions
from sloshlab.diagnosis.inference.known_runs import KnownRun
from sloshlab.diagnosis.inference.run_noise import RunNoise
from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.observations import Observation
from sloshlab.missing_physics.candidate import Candidate, extension_of

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WhitenedRun:
    """One run under one model.

    Attributes
    ----------
    known : KnownRun
        Under the model.
    residual : ndarray, shape (n_channels, n_blocks, n_bands)
        Recorded minus simulated spectra over the standard deviation of the noise.
    diverging : list of ndarray
        By what motions differ that are as likely as the simulated one, each of the shape of `residual`.
    """

    known: KnownRun
    residual: FloatArray
    diverging: list[FloatArray] = field(default_factory=list)

    @property
    def observed(self) -> Sequence[Observation]:
        """Its channels."""
        return self.known.observed

    @property
    def noise(self) -> RunNoise:
        """Of its channels together."""
        return self.known.noise

    @property
    def simulated(self) -> FloatArray:
        """Simulated spectra in standard deviations of the noise, of the shape of `residual`."""
        recorded = np.stack([each.spectra / np.sqrt(each.variance) for each in self.observed])
        return np.asarray(recorded - self.residual)

    def in_noise_of(self, other: WhitenedRun) -> FloatArray:
        """Its residual in the standard deviations of the same run under another model.

        Parameters
        ----------
        other : WhitenedRun
        """
        pairs = list(zip(self.observed, other.observed, strict=True))
        if all(own is its for own, its in pairs):
            return self.residual
        return np.asarray(self.residual * np.stack([np.sqrt(own.variance / its.variance) for own, its in pairs]))

    @property
    def name(self) -> str:
        """Of the run."""
        return self.observed[0].run.name

    @property
    def channels(self) -> tuple[str, ...]:
        """In the order of the arrays."""
        return tuple(observation.channel for observation in self.observed)


def whitened(
    model: DiagnosedModel,
    runs: Sequence[KnownRun],
    candidates: Sequence[Candidate],
    values: Mapping[str, float],
    motions: DivergingMotions,
) -> list[WhitenedRun] | None:
    """Runs under a model; None where its simulation does not reach the end of each.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of KnownRun
        Under this model.
    candidates : sequence of Candidate
        Effects of the model.
    values : mapping
        All numbers, those of single runs too.
    motions : DivergingMotions
    """
    extension, found = extension_of(candidates, values), []
    for known in runs:
        observed = known.observed
        names = [observation.channel for observation in observed]
        try:
            readings = model.simulate(observed[0].run, values, extension, names)
        except SloshlabError:
            return None
        residual = np.stack([each.residual(readings[each.channel]) for each in observed])
        found.append(WhitenedRun(known, residual, motions.differences(observed, candidates, values)))
    return found
