"""The beam of the source let go from 14.6 mm, its tank computed with liquid and gas.

Run as ``python -m studies.two_phase_verification.release --output FILE``; what is in the file already is not
computed again. Works are those of the liquid in each of the first cycles. With ``--figure FILE.png`` they are
drawn beside those of the recorded decays of particles in ``raw_data/numerical_tank``.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.carried_tank import StructureHistory
from acquisition.two_phase_tank.coupling import CoupledTwoPhaseTank
from acquisition.virtual_laboratory.numerical_liquid import two_phase_setup
from acquisition.virtual_laboratory.numerical_runs import BEAM_RIG, RIG_TEXTS
from acquisition.virtual_laboratory.structure_rig import StructureLaboratory, structure_rig
from pipelines.report.style import DISTINCT_COLOURS, drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes
from sloshlab.rig import Rig
from sloshlab.sweep.transient_cycles import upward_crossings_s
from studies.beyond_the_source.memory import measured_works
from studies.beyond_the_source.models import RATE_HZ as RATE_OF_MODELS_HZ
from studies.beyond_the_source.recordings import Recordings

FIRST_CYCLES: Final = 8
RATE_HZ: Final = 1024.0
STEP_S: Final = 0.25e-3
DURATION_S: Final = 0.95
"""The first cycles, which sloshing makes a little longer than 1/10.87 Hz."""


@dataclass(frozen=True)
class Release:
    """One release, and how it is computed.

    Attributes
    ----------
    cells_per_height : int
    seed : int
        Of the disturbance at the start.
    longest_step_s : float
    deflection_m : float
        Downward.
    """

    cells_per_height: int
    seed: int = 0
    longest_step_s: float = STEP_S
    deflection_m: float = 0.0146

    @property
    def name(self) -> str:
        """One that no other has."""
        return ", ".join(f"{key}={value:g}" for key, value in asdict(self).items())


CASES: Final = (
    *(Release(16, seed) for seed in (0, 1, 2)),
    *(Release(16, seed, 0.5 * STEP_S) for seed in (0, 1, 2)),
    *(Release(24, seed) for seed in (0, 1, 2)),
)


@dataclass(frozen=True)
class Released:
    """What one release gave.

    Attributes
    ----------
    works_j : list of float
        That the liquid took in each of the first cycles.
    stored_at_start_j : float
        In the bent beam.
    structure_residual_j, fluids_residual_j : float
        What the accounts of structure and fluids do not explain.
    between_j : float
        What the structure gave, less what the fluids took: their energy beside the tank at rest and their losses.
    lag_m_per_s : float
        Of the tank that the fluids feel, behind that of the structure, at the end.
    computing_s_per_s : float
        Seconds of one processor for a second of the beam.
    """

    works_j: list[float]
    stored_at_start_j: float
    structure_residual_j: float
    fluids_residual_j: float
    between_j: float
    lag_m_per_s: float
    computing_s_per_s: float


def released(case: Release) -> Released:
    """Let the beam go and follow its first cycles.

    Parameters
    ----------
    case : Release
    """
    rig = Rig.from_toml_text(RIG_TEXTS[BEAM_RIG])
    setup = two_phase_setup(
        rig,
        cells_per_height=case.cells_per_height,
        seed=case.seed,
        sampling_rate_hz=RATE_HZ,
        longest_step_s=case.longest_step_s,
    )
    tank = CoupledTwoPhaseTank(setup, structure_rig(rig, StructureLaboratory.perfect(rig)).structure)
    tank.deflect(-case.deflection_m)
    started_s, stiffness = time.process_time(), np.array([mode.stiffness_n_per_m for mode in tank.structure.modes])
    bent_m = tank.structure.deflected(-case.deflection_m)
    history = tank.advance(np.zeros(round(DURATION_S / setup.step_s)))
    computing_s_per_s = (time.process_time() - started_s) / tank.time_s
    beside, fluids, depth_m = tank.account(), tank.tank.account(), setup.box.depth_m
    return Released(
        list(first_works_j(history, setup.step_s)),
        float(0.5 * stiffness @ bent_m**2),
        beside.residual_j,
        fluids.residual_j_per_m * depth_m,
        -beside.handed_over_j - _taken_j(tank),
        float(tank.structure_arrays()["structure_carried"][-1]),
        computing_s_per_s,
    )


def _taken_j(tank: CoupledTwoPhaseTank) -> float:
    """What the moving tank gave the fluids: v P + ½ m v² and the work of inertia in the frame of the tank [J]."""
    setup, inner = tank.tank.setup, tank.tank
    c, w, (dx, dz), fluids = inner.liquid_fraction, inner.velocities()[1], setup.cell_m, setup.fluids
    density = fluids.gas_density_kg_per_m3 * (1 - c) + fluids.density_kg_per_m3 * c
    momentum = float((density * 0.5 * (w[:, 1:] + w[:, :-1])).sum()) * dx * dz * setup.box.depth_m
    v = tank.tank_velocity_m_per_s
    work_j = inner.account().tank_work_j_per_m * setup.box.depth_m
    return float(v * momentum + 0.5 * setup.fluid_mass_kg * v**2 + work_j)


def first_works_j(history: StructureHistory, step_s: float) -> NDArray[np.float64]:
    """Return the work that the liquid takes in each of the first cycles of the first mode [J].

    Parameters
    ----------
    history : StructureHistory
        From a release downward on.
    step_s : float
    """
    # of the first mode: the others make the tank's velocity cross zero several times at the release
    first_mode = history.modal_velocity_m_per_s[:, 0]
    ends = upward_crossings_s(first_mode, 1 / step_s, 0.0)[: FIRST_CYCLES + 1]
    taken = -history.liquid_force_n * history.tank_velocity_m_per_s * step_s
    # forces and velocities belong to the middle of a step, sums of them to its end
    edges = (np.arange(taken.size + 1) - 0.5) * step_s
    return np.asarray(np.diff(np.interp(ends, edges, np.concatenate([[0.0], np.cumsum(taken)]))))


def rows(results: dict[str, dict[str, Any]], cases: Sequence[Release] = CASES) -> list[str]:
    """Return Markdown tables of what has been computed: works of the cycles, then the accounts.

    Parameters
    ----------
    results : dict
        As in the file.
    cases : sequence of Release
        Those that differ in their seed only make one row.
    """
    groups: dict[tuple[int, float], list[dict[str, Any]]] = {}
    for case in cases:
        if (found := results.get(case.name)) is not None:
            groups.setdefault((case.cells_per_height, case.longest_step_s), []).append(found)
    lines = ["| cells | longest step | " + " | ".join(str(n + 1) for n in range(FIRST_CYCLES)) + " |"]
    lines.append("|---" * (FIRST_CYCLES + 2) + "|")
    for (cells, step_s), group in groups.items():
        works = 1e3 * np.array([found["works_j"] for found in group])
        scatter = works.std(axis=0, ddof=1) if len(group) > 1 else np.full(FIRST_CYCLES, math.nan)
        told = [f"{mean:.1f} ± {std:.1f}" for mean, std in zip(works.mean(axis=0), scatter, strict=True)]
        lines.append(f"| {cells} | {1e3 * step_s:g} ms | {' | '.join(told)} |".replace("-", "−"))
    lines += ["", "| cells | longest step | structure | between | fluids | s/s |", "|---|---|---|---|---|---|"]
    for (cells, step_s), group in groups.items():
        parts = [
            max(abs(found[name] / found["stored_at_start_j"]) for found in group)
            for name in ("structure_residual_j", "between_j", "fluids_residual_j")
        ]
        speed = np.mean([found["computing_s_per_s"] for found in group])
        told = [f"{100 * part:.1g} %" for part in parts]
        lines.append(f"| {cells} | {1e3 * step_s:g} ms | {' | '.join(told)} | {speed:.0f} |")
    return lines


def particles_works_j(folder: Path) -> NDArray[np.float64]:
    """Return the work of the first cycles of the recorded decays [J], shape (n_repeats, n_cycles).

    Parameters
    ----------
    folder : Path
        ``raw_data/numerical_tank``.
    """
    decays = Recordings(folder, RATE_OF_MODELS_HZ).decays(14.6)
    return np.array([measured_works(decay)[:FIRST_CYCLES] for decay in decays])


def figure(results: dict[str, dict[str, Any]], particles_j: NDArray[np.float64]) -> bytes:
    """Work of the first cycles of both liquids, with the scatter of their starts, as PNG.

    Parameters
    ----------
    results : dict
        As in the file.
    particles_j : ndarray, shape (n_repeats, n_cycles)
    """
    shown = {"particles, h/16": particles_j}
    for cells in (16, 24):
        cases = [case for case in CASES if (case.cells_per_height, case.longest_step_s) == (cells, STEP_S)]
        shown[f"liquid and gas, h/{cells}"] = np.array([results[case.name]["works_j"] for case in cases])
    with drawing_style():
        drawn = new_figure(2.8)
        axes = drawn.subplots()
        for k, (name, works) in enumerate(shown.items()):
            cycles = np.arange(1, works.shape[1] + 1) + 0.08 * (k - 1)
            scatter = 1e3 * works.std(axis=0, ddof=1)
            means = 1e3 * works.mean(axis=0)
            axes.errorbar(cycles, means, scatter, fmt="o-", color=DISTINCT_COLOURS[k], capsize=2, label=name)
        axes.set(xlabel="cycle after the release", ylabel="work of the liquid [mJ]", ylim=(0, None))
        axes.set_xticks(np.arange(1, FIRST_CYCLES + 1))
        drawn.legend(loc="outside upper center", ncols=3)
        return png_bytes(drawn)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute what is not there yet, and print the tables.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="The released beam with a tank of liquid and gas.")
    parser.add_argument("--output", type=Path, required=True, help="JSON file that keeps the results")
    parser.add_argument("--figure", type=Path, help="picture to be written")
    parser.add_argument("--particles", type=Path, default=Path("raw_data/numerical_tank"))
    chosen = parser.parse_args(arguments)
    results = json.loads(chosen.output.read_text()) if chosen.output.exists() else {}
    for number, case in enumerate(CASES):
        if case.name not in results:
            sys.stderr.write(f"{number + 1} of {len(CASES)}: {case.name}\n")
            results[case.name] = {"case": asdict(case), **asdict(released(case))}
            write_bytes(chosen.output, (json.dumps(results, indent=1) + "\n").encode())
    sys.stdout.write("\n".join(rows(results)) + "\n")
    if chosen.figure is not None:
        write_bytes(chosen.figure, figure(results, particles_works_j(chosen.particles)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
