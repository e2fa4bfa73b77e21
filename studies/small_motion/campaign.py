"""Computed runs of both liquids, each kept in a file: stopped at any time, it goes on with the next one."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.computed_force import PARTICLES, TankMethod, computed_force
from acquisition.numerical_tank.tank import Box, filled_tank
from acquisition.two_phase_tank.method import LIQUID_AND_GAS
from acquisition.two_phase_tank.setup import filled_two_phase_tank
from pipelines.report.progress import progress
from sloshlab import atomic_file
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from studies.small_motion.motion import (
    CARRIED,
    RANDOM,
    RANDOM_TESTS,
    RANDOM_VALIDATION,
    SLOW,
    SLOW_VALIDATION,
    SMALL,
    Motion,
)

FloatArray = NDArray[np.float64]

TANK: Final = Box(length_m=0.1172, height_m=0.0272, depth_m=0.078)
FILL: Final = 0.5
RATE_HZ: Final = 256.0
MODEL_RATE_HZ: Final = 128.0
LAYERS: Final = 16
"""Cells or particles over the height, as of the recordings."""
TESTS: Final = (*RANDOM_TESTS, CARRIED)
"""Computed from two starts of the liquid: their difference is what the motion does not decide."""
_DIGITS: Final = 4


@dataclass(frozen=True)
class ComputedRun:
    """A motion of one liquid.

    Attributes
    ----------
    liquid : {"two_phase", "particles"}
    motion : Motion
    seed : int
        Of the disturbance at the start.
    """

    liquid: str
    motion: Motion
    seed: int = 0

    @property
    def name(self) -> str:
        """Name without spaces, for files."""
        return f"{self.liquid}_{self.motion.name}_seed_{self.seed}"


def runs(liquid: str) -> list[ComputedRun]:
    """All runs of a liquid; of particles the carried motion alone, beside the recordings that there are.

    Parameters
    ----------
    liquid : str
    """
    if liquid == "particles":
        return [ComputedRun(liquid, CARRIED, seed) for seed in (0, 1)]
    once = (SLOW, SLOW_VALIDATION, SMALL, RANDOM, RANDOM_VALIDATION)
    twice = [ComputedRun(liquid, motion, seed) for seed in (0, 1) for motion in TESTS]
    return [*(ComputedRun(liquid, motion) for motion in once), *twice]


def compute(folder: Path, liquid: str) -> dict[str, LiquidSignals]:
    """Compute what is not there yet; return signals at `MODEL_RATE_HZ` by the names of the runs.

    Parameters
    ----------
    folder : Path
        One file per run.
    liquid : str
    """
    folder.mkdir(parents=True, exist_ok=True)
    left = [run for run in runs(liquid) if not (folder / f"{run.name}.json").is_file()]
    with progress(f"motions, {liquid}", len(left), [run.motion.duration_s for run in left]) as done:
        for run in left:
            force = dynamic_force_n(run)
            document = json.dumps({"dynamic_force_n": np.round(force, _DIGITS).tolist()})
            atomic_file.write_bytes(folder / f"{run.name}.json", document.encode())
            done(run.name)
    return {run.name: _signals(run, folder) for run in runs(liquid)}


def dynamic_force_n(run: ComputedRun) -> FloatArray:
    """Δf of a run [N], sample k at k/`RATE_HZ`; upward positive, beyond the frozen fluids (2.22).

    Parameters
    ----------
    run : ComputedRun

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    setup, method = _setup(run)
    computed = computed_force(setup, run.motion.acceleration_m_per_s2, run.motion.duration_s, method=method)
    times = np.arange(computed.vertical_n.size) / RATE_HZ
    return computed.vertical_n + method.mass_kg(setup) * run.motion.acceleration_m_per_s2(times)


def _setup(run: ComputedRun) -> tuple[Any, TankMethod]:
    if run.liquid == "two_phase":
        made = filled_two_phase_tank(TANK, FILL, LAYERS, seed=run.seed, sampling_rate_hz=RATE_HZ)
        return made, LIQUID_AND_GAS
    return filled_tank(TANK, FILL, LAYERS, seed=run.seed, sampling_rate_hz=RATE_HZ), PARTICLES


def _signals(run: ComputedRun, folder: Path) -> LiquidSignals:
    force = np.array(json.loads((folder / f"{run.name}.json").read_bytes())["dynamic_force_n"], np.float64)
    times = np.arange(force.size) / RATE_HZ
    velocity, acceleration = run.motion.velocity_m_per_s(times), run.motion.acceleration_m_per_s2(times)
    found = LiquidSignals(velocity, force, acceleration, RATE_HZ, run.name).at_rate(MODEL_RATE_HZ)
    return LiquidSignals(
        _rest_first(found.velocity_m_per_s),
        _rest_first(found.dynamic_force_n),
        _rest_first(found.acceleration_m_per_s2),
        MODEL_RATE_HZ,
        run.name,
    )


def _rest_first(values: FloatArray) -> FloatArray:
    """The filter of the rate knows nothing before the first sample; there was rest."""
    first = int(np.argmax(np.isfinite(values)))
    return np.concatenate([np.zeros(first), values[first:]])
