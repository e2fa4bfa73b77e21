"""Residuals whose noise is independent and standard normal: of single runs, and of what repeats of a test share.

Repeats have the same drive, so that physics that is missing shows in all of them in the same phase, and noise does
not. Their orthonormal combinations – the sum over √n, and what they differ by (Helmert's contrasts) – have
independent noise again; what repeats share is in the first alone, and n times as strong there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import helmert

from sloshlab.diagnosis.inference.whitened import WhitenedRun

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class IndependentResiduals:
    """Of a run, or of one combination of repeats.

    Attributes
    ----------
    residual : ndarray, shape (n_channels, n_blocks, n_bands)
        In standard deviations.
    simulated : list of ndarray
        What is simulated of every repeat, of the same shape.
    lacking : list of ndarray
        Residuals of every repeat with nothing added; empty where these are the residuals themselves.
    diverging : list of ndarray
        By what motions differ that are as likely as the simulated one, of every repeat: these are as independent
        as two draws.
    places : dict of str to (ndarray, ndarray)
        Directions of places and shares of power in them, as in `RunNoise`.
    exactness : dict of str to float
        As in `RunNoise`.
    is_informative : ndarray of bool, shape (n_blocks, n_bands)
        Where some channel stands out of the noise.
    log_density : ndarray, shape (n_blocks, n_bands)
        As in `KnownRun`; zero where it has none.
    """

    residual: FloatArray
    simulated: list[FloatArray]
    lacking: list[FloatArray]
    diverging: list[FloatArray]
    places: Mapping[str, tuple[FloatArray, FloatArray]]
    exactness: Mapping[str, float]
    is_informative: NDArray[np.bool_]
    log_density: FloatArray


def independent_residuals(
    runs: Sequence[WhitenedRun], missing: Sequence[WhitenedRun] = (), tests: Sequence[Sequence[str]] = ()
) -> list[IndependentResiduals]:
    """Residuals of runs, those of repeats combined.

    Parameters
    ----------
    runs : sequence of WhitenedRun
    missing : sequence of WhitenedRun, optional
        The same runs with nothing added.
    tests : sequence of sequences of str, optional
        Names of the runs of every test; runs of no test are alone.
    """
    test_of = {name: i for i, test in enumerate(tests) for name in test}
    groups: dict[object, list[IndependentResiduals]] = {}
    for number, run in enumerate(runs):
        each = _of_run(run, missing[number] if missing else None)
        # Repeats that were cut off, or lack a channel, cannot be added up.
        alike = (test_of[run.name], run.channels, each.residual.shape[1]) if run.name in test_of else number
        groups.setdefault(alike, []).append(each)
    return [each for group in groups.values() for each in _combined(group)]


def _of_run(run: WhitenedRun, missing: WhitenedRun | None) -> IndependentResiduals:
    return IndependentResiduals(
        run.noise.whitened(run.residual),
        [run.noise.whitened(run.simulated)],
        [] if missing is None else [run.noise.whitened(missing.in_noise_of(run))],
        [run.noise.whitened(change) for change in run.diverging],
        run.noise.places,
        run.noise.exactness,
        np.any([each.informative for each in run.observed], axis=0),
        np.zeros(run.residual.shape[1:]) if run.known.log_density is None else run.known.log_density,
    )


def _combined(repeats: Sequence[IndependentResiduals]) -> list[IndependentResiduals]:
    if len(repeats) == 1:
        return list(repeats)
    # The bands that are compared end where a run has no more to tell, and noise differs a little between repeats.
    n = min(each.residual.shape[-1] for each in repeats)
    first = repeats[0]
    residuals = np.stack([each.residual[..., :n] for each in repeats])
    return [
        IndependentResiduals(
            np.einsum("r,rcbk->cbk", row, residuals),
            [signal[..., :n] for each in repeats for signal in each.simulated],
            [signal[..., :n] for each in repeats for signal in each.lacking],
            [change[..., :n] for each in repeats for change in each.diverging],
            {place: (rows[:, :n], shares[:, :n]) for place, (rows, shares) in first.places.items()},
            first.exactness,
            np.any([each.is_informative[:, :n] for each in repeats], axis=0),
            # Combinations are orthonormal, so that all together have the densities of all repeats.
            np.mean([each.log_density[:, :n] for each in repeats], axis=0),
        )
        for row in helmert(len(repeats), full=True)
    ]
