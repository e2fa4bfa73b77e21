"""W̄ and β of the half-filled tank on the shaker, computed with liquid and gas in three dimensions.

Run as ``python -m studies.two_phase_verification.box_shaken --points first --output FILE``; what is in the file
already is not computed again, and a run that was stopped goes on from its checkpoint beside it.
W̄ and β are the averages of `studies.two_phase_verification.shaken`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, astuple, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.two_phase_box import checkpoint
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_box.simulation import TwoPhaseBox
from acquisition.two_phase_tank.energy import TwoPhaseAccount
from acquisition.two_phase_tank.setup import Fluids, Walls, filled_two_phase_tank
from sloshlab.atomic_file import write_bytes
from studies.two_phase_verification.shaken import (
    CAMPAIGN,
    TANK,
    Shaken,
    Shaking,
    motion_of,
    of_a_cycle,
    rows,
    told,
)

POINTS: Final = {
    "first": (
        Shaking(4.0, 11.4, 24, 12),
        Shaking(2.04, 10.7, 24, 12),
        Shaking(0.5, 11.4, 48, 12),
    ),
    "second": (
        Shaking(4.0, 11.4, 24, 12, seed=1),
        Shaking(2.04, 10.7, 24, 12, seed=1),
        Shaking(0.5, 11.4, 48, 12, seed=1),
    ),
    "finer": (
        Shaking(4.0, 11.4, 24, 16),
        Shaking(2.04, 10.7, 24, 16),
        Shaking(0.5, 11.4, 48, 16),
    ),
    "campaign": tuple(replace(case, cells_per_height=12) for case in CAMPAIGN),
    "weakest": tuple(Shaking(0.25, frequency_hz, 48, 12) for frequency_hz in (8.0, 9.5, 11.0, 12.5, 14.5, 18.0)),
    "fills": tuple(
        Shaking(level_g, frequency_hz, 24, 12, filling_level=filling_level)
        for level_g in (1.5, 3.0)
        for frequency_hz in (9.0, 13.0, 17.0)
        for filling_level in (0.25, 0.5, 0.75)
    ),
}
"""What can be computed, by name."""


def box_of(case: Shaking) -> TwoPhaseBox:
    """Return the whole tank at rest.

    Parameters
    ----------
    case : Shaking
        Without layers of the walls before and behind, which are computed.
    """
    plane = filled_two_phase_tank(
        TANK,
        case.filling_level,
        case.cells_per_height,
        fluids=Fluids(
            surface_tension_n_per_m=case.surface_tension_n_per_m, gas_density_kg_per_m3=case.gas_density_kg_per_m3
        ),
        walls=Walls(hold=case.hold),
        seed=case.seed,
    )
    return TwoPhaseBox(TwoPhaseBoxSetup(plane))


def _begun(case: Shaking, kept: Path | None) -> tuple[TwoPhaseBox, dict[str, NDArray[Any]]]:
    """Return the tank with its forces so far, as it was left where it was left; else at rest."""
    if kept is not None and kept.exists():
        return checkpoint.load_with_extra(kept)
    tank = box_of(case)
    start = {"volume": np.array([tank.liquid_fraction.sum()]), "computing_s": np.zeros(1)}
    return tank, {**start, "before": np.zeros(len(fields(TwoPhaseAccount))), "force_n": np.zeros(0)}


def shaken_box(case: Shaking, kept: Path | None = None) -> Shaken:
    """Shake the whole tank with constant frequency and amplitude.

    Parameters
    ----------
    case : Shaking
    kept : Path, optional
        Checkpoint after every cycle, from which a run that was stopped goes on; removed at the end.
    """
    tank, so_far = _begun(case, kept)
    step_s, period, n_used = tank.setup.step_s, 1 / case.frequency_hz, case.n_cycles // 2
    first = round((case.n_cycles - n_used) * period / step_s)
    in_a_cycle, motion = round(period / step_s), motion_of(case)
    while tank.n_steps < first + n_used * in_a_cycle:
        started_s = time.process_time()
        if tank.n_steps == first:
            so_far["before"] = np.array(astuple(tank.account()))
        n_now = min(in_a_cycle, first - tank.n_steps) if tank.n_steps < first else in_a_cycle
        force_n = tank.advance(motion(tank.times_s(n_now))).vertical_n
        so_far["force_n"] = np.concatenate([so_far["force_n"], force_n])
        so_far["computing_s"] = so_far["computing_s"] + time.process_time() - started_s
        sys.stderr.write(f"  {tank.n_steps / in_a_cycle:.1f} cycles, {so_far['computing_s'][0]:.0f} s\n")
        if kept is not None:
            checkpoint.save(tank, kept, so_far)
    times_s = np.asarray((np.arange(tank.n_steps) + 0.5) * step_s, np.float64)
    used = [slice(first + n * in_a_cycle, first + (n + 1) * in_a_cycle) for n in range(n_used)]
    cycles = [of_a_cycle(tank.setup, case, times_s[part], so_far["force_n"][part]) for part in used]
    change = float(tank.liquid_fraction.sum() / so_far["volume"][0]) - 1
    spent = tank.account() - TwoPhaseAccount(*so_far["before"].tolist())
    result = told(tank.setup, case, cycles, (spent, change, float(so_far["computing_s"][0]) / tank.time_s))
    if kept is not None:
        kept.unlink(missing_ok=True)
    return result


def beside(output: Path, case: Shaking) -> Path:
    """Return where a run of a case is kept until it is done.

    Parameters
    ----------
    output : Path
    case : Shaking
    """
    # another case must not go on from it
    told_case = hashlib.sha256(case.name.encode()).hexdigest()[:12]
    return output.with_name(f"{output.stem}_{told_case}.checkpoint")


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute what is not there yet, and print the table.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(
        description="W̄ and β of the shaken tank of liquid and gas, in three dimensions."
    )
    parser.add_argument("--points", choices=sorted(POINTS), default="first")
    parser.add_argument("--output", type=Path, required=True, help="JSON file that keeps the results")
    chosen = parser.parse_args(arguments)
    cases = POINTS[chosen.points]
    results = json.loads(chosen.output.read_text()) if chosen.output.exists() else {}
    for number, case in enumerate(cases):
        if case.name not in results:
            sys.stderr.write(f"{number + 1} of {len(cases)}: {case.name}\n")
            results[case.name] = {
                "case": asdict(case),
                **asdict(shaken_box(case, beside(chosen.output, case))),
            }
            write_bytes(chosen.output, (json.dumps(results, indent=1) + "\n").encode())
    sys.stdout.write("\n".join(rows(results, cases)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
