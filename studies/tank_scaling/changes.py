"""What changes with size: W̄ and β of every point with the error of their means, and how far sizes differ.

Cycles of one run are not independent: the error of a mean comes from the scatter of means over blocks of cycles,
of all seeds together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from sloshlab.errors import InputError
from studies.tank_scaling.campaign import LAYERS, Run
from studies.tank_scaling.harmonic_runs import HarmonicRun, Point
from studies.tank_scaling.similarity import SimilarTank

BLOCK_CYCLES: Final = 6
"""At least; longer than the memory of the liquid, a few cycles."""


@dataclass(frozen=True)
class Mean:
    """A mean and its standard error.

    Attributes
    ----------
    value, error : float
    """

    value: float
    error: float

    @classmethod
    def of(cls, cycles: Sequence[ArrayLike]) -> Mean:
        """Of the cycles of some runs.

        Parameters
        ----------
        cycles : sequence of array_like
            One array for each seed.

        Raises
        ------
        InputError
            If there are not two blocks.

        Examples
        --------
        >>> Mean.of([[1.0] * 6 + [3.0] * 6])
        Mean(value=2.0, error=1.0)
        """
        runs = [np.asarray(run, float) for run in cycles]
        # every cycle belongs to a block; one that is cut off at the end of a run leaves a block shorter by one
        blocks = [
            block.mean()
            for run in runs
            if run.size >= BLOCK_CYCLES
            for block in np.array_split(run, run.size // BLOCK_CYCLES)
        ]
        value = float(np.concatenate(runs).mean()) if runs else math.nan
        if len(blocks) < 2:
            raise InputError(
                "cycles",
                got=f"{len(blocks)} blocks of {BLOCK_CYCLES}",
                allowed="2 and more",
                remedy="compute more",
            )
        return cls(value, float(np.std(blocks, ddof=1) / math.sqrt(len(blocks))))


@dataclass(frozen=True)
class Measured:
    """W̄ and β of one point in one tank.

    Attributes
    ----------
    w_bar, beta : Mean
    wall_layers, surface_tension : float
        Work that is not computed, over m_l (Ω u₀)².
    """

    w_bar: Mean
    beta: Mean
    wall_layers: float
    surface_tension: float


@dataclass(frozen=True)
class SizeChange:
    """How far a size differs from the training tank, over all points.

    Attributes
    ----------
    size : float
    work_mean, work_rms : float
        Mean and root mean square of W̄(λ)/W̄(1) − 1.
    work_noise : float
        Root mean square of the standard errors of these changes: what chance alone would make of the rms.
    beta_mean, beta_rms, beta_noise : float
        The same of β(λ) − β(1).
    """

    size: float
    work_mean: float
    work_rms: float
    work_noise: float
    beta_mean: float
    beta_rms: float
    beta_noise: float


Results = Mapping[Run, Mapping[str, Any]]


def measured(results: Results, point: Point, size: float, layers: int = LAYERS) -> Measured:
    """What all seeds of one point in one tank gave.

    Parameters
    ----------
    results : mapping
        Of `campaign.compute`.
    point : Point
    size : float
    layers : int

    Raises
    ------
    InputError
        If there is no such run.
    """
    found = [
        result
        for run, result in results.items()
        if isinstance(run, HarmonicRun)
        and (run.point, run.tank, run.layers_per_height) == (point, SimilarTank(size), layers)
    ]
    if not found:
        raise InputError("runs", got=f"none of {point} with size {size:g}", remedy="make tank-scaling")
    walls, tension = (
        float(np.mean([result["left_out"][name] for result in found]))
        for name in ("wall_layers", "surface_tension")
    )
    w_bar, beta = (Mean.of([result[name] for result in found]) for name in ("w_bar", "beta"))
    return Measured(w_bar, beta, walls, tension)


def size_change(results: Results, points: Sequence[Point], size: float) -> SizeChange:
    """Compare a size with the training tank.

    Parameters
    ----------
    results : mapping
    points : sequence of Point
    size : float
    """
    pairs = [(measured(results, point, 1.0), measured(results, point, size)) for point in points]
    work = np.array([now.w_bar.value / before.w_bar.value - 1 for before, now in pairs])
    # of a quotient close to one
    work_error = np.array(
        [
            now.w_bar.value / before.w_bar.value
            * math.hypot(now.w_bar.error / now.w_bar.value, before.w_bar.error / before.w_bar.value)
            for before, now in pairs
        ]
    )  # fmt: skip
    beta = np.array([now.beta.value - before.beta.value for before, now in pairs])
    beta_error = np.array([math.hypot(now.beta.error, before.beta.error) for before, now in pairs])
    return SizeChange(
        size, float(work.mean()), _rms(work), _rms(work_error), float(beta.mean()), _rms(beta), _rms(beta_error)
    )


def left_out_shares(results: Results, points: Sequence[Point]) -> tuple[float, float]:
    """Work in wall layers and in making surface in the training tank, as shares of W̄, both summed over the points.

    Parameters
    ----------
    results : mapping
    points : sequence of Point
    """
    found = [measured(results, point, 1.0) for point in points]
    whole = sum(one.w_bar.value for one in found)
    return sum(one.wall_layers for one in found) / whole, sum(one.surface_tension for one in found) / whole


def _rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
