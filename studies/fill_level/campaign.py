"""Runs of the study, each kept in a file of its own: stopped at any time, it goes on with the next one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.computed_force import computed_force
from acquisition.numerical_tank.tank import Box, TankSetup, filled_tank
from pipelines.report.progress import progress
from sloshlab import atomic_file
from sloshlab._version import __version__
from studies.fill_level.motion import TEST, TRAINING, VALIDATION, VariedMotion

FloatArray = NDArray[np.float64]

TANK: Final = Box(length_m=0.1172, height_m=0.0272, depth_m=0.078)
"""The tank of the shaker."""
LAYERS: Final = 12
"""Particles over the height: one with 16 costs 2.4 times as much."""
FILLS: Final = (4 / 12, 5 / 12, 6 / 12, 8 / 12, 9 / 12)
"""Whole layers of particles, four at least."""
RATE_HZ: Final = 256.0
SEED: Final = 0
_DIGITS: Final = 5


@dataclass(frozen=True)
class FilledRun:
    """A motion of a tank filled to a level.

    Attributes
    ----------
    fill_level : float
    motion : VariedMotion
    seed : int
        Of the disturbance at the start.
    """

    fill_level: float
    motion: VariedMotion
    seed: int = SEED

    @property
    def name(self) -> str:
        """Name without spaces, for files."""
        return f"fill_{self.fill_level:.3f}_{self.motion.name}_seed_{self.seed}"

    @property
    def setup(self) -> TankSetup:
        """The numerical tank."""
        return filled_tank(TANK, self.fill_level, LAYERS, seed=self.seed, sampling_rate_hz=RATE_HZ)

    @property
    def identity(self) -> str:
        """Hash of what determines the run: what is computed, and by which version."""
        return hashlib.sha256(f"{self!r} {LAYERS} {RATE_HZ} {__version__}".encode()).hexdigest()


@dataclass(frozen=True)
class ComputedRun:
    """Motion and force at `RATE_HZ`, from the start at rest.

    Attributes
    ----------
    run : FilledRun
    velocity_m_per_s : ndarray, shape (n,)
        Of the tank.
    specific_force_m_per_s2 : ndarray, shape (n,)
        Δf over the mass of the liquid; upward positive, beyond the frozen liquid.
    """

    run: FilledRun
    velocity_m_per_s: FloatArray
    specific_force_m_per_s2: FloatArray


def runs() -> list[FilledRun]:
    """All runs; the half-filled test once more with another seed, which shows what its motion does not decide."""
    found = [FilledRun(fill, motion) for motion in (TRAINING, VALIDATION, TEST) for fill in FILLS]
    return [*found, FilledRun(0.5, TEST, SEED + 1)]


def compute(folder: Path, wanted: Sequence[FilledRun] | None = None) -> dict[FilledRun, ComputedRun]:
    """Compute what is not there yet, and return all.

    Parameters
    ----------
    folder : Path
        One file per run.
    wanted : sequence of FilledRun, optional
        All runs by default.
    """
    listed = runs() if wanted is None else list(wanted)
    found = {run: kept for run in listed if (kept := _kept(folder, run)) is not None}
    left = [run for run in listed if run not in found]
    folder.mkdir(parents=True, exist_ok=True)
    # a fuller tank has more particles, and more neighbours that meet
    costs = [run.motion.duration_s * run.fill_level**1.5 for run in left]
    with progress("fills of the numerical tank", len(left), costs) as done:
        for run in left:
            found[run] = specific_force(run)
            document = {"identity": run.identity, "specific_force": np.round(found[run], _DIGITS).tolist()}
            atomic_file.write_bytes(folder / f"{run.name}.json", json.dumps(document).encode())
            done(run.name)
    return {run: _computed(run, found[run]) for run in listed}


def specific_force(run: FilledRun) -> FloatArray:
    """Δf over m_l, sample k at k/`RATE_HZ`.

    Parameters
    ----------
    run : FilledRun

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    setup = run.setup
    computed = computed_force(setup, run.motion.acceleration_m_per_s2, run.motion.duration_s)
    times = np.arange(computed.vertical_n.size) / RATE_HZ
    # Δf = F_S + m_l ü (2.22)
    return computed.vertical_n / setup.liquid_mass_kg + run.motion.acceleration_m_per_s2(times)


def _computed(run: FilledRun, force: FloatArray) -> ComputedRun:
    times = np.arange(force.size) / RATE_HZ
    return ComputedRun(run, run.motion.velocity_m_per_s(times), force)


def _kept(folder: Path, run: FilledRun) -> FloatArray | None:
    """What an earlier campaign kept of a run; nothing if it is of another run or damaged."""
    try:
        content = json.loads((folder / f"{run.name}.json").read_bytes())
        if content["identity"] != run.identity:
            return None
        return np.array(content["specific_force"], np.float64)
    except (OSError, ValueError, KeyError, TypeError):
        return None
