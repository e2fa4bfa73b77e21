"""What the figures are about: levels of runs, reference runs and reference points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.figure import NothingToDrawError
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.experiments import EXPERIMENTS
from sloshlab.sweep.law import LawKind

if TYPE_CHECKING:
    from pipelines.sweep.results import RigResult, RunResult, SweepExperiment

FloatArray = npt.NDArray[np.float64]

REFERENCE_LEVELS_G: Final = (1.5, 3.0)
REFERENCE_FREQUENCIES_HZ: Final = (9.0, 13.0, 17.0)
_LARGEST_LEVEL_RATIO: Final = 2.0
"""A run further than this from a reference level does not stand in for it if there is another one."""


@dataclass(frozen=True)
class Point:
    """A place on the plane of frequency and amplitude."""

    frequency_hz: float
    acceleration_g: float

    @property
    def amplitude_m(self) -> float:
        """u₀ = a₀/Ω² [m]."""
        return self.acceleration_g * GRAVITY_M_PER_S2 / (2 * math.pi * self.frequency_hz) ** 2


def runs_of(experiment: SweepExperiment, rig: RigResult) -> tuple[RunResult, ...]:
    """Runs of a rig that have windows, by level."""
    return by_level(run for run in experiment.runs if run.rig_name == rig.name)


def by_level(runs: Iterable[RunResult]) -> tuple[RunResult, ...]:
    """Runs that have windows, weakest first; runs of one level stay in their order."""
    return tuple(sorted((run for run in runs if run.windows.sizes["window"]), key=level_g))


def level_g(run: RunResult) -> float:
    """Acceleration level of a run [g]: as the recording states it, else the median of its windows."""
    stated = run.attributes.acceleration_g
    if stated is not None and stated > 0:
        return float(stated)
    return float(np.median(run.windows["acceleration_g"].values))


def level_text(run: RunResult) -> str:
    """The level as text, for example ``"1.5 g"``."""
    return f"{level_g(run):.3g} g"


def is_sweep(run: RunResult) -> bool:
    """True for a run that holds one level; amplitude-modulated runs are not shown as a level."""
    return not EXPERIMENTS[run.attributes.experiment].is_modulated


def goes_up(run: RunResult) -> bool:
    """True if the frequency rises with time."""
    windows = run.windows.sortby("time_s")
    frequency = windows["frequency_hz"].values
    return bool(frequency[-1] >= frequency[0])


def reference_runs(
    runs: Sequence[RunResult], levels_g: Sequence[float] = REFERENCE_LEVELS_G
) -> tuple[RunResult, ...]:
    """For each level the upward sweep nearest to it, each run once, weakest first.

    A run that is more than a factor of two from a level stands in for it only if no other was found.
    """
    candidates = [run for run in runs if is_sweep(run)] or list(runs)
    chosen: dict[int, RunResult] = {}
    for level in levels_g:
        distance = [abs(math.log2(level_g(run) / level)) for run in candidates]
        # among equally near levels an upward sweep first, then the order given
        order = sorted(
            range(len(candidates)), key=lambda i: (round(distance[i], 3), not goes_up(candidates[i]), i)
        )
        if order and (distance[order[0]] <= math.log2(_LARGEST_LEVEL_RATIO) or not chosen):
            chosen.setdefault(order[0], candidates[order[0]])
    return by_level(chosen.values())


def reference_points(runs: Sequence[RunResult]) -> tuple[Point, ...]:
    """Where the excerpts of the reference runs were taken (Table 1.2)."""
    return tuple(
        Point(excerpt.frequency_hz, excerpt.acceleration_g)
        for run in reference_runs(runs)
        for excerpt in run.excerpts
    )


def rig_text(rig: RigResult) -> str:
    """The fill level as text."""
    return f"α = {rig.rig.liquid.fill_level:.2f}"


def by_frequency(windows: xr.Dataset) -> xr.Dataset:
    """Windows in order of frequency."""
    return windows.sortby("frequency_hz")


def common_time_law(runs: Sequence[RunResult]) -> RunResult | None:
    """The first upward run with a law, if every upward sweep keeps the same law within 1 %."""
    sweeps = [run for run in runs if is_sweep(run) and goes_up(run)]
    kinds = {run.law.kind for run in sweeps}
    if len(kinds) != 1 or not kinds <= {LawKind.OCTAVE, LawKind.LINEAR} or sweeps[0].law.rate <= 0:
        return None
    first = sweeps[0].law
    same = all(
        math.isclose(run.law.rate, first.rate, rel_tol=0.01)
        and math.isclose(run.law.start_hz, first.start_hz, rel_tol=0.01)
        for run in sweeps
    )
    return sweeps[0] if same else None


def finite_or_raise(values: FloatArray, what: str) -> FloatArray:
    """The values; raises `NothingToDrawError` if none is finite."""
    if not np.isfinite(values).any():
        raise NothingToDrawError(f"{what}: no finite value")
    return values
