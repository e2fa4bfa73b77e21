"""How well runs are known under each model: a sensor that a model says is faulty leaves the drive to the others.

Noise is then larger than where all of them drive, so that densities of the same readings are normalised otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.run_noise import RunNoise, run_noise
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.free_run_problem import faulty_channels
from sloshlab.identification.observations import Observation
from sloshlab.missing_physics.candidate import Candidate

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class KnownRun:
    """A run as it is known under a model.

    Attributes
    ----------
    observed : sequence of Observation
        Its channels.
    noise : RunNoise
        Of these together.
    log_density : ndarray, shape (n_blocks, n_bands), or None
        Logarithm of the largest density of the channels that do not drive over that where all sensors drive; None
        where they do.
    """

    observed: Sequence[Observation]
    noise: RunNoise
    log_density: FloatArray | None = None


class KnownRuns:
    """Runs as they are known under models.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    values : mapping
        Of the baseline along which noise and transfers are computed.
    """

    def __init__(
        self, model: DiagnosedModel, runs: Sequence[Sequence[Observation]], values: Mapping[str, float]
    ) -> None:
        self._model, self._values = model, values
        self._plain = [KnownRun(run, run_noise(model, run, values)) for run in runs]
        self._beside: dict[frozenset[str], list[KnownRun]] = {}

    def under(self, candidates: Sequence[Candidate]) -> list[KnownRun]:
        """Every run under a model with some effects.

        Parameters
        ----------
        candidates : sequence of Candidate
        """
        faulty = faulty_channels(candidates)
        if faulty not in self._beside:
            self._beside[faulty] = [self._beside_faults(plain, faulty) for plain in self._plain]
        return self._beside[faulty]

    def _beside_faults(self, plain: KnownRun, faulty: frozenset[str]) -> KnownRun:
        observed = [each.beside_faults(faulty) for each in plain.observed]
        pairs = list(zip(observed, plain.observed, strict=True))
        if all(new is old for new, old in pairs):
            return plain
        beside = KnownRun(observed, run_noise(self._model, observed, self._values))
        driving = self._model.driving(observed[0].run)
        return replace(beside, log_density=_log_density(beside, driving) - _log_density(plain, driving))


def _log_density(known: KnownRun, driving: Sequence[str]) -> FloatArray:
    """Logarithm of the largest density of the channels that do not drive, given the differences of those that do.

    These have the same density whichever of them stands for the motion.
    """
    deviations = np.sqrt(np.stack([each.variance for each in known.observed], axis=-1))
    root = known.noise.inverse_root / deviations[..., None, :]
    covariance = np.linalg.inv(np.swapaxes(root, -1, -2) @ root)
    drives = np.array([each.channel in driving for each in known.observed])
    of_driving = covariance[..., drives, :][..., drives]
    return np.asarray(0.5 * (np.linalg.slogdet(of_driving)[1] - np.linalg.slogdet(covariance)[1]))
