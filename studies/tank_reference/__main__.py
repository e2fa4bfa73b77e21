"""``python -m studies.tank_reference FOLDER`` computes what is not there yet, and writes tables and a picture."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pipelines.report.progress import progress
from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from studies.measured_facts.table import Results
from studies.tank_reference.figures import points_figure
from studies.tank_reference.interfoam_case import InterfoamCase
from studies.tank_reference.interfoam_readings import read_case
from studies.tank_reference.interfoam_run import found_program, run_case
from studies.tank_reference.kept_results import KEPT, KeptResult, kept_result, read_results, write_results
from studies.tank_reference.page import shown_liquids, tables
from studies.tank_reference.particle_runs import (
    ParticleCase,
    ParticleResult,
    planned_particle_cases,
    read_particles,
    shaken_particles,
    write_particles,
)
from studies.tank_reference.planned_cases import planned_cases

_RESULTS: Final = "interfoam.json"
_PARTICLES: Final = "particles.json"
_LARGEST_LOG_BYTES: Final = 20_000


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, and write.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(prog="python -m studies.tank_reference", description=__doc__)
    parser.add_argument("folder", type=Path, help="of results; goes on where it was stopped")
    parser.add_argument("--first", type=int, help="only so many cases, those that say most")
    parser.add_argument("--kept", action="store_true", help="compute nothing: tables of the repository's results")
    parser.add_argument("--campaign", type=Path, help="results of make shaker, for the facts of the present tank")
    given = parser.parse_args(arguments)
    try:
        if not given.kept:
            compute(given.folder, planned_cases()[: given.first])
            compute_particles(given.folder, planned_particle_cases()[: given.first])
        write_page(given.folder, KEPT.parent if given.kept else given.folder, given.campaign)
    except SloshlabError as error:
        say(f"tank_reference: {error}", error=True)
        return 1
    return 0


def compute(folder: Path, cases: Sequence[InterfoamCase]) -> dict[InterfoamCase, KeptResult]:
    """Compute the cases that are not there yet, and keep each as soon as it is done.

    Parameters
    ----------
    folder : Path
    cases : sequence of InterfoamCase

    Raises
    ------
    InputError
        If OpenFOAM is not installed, or earlier results are of other inputs.
    SolverError
        If a case stops before its end.
    """
    place = folder / _RESULTS
    results = read_results(place) if place.is_file() else {}
    left = [case for case in cases if case not in results]
    for program in {case.solver for case in left}:
        found_program(program)
    with progress("OpenFOAM's tank", len(left), [case_cost(case) for case in left]) as done:
        for case in left:
            at_work = folder / "case"
            run_case(case, at_work)
            results[case] = kept_result(case, read_case(case, at_work), program_of(case, at_work))
            write_results(results, place)
            done(case.point.label)
    return results


def compute_particles(folder: Path, cases: Sequence[ParticleCase]) -> dict[ParticleCase, ParticleResult]:
    """Compute the cases of the numerical tank that are not there yet, and keep each as soon as it is done.

    Parameters
    ----------
    folder : Path
    cases : sequence of ParticleCase
    """
    place = folder / _PARTICLES
    results = read_particles(place) if place.is_file() else {}
    left = [case for case in cases if case not in results]
    with progress("numerical tank", len(left), [case.n_cycles / case.point.frequency_hz for case in left]) as done:
        for case in left:
            results[case] = shaken_particles(case)
            write_particles(results, place)
            done(case.point.label)
    return results


def write_page(folder: Path, results: Path, campaign: Path | None = None) -> None:
    """Write ``tables.md`` and ``reference_points.png``.

    Parameters
    ----------
    folder : Path
    results : Path
        Folder of both files of results.
    campaign : Path, optional
        Folder of windows and maps of the present tank.
    """
    interfoam, particles = read_results(results / _RESULTS), read_particles(results / _PARTICLES)
    present = None if campaign is None else Results.of_folder(campaign)
    with atomic_file.filled_folder(folder) as complete:
        text = "\n".join(tables(interfoam, particles, present)) + "\n"
        (complete / "tables.md").write_text(text, encoding="utf-8")
        (complete / "reference_points.png").write_bytes(points_figure(shown_liquids(interfoam, particles)))
    say(f"{folder / 'tables.md'}")


def case_cost(case: InterfoamCase) -> float:
    """What a case costs, to a factor: a step has a cost of its own, and grows with cells, whose size limits it."""
    n_along, n_over, n_across = case.cells
    return case.n_cycles * n_over / case.courant_number * (1000 + n_along * n_over * n_across)


def program_of(case: InterfoamCase, folder: Path) -> str:
    """Solver and version, from what it says of itself at the start of its log."""
    with (folder / f"log.{case.solver}").open("rb") as log:
        head = log.read(_LARGEST_LOG_BYTES).decode(errors="replace")
    version = re.search(r"Version:\s*(\w+)|Build\s*:\s*(\S+)", head)
    return f"{case.solver} {next(filter(None, version.groups())) if version else 'of unknown version'}"


if __name__ == "__main__":
    sys.exit(main())
