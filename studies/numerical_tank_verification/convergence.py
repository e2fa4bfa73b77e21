"""How far W̄ and β of a shaken tank depend on how they were computed.

The half-filled tank of the shaker at 11.4 Hz: three spacings at four accelerations, and at 3 g the speed of
sound, the time step, the density diffusion and the packing correction, each with several seeds. Nothing here
decides anything; it says how much a number of the numerical tank is worth.

Run as ``python -m studies.numerical_tank_verification.convergence [--output FILE] [--workers N]``.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2, Box, Liquid, Numerics, filled_tank
from sloshlab.atomic_file import write_bytes

FREQUENCY_HZ: Final = 11.4
N_CYCLES: Final = 80
RISE_CYCLES: Final = 3
TANK: Final = Box(0.1172, 0.0272, 0.078)
SEEDS: Final = (0, 1, 2)


@dataclass(frozen=True)
class ConvergenceCase:
    """One way of computing one motion.

    Attributes
    ----------
    name : str
        What differs from the usual.
    acceleration_g : float
    layers_per_height : int
    speed_of_sound_m_per_s : float
    numerics : dict
        Settings that differ from the defaults of `Numerics`.
    frequency_hz : float
    viscosity_m2_per_s : float
        ν of the liquid.
    n_cycles : int
        The first half is left out.
    """

    name: str
    acceleration_g: float
    layers_per_height: int = 16
    speed_of_sound_m_per_s: float = Liquid().speed_of_sound_m_per_s
    numerics: dict[str, Any] = field(default_factory=dict)
    frequency_hz: float = FREQUENCY_HZ
    viscosity_m2_per_s: float = Liquid().viscosity_m2_per_s
    n_cycles: int = N_CYCLES


CASES: Final = (
    *(
        ConvergenceCase(f"h/{layers}", acceleration, layers)
        for acceleration in (1.5, 3.0, 4.0, 5.5)
        for layers in (12, 16, 24)
    ),
    *(ConvergenceCase(f"c₀ = {speed:g} m/s", 3.0, speed_of_sound_m_per_s=speed) for speed in (10.0, 15.0, 20.0)),
    ConvergenceCase("Δt halved", 3.0, numerics={"courant_number": 0.35}),
    ConvergenceCase("δ = 0.05", 3.0, numerics={"density_diffusion": 0.05}),
    ConvergenceCase("packing correction half as fast", 3.0, numerics={"packing_strength": 0.5}),
    ConvergenceCase("packing correction twice as fast", 3.0, numerics={"packing_strength": 2.0}),
    ConvergenceCase("α = 0.02", 3.0, numerics={"artificial_viscosity": 0.02}),
)


@dataclass(frozen=True)
class HarmonicResult:
    """What one run gave, over the last half of its cycles.

    Attributes
    ----------
    w_bar, beta : float
        Work of the tank on the liquid per cycle over m_l u₀² Ω², and the added-mass coefficient −Re(Δf̌/ǔ̈)/m_l.
    account_w_bar : float
        The same work by the account of energy, in the frame of the tank.
    packing_share, residual_share : float
        Energy taken away by the packing correction, and unaccounted for, over the work.
    """

    w_bar: float
    beta: float
    account_w_bar: float
    packing_share: float
    residual_share: float


def harmonic_result(case: ConvergenceCase, seed: int) -> HarmonicResult:
    """Shake the half-filled tank with constant frequency and amplitude.

    Parameters
    ----------
    case : ConvergenceCase
    seed : int
    """
    liquid = Liquid(viscosity_m2_per_s=case.viscosity_m2_per_s, speed_of_sound_m_per_s=case.speed_of_sound_m_per_s)
    setup = filled_tank(
        TANK, 0.5, case.layers_per_height, liquid=liquid, numerics=Numerics(**case.numerics), seed=seed
    )
    tank, period = NumericalTank(setup), 1 / case.frequency_hz
    motion = HarmonicMotion(
        case.acceleration_g * STANDARD_GRAVITY_M_PER_S2, case.frequency_hz, rise_s=RISE_CYCLES * period
    )
    for _ in moved(tank, motion, case.n_cycles // 2 * period):
        pass
    return measured_cycles(tank, motion, case.n_cycles - case.n_cycles // 2)


def measured_cycles(tank: NumericalTank, motion: HarmonicMotion, n_cycles: int) -> HarmonicResult:
    """Shake a tank on for some cycles, and say what they gave.

    Parameters
    ----------
    tank : NumericalTank
        Goes on from where it is.
    motion : HarmonicMotion
        Its rise is over.
    n_cycles : int
    """
    setup, period = tank.setup, 1 / motion.frequency_hz
    omega = 2 * math.pi * motion.frequency_hz
    before = tank.account()
    blocks = list(moved(tank, motion, n_cycles * period))
    time = np.concatenate([block.time_s for block in blocks])
    force = np.concatenate([block.forces.vertical_n for block in blocks])
    force += setup.liquid_mass_kg * setup.gravity_m_per_s2
    amplitude = motion.amplitude_m_per_s2
    velocity = amplitude / omega * np.sin(omega * time)
    work = -float(np.mean(force * velocity)) * period
    frozen = -setup.liquid_mass_kg * amplitude * np.cos(omega * time)
    in_phase = 2 * float(np.mean((force - frozen) * np.cos(omega * time)))
    spent = tank.account() - before
    unit = setup.liquid_mass_kg * (amplitude / omega) ** 2
    return HarmonicResult(
        work / unit,
        -in_phase / (setup.liquid_mass_kg * amplitude),
        spent.tank_work_j_per_m * setup.box.depth_m / n_cycles / unit,
        spent.packing_j_per_m / spent.tank_work_j_per_m,
        spent.residual_j_per_m / spent.tank_work_j_per_m,
    )


def row(case: ConvergenceCase, results: Sequence[HarmonicResult]) -> str:
    """Return a row of the table: means over the seeds and standard errors of the mean.

    Parameters
    ----------
    case : ConvergenceCase
    results : sequence of HarmonicResult

    Examples
    --------
    >>> two = [HarmonicResult(1.0, -0.2, 1.0, -0.1, 0.0), HarmonicResult(1.2, -0.2, 1.2, -0.1, 0.0)]
    >>> row(ConvergenceCase("h/16", 3.0), two)
    '| 3 g | h/16 | 1.10 ± 0.10 | −0.200 ± 0.000 | −10 % | 0.0 % |'
    """
    values = np.array(
        [[result.w_bar, result.beta, result.packing_share, result.residual_share] for result in results]
    )
    mean = values.mean(axis=0)
    error = values.std(axis=0, ddof=1) / math.sqrt(len(results)) if len(results) > 1 else np.full(4, np.nan)
    text = (
        f"| {case.acceleration_g:g} g | {case.name} | {mean[0]:.2f} ± {error[0]:.2f} |"
        f" {mean[1]:.3f} ± {error[1]:.3f} | {100 * mean[2]:.0f} % | {100 * mean[3]:.1f} % |"
    )
    return text.replace("-", "−")


def table(workers: int, cases: Sequence[ConvergenceCase] = CASES) -> Iterator[str]:
    """Yield the lines of a Markdown table, each as soon as its runs are done.

    Parameters
    ----------
    workers : int
        Processes.
    cases : sequence of ConvergenceCase
    """
    yield "| acceleration | computed with | W̄ | β | packing correction | energy residual |"
    yield "|---|---|---|---|---|---|"
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = [(case, [pool.submit(harmonic_result, case, seed) for seed in SEEDS]) for case in cases]
        for case, jobs in running:
            yield row(case, [job.result() for job in jobs])


def show(lines: Iterable[str], output: Path | None) -> None:
    """Print lines as they come, and write them to a file at the end if one is given.

    Parameters
    ----------
    lines : iterable of str
    output : Path, optional
    """
    shown = []
    for line in lines:
        shown.append(line)
        sys.stdout.write(line + "\n")
        sys.stdout.flush()
    if output:
        write_bytes(output, ("\n".join(shown) + "\n").encode())


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and write it if asked to.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="What W̄ and β of the numerical tank depend on.")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--output", type=Path, help="write the table to this file")
    chosen = parser.parse_args(arguments)
    show(table(max(chosen.workers, 1)), chosen.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
