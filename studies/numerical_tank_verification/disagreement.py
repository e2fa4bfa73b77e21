"""Why the numerical tank and the measured one differ: one cause at a time, by experiment.

Four differences are looked into, each where it is largest, by changing what could cause it: the viscosity of
the liquid, the resolution and the speed of sound. (Walls slip here; the boundary layers of the real tank damp
a wave of 5.7 Hz three times as much as the viscosity inside it (Keulegan 1959), so ten times the viscosity is
more than they can do.) What cannot be changed here, because the
method does not have it, is surface tension, the third dimension and the gas. A fifth experiment asks whether
work depends on where the tank comes from: the acceleration goes up and down again in steps.

Run as ``python -m studies.numerical_tank_verification.disagreement [--output FILE] [--workers N]``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2, filled_tank
from studies.numerical_tank_verification.convergence import (
    FREQUENCY_HZ,
    SEEDS,
    TANK,
    ConvergenceCase,
    measured_cycles,
    show,
    table,
)

_WEAK_CYCLES = 200
"""A subharmonic wave needs twenty to sixty cycles to grow."""


def _weak(acceleration_g: float, *viscosity_factors: int) -> tuple[ConvergenceCase, ...]:
    """Below the measured threshold."""
    return (
        ConvergenceCase("11.4 Hz, h/16", acceleration_g, n_cycles=_WEAK_CYCLES),
        ConvergenceCase("11.4 Hz, h/24", acceleration_g, 24, n_cycles=_WEAK_CYCLES),
        *(
            ConvergenceCase(
                f"11.4 Hz, ν × {factor}", acceleration_g, viscosity_m2_per_s=factor * 1e-6, n_cycles=_WEAK_CYCLES
            )
            for factor in viscosity_factors
        ),
    )


_BEAM: Final = tuple(
    ConvergenceCase(f"10.7 Hz, h/{layers}", 2.04, layers, frequency_hz=10.7) for layers in (12, 16, 24)
)
_FAST: Final = (
    *(ConvergenceCase(f"17.7 Hz, h/{layers}", 6.0, layers, frequency_hz=17.7) for layers in (12, 16, 24)),
    ConvergenceCase("17.7 Hz, c₀ = 20 m/s", 6.0, speed_of_sound_m_per_s=20.0, frequency_hz=17.7),
    ConvergenceCase("17.7 Hz, ν × 100", 6.0, viscosity_m2_per_s=1e-4, frequency_hz=17.7),
)
_SLOW: Final = (
    *(ConvergenceCase(f"8.5 Hz, h/{layers}", 3.5, layers, frequency_hz=8.5) for layers in (12, 16, 24)),
    ConvergenceCase("8.5 Hz, c₀ = 20 m/s", 3.5, speed_of_sound_m_per_s=20.0, frequency_hz=8.5),
)
CASES: Final = (*_weak(0.5, 10, 100), *_BEAM, *_FAST, *_SLOW)

LEVELS_G: Final = (0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5)
CYCLES_PER_LEVEL: Final = 50


@dataclass(frozen=True)
class LevelResult:
    """W̄ on the way up and on the way down, at one acceleration.

    Attributes
    ----------
    acceleration_g, up, down : float
    """

    acceleration_g: float
    up: float
    down: float


def up_and_down(
    seed: int, *, levels_g: Sequence[float] = LEVELS_G, n_cycles: int = CYCLES_PER_LEVEL, layers: int = 16
) -> list[LevelResult]:
    """Shake one tank at rising, then at falling accelerations, without a pause between them.

    Parameters
    ----------
    seed : int
    levels_g : sequence of float
        Rising; the last is passed once.
    n_cycles : int
        At every level; the last half of them counts.
    layers : int
        Of particles along the height of the box.
    """
    tank = NumericalTank(filled_tank(TANK, 0.5, layers, seed=seed))
    works = [_work_at(tank, level_g, n_cycles) for level_g in (*levels_g, *levels_g[-2::-1])]
    up, down = works[: len(levels_g)], works[len(levels_g) - 1 :][::-1]
    return [LevelResult(*values) for values in zip(levels_g, up, down, strict=True)]


def _work_at(tank: NumericalTank, level_g: float, n_cycles: int) -> float:
    motion = HarmonicMotion(level_g * STANDARD_GRAVITY_M_PER_S2, FREQUENCY_HZ)
    for _ in moved(tank, motion, (n_cycles - n_cycles // 2) / FREQUENCY_HZ):
        pass
    return measured_cycles(tank, motion, n_cycles // 2).w_bar


def history_table(workers: int) -> Iterator[str]:
    """Yield the lines of a Markdown table of W̄ on the way up and down, means over the seeds.

    Parameters
    ----------
    workers : int
        Processes.
    """
    yield "| acceleration | W̄ on the way up | W̄ on the way down |"
    yield "|---|---|---|"
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        runs = list(pool.map(up_and_down, SEEDS))
    for at_level in zip(*runs, strict=True):
        up = sum(level.up for level in at_level) / len(at_level)
        down = sum(level.down for level in at_level) / len(at_level)
        yield f"| {at_level[0].acceleration_g:g} g | {up:.2f} | {down:.2f} |".replace("-", "−")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables, and write them if asked to.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="Why the numerical tank and the measured one differ.")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--output", type=Path, help="write the tables to this file")
    chosen = parser.parse_args(arguments)
    workers = max(chosen.workers, 1)
    show(chain(history_table(workers), [""], table(workers, CASES)), chosen.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
