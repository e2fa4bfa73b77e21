"""What the scaling law disregards, one group at a time, by a liquid with surface tension, walls that hold and gas.

Run as ``python -m studies.tank_scaling.second_liquid --output FILE``; what is in the file already is not computed
again. Other Reynolds and Bond numbers are made in the training tank by other viscosities and tensions, which is
the same as another size with water in it; another proportion is another length at one height.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.tank import Box
from acquisition.two_phase_tank.setup import Fluids, TwoPhaseSetup, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from pipelines.report.style import DISTINCT_COLOURS, drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes
from sloshlab.constants import GRAVITY_M_PER_S2
from studies.steady_state import MeanOverCycles, mean_over_cycles
from studies.tank_scaling.harmonic_runs import RISE_CYCLES, WAITING_CYCLES, Point, cycles_of
from studies.tank_scaling.similarity import FILL_LEVEL, TRAINING_TANK, SimilarTank

CELLS: Final = 16
N_CYCLES: Final = 40
DRAWN_SIZES: Final = (0.2, 1.0, 2.0, 5.0, 25.0)
POINTS: Final = (Point(3.8, 1.0), Point(3.8, 3.0), Point(2.7, 3.0), Point(5.7, 3.0))


@dataclass(frozen=True)
class ScaledShaking:
    """One run.

    Attributes
    ----------
    omega_bar, level_g : float
        ω̄ and amplitude of the acceleration over g.
    reynolds, bond : float
        Factors of Reynolds and Bond number over those of water in the training tank.
    proportion : float
        Length over that of the training tank, at its height.
    seed : int
    cells_per_height : int
    """

    omega_bar: float
    level_g: float
    reynolds: float = 1.0
    bond: float = 1.0
    proportion: float = 1.0
    seed: int = 0
    cells_per_height: int = CELLS

    @property
    def name(self) -> str:
        """One that no other has."""
        return ", ".join(f"{key}={value:g}" for key, value in asdict(self).items())

    def setup(self) -> TwoPhaseSetup:
        """The tank: the gas is as viscous over the liquid as air is over water."""
        water, box = Fluids(density_kg_per_m3=1000.0), TRAINING_TANK
        fluids = replace(
            water,
            viscosity_m2_per_s=water.viscosity_m2_per_s / self.reynolds,
            gas_viscosity_m2_per_s=water.gas_viscosity_m2_per_s / self.reynolds,
            surface_tension_n_per_m=water.surface_tension_n_per_m / self.bond,
        )
        longer = Box(box.length_m * self.proportion, box.height_m, box.depth_m)
        return filled_two_phase_tank(longer, FILL_LEVEL, self.cells_per_height, fluids=fluids, seed=self.seed)


@dataclass(frozen=True)
class Change:
    """What is changed, of all points.

    Attributes
    ----------
    what : str
        As the table names it.
    reynolds, bond, proportion : float
        As of `ScaledShaking`.
    seeds : tuple of int
    cells_per_height : int
    """

    what: str
    reynolds: float = 1.0
    bond: float = 1.0
    proportion: float = 1.0
    seeds: tuple[int, ...] = (0,)
    cells_per_height: int = CELLS

    def runs(self, point: Point) -> list[ScaledShaking]:
        """Return the runs of a point."""
        changed = ScaledShaking(point.omega_bar, point.level_g, self.reynolds, self.bond, self.proportion)
        return [replace(changed, seed=seed, cells_per_height=self.cells_per_height) for seed in self.seeds]


def _larger(size: float) -> Change:
    return Change(f"λ = {size:g}", size**1.5, size**2)


UNCHANGED: Final = Change("training tank", seeds=(0, 1, 2))
CHANGES: Final = (
    *(_larger(size) for size in (0.2, 2.0, 5.0, 25.0)),
    Change("viscosity of λ = 25 alone", 25.0**1.5),
    Change("surface tension of λ = 25 alone", bond=25.0**2),
    Change("viscosity of λ = 0.2 alone", 0.2**1.5),
    Change("surface tension of λ = 0.2 alone", bond=0.2**2),
    Change("half as long", proportion=0.5),
    Change("twice as long", proportion=2.0),
)
WEAK_POINT: Final = Point(3.8, 1.0)
WEAK: Final = tuple(
    Change(f"{what}, h/{cells}", bond=bond, seeds=(0, 1, 2), cells_per_height=cells)
    for cells in (CELLS, 24)
    for what, bond in (("training tank", 1.0), ("surface tension of λ = 25", 25.0**2))
)
"""At the weakest motion alone, where starts scatter most."""


def shaken(run: ScaledShaking) -> dict[str, list[float]]:
    """Return W̄ and β of every cycle that counts.

    Parameters
    ----------
    run : ScaledShaking
    """
    setup = run.setup()
    omega = run.omega_bar / SimilarTank(1.0).time_scale_s
    period, amplitude = 2 * math.pi / omega, run.level_g * GRAVITY_M_PER_S2
    motion = HarmonicMotion(amplitude, omega / (2 * math.pi), rise_s=RISE_CYCLES * period)
    tank = TwoPhaseTank(setup)
    forces = [block.forces.vertical_n for block in moved(tank, motion, N_CYCLES * period, block_s=period)]
    mass_kg = setup.fluid_mass_kg
    dynamic = np.concatenate(forces) + mass_kg * setup.gravity_m_per_s2
    w_bar, beta = cycles_of(dynamic, setup.step_s, omega, amplitude, mass_kg)
    return {"w_bar": w_bar[WAITING_CYCLES:].tolist(), "beta": beta[WAITING_CYCLES:].tolist()}


def mean_of(results: Mapping[str, Mapping[str, Any]], change: Change, point: Point, name: str) -> MeanOverCycles:
    """Mean over the seeds of a change at a point, with the larger of the errors within and between them.

    Parameters
    ----------
    results : mapping
        As in the file.
    change : Change
    point : Point
    name : {'w_bar', 'beta'}
    """
    means = [mean_over_cycles(results[run.name][name]) for run in change.runs(point)]
    values = np.array([mean.value for mean in means])
    within = math.hypot(*(mean.standard_error for mean in means)) / len(means)
    between = float(values.std(ddof=1)) / math.sqrt(values.size) if values.size > 1 else 0.0
    return MeanOverCycles(float(values.mean()), max(within, between))


def rows(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return Markdown tables: W̄ and β of all points, and the changes over all of them.

    Parameters
    ----------
    results : mapping
        As in the file.
    """
    known = [change for change in (UNCHANGED, *CHANGES) if _is_known(results, change)]
    lines = ["| | " + " | ".join(f"{p.omega_bar:g}, {p.level_g:g} g" for p in POINTS) + " |", "|---" * 5 + "|"]
    for name in ("w_bar", "beta"):
        for change in known:
            means = (mean_of(results, change, point, name) for point in POINTS)
            lines.append(f"| {change.what}, {'W̄' if name == 'w_bar' else 'β'} | {' | '.join(map(str, means))} |")
    lines += ["", "| | W̄: mean change | rms | of chance | β: mean change | rms | of chance |", "|---" * 7 + "|"]
    for change in known[1:]:
        told = [
            f"{100 * value:+.0f} %" if k == 0 else f"{100 * value:.0f} %"
            for k, value in enumerate(summary(results, change, "w_bar"))
        ]
        told += [
            f"{value:+.3f}" if k == 0 else f"{value:.3f}"
            for k, value in enumerate(summary(results, change, "beta"))
        ]
        lines.append(f"| {change.what} | {' | '.join(told)} |".replace("-", "−"))
    lines += ["", f"| ω̄ = {WEAK_POINT.omega_bar:g}, {WEAK_POINT.level_g:g} g | W̄ | β |", "|---|---|---|"]
    for change in WEAK:
        if all(run.name in results for run in change.runs(WEAK_POINT)):
            means = (mean_of(results, change, WEAK_POINT, name) for name in ("w_bar", "beta"))
            lines.append(f"| {change.what} | {' | '.join(map(str, means))} |")
    return lines


def all_runs() -> list[ScaledShaking]:
    """Return the runs of all changes, and those of the weakest motion."""
    of_changes = [run for change in (UNCHANGED, *CHANGES) for point in POINTS for run in change.runs(point)]
    return list(dict.fromkeys([*of_changes, *(run for change in WEAK for run in change.runs(WEAK_POINT))]))


def _is_known(results: Mapping[str, Any], change: Change) -> bool:
    return all(run.name in results for point in POINTS for run in change.runs(point))


def summary(results: Mapping[str, Mapping[str, Any]], change: Change, name: str) -> tuple[float, float, float]:
    """Mean and rms over the points of W̄'/W̄ − 1 or of β' − β, and the rms of the errors of these.

    Parameters
    ----------
    results : mapping
        As in the file.
    change : Change
    name : {'w_bar', 'beta'}
    """
    differences, errors = [], []
    for point in POINTS:
        before, after = (mean_of(results, each, point, name) for each in (UNCHANGED, change))
        unit = before.value if name == "w_bar" else 1.0
        differences.append((after.value - before.value) / unit)
        ratio = after.value / before.value if name == "w_bar" else 1.0
        errors.append(math.hypot(after.standard_error, ratio * before.standard_error) / abs(unit))
    rms, chance = (float(np.sqrt(np.mean(np.square(values)))) for values in (differences, errors))
    return float(np.mean(differences)), rms, chance


def figure(results: Mapping[str, Mapping[str, Any]]) -> bytes:
    """W̄ of every point over the size, with both groups and with one of them changed, as PNG.

    Parameters
    ----------
    results : mapping
        As in the file, of all changes.
    """
    by_what = {change.what: change for change in (UNCHANGED, *CHANGES)}
    lines = {
        "both": ("o-", [(size, by_what[f"λ = {size:g}"] if size != 1 else UNCHANGED) for size in DRAWN_SIZES]),
        "surface tension alone": ("s", [(s, by_what[f"surface tension of λ = {s:g} alone"]) for s in (0.2, 25.0)]),
        "viscosity alone": ("^", [(s, by_what[f"viscosity of λ = {s:g} alone"]) for s in (0.2, 25.0)]),
    }
    with drawing_style():
        drawn = new_figure(2.9)
        places = drawn.subplots(1, len(POINTS), sharey=True)
        for axes, point in zip(places, POINTS, strict=True):
            for k, (name, (mark, known)) in enumerate(lines.items()):
                means = [mean_of(results, change, point, "w_bar") for _, change in known]
                sizes = [size * 1.12 ** (k and 2 * k - 3) for size, _ in known]
                errors = [mean.standard_error for mean in means]
                values = [mean.value for mean in means]
                label = name if axes is places[0] else None
                axes.errorbar(sizes, values, errors, fmt=mark, color=DISTINCT_COLOURS[k], capsize=2, label=label)
            axes.set(xscale="log", xlabel="size λ", ylim=(0, 1.1))
            axes.set_xticks(DRAWN_SIZES, [f"{size:g}" for size in DRAWN_SIZES])
            axes.minorticks_off()
            axes.set_title(f"ω̄ = {point.omega_bar:g}, {point.level_g:g} g")
        places[0].set(ylabel="W̄")
        drawn.legend(loc="outside upper center", ncols=3)
        return png_bytes(drawn)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute what is not there yet, and print the tables.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="Tanks in similarity with liquid and gas.")
    parser.add_argument("--output", type=Path, required=True, help="JSON file that keeps the results")
    parser.add_argument("--figure", type=Path, help="picture to be written")
    chosen = parser.parse_args(arguments)
    results = json.loads(chosen.output.read_text()) if chosen.output.exists() else {}
    cases = all_runs()
    for number, case in enumerate(cases):
        if case.name not in results:
            sys.stderr.write(f"{number + 1} of {len(cases)}: {case.name}\n")
            results[case.name] = {"case": asdict(case), **shaken(case)}
            write_bytes(chosen.output, (json.dumps(results) + "\n").encode())
    sys.stdout.write("\n".join(rows(results)) + "\n")
    if chosen.figure is not None:
        write_bytes(chosen.figure, figure(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
