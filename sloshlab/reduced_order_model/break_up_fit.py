"""The break-up of the liquid from runs that start suddenly, given a model of its steady state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Run

FloatArray = NDArray[np.float64]

BLOCK_S: Final = 0.1
"""About a cycle: over it the force in phase with the velocity is compared."""
_BOUNDS: Final = {
    "growth_per_s": (1.0, 1e3),
    "exponent": (0.05, 2.0),
    "calming_s": (0.05, 20.0),
    "at_rest": (1e-5, 0.2),
}
_N_TRIED, _N_REFINED = 128, 3
"""Points of the Halton sequence, and how many of the best ones least squares starts from."""
_SLOWEST_SHARE: Final = 0.02


def with_break_up(model: ReducedOrderModel, runs: Sequence[Run]) -> ReducedOrderModel:
    """Return a model with a break-up that follows some runs.

    Parameters
    ----------
    model : ReducedOrderModel
        Without feedback; its force is that of the liquid broken up. It stays as it is.
    runs : sequence of Run
        Sudden starts with rest before them, and slow runs, so that the steady state stays.

    Raises
    ------
    AnalysisError
        If the model predicts nothing of these runs.

    Notes
    -----
    Least squares of the component of Δf − b Δf_model in phase with the velocity, Σ e v/√(Σ v²) over blocks of
    `BLOCK_S`: what does no work is left out, for its phase scatters and would only make b too small. The
    logarithms of the parameters start from the best points of a Halton sequence.
    """
    steady = replace(model, break_up=None)
    forces = [steady.simulate(run.x) for run in runs]
    known = [np.isfinite(force) & np.isfinite(run.y) for force, run in zip(forces, runs, strict=True)]
    if not any(samples.any() for samples in known):
        raise AnalysisError("break-up", got="no sample that the model can predict", remedy="longer runs")
    # blocks at rest must not count by dividing by next to no speed
    floor = _SLOWEST_SHARE * np.sqrt(np.mean([np.nanmean(run.x**2) for run in runs]))
    size = max(1, round(BLOCK_S * model.sampling_rate_hz))

    def errors(logarithms: FloatArray) -> FloatArray:
        break_up = BreakUp(*np.exp(logarithms).tolist())
        found = []
        for run, force, used in zip(runs, forces, known, strict=True):
            error = np.where(used, run.y - break_up.share(run.x, model.sampling_rate_hz) * force, 0.0)
            found.append(_in_phase(error, run.x, size, floor))
        return np.concatenate(found)

    # logarithms: growth and rest share span decades
    low, high = np.log(np.array(list(_BOUNDS.values())).T)
    # an even cover of the box before least squares, which alone ends in the next valley
    tried = qmc.scale(qmc.Halton(low.size, seed=0).random(_N_TRIED), low, high)
    costs = [float(np.sum(errors(logarithms) ** 2)) for logarithms in tried]
    starts = tried[np.argsort(costs)[:_N_REFINED]]
    found = [least_squares(errors, start, bounds=(low, high), diff_step=1e-3) for start in starts]
    best = min(found, key=lambda solution: float(solution.cost))
    values = dict(zip((field_.name for field_ in fields(BreakUp)), np.exp(best.x).tolist(), strict=True))
    return replace(model, break_up=BreakUp(**values))


def _in_phase(error: FloatArray, velocity: FloatArray, size: int, floor: float) -> FloatArray:
    n = error.size // size * size
    v = np.nan_to_num(velocity[:n]).reshape(-1, size)
    return np.asarray(
        np.sum(error[:n].reshape(-1, size) * v, axis=1) / np.sqrt(np.sum(v**2, axis=1) + size * floor**2)
    )
