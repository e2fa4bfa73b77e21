"""All numbers of the study, from computed runs and from recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from pipelines.report.progress import progress
from studies.small_motion.campaign import compute
from studies.small_motion.errors import (
    Judged,
    by_amplitude,
    by_history,
    carried_stages,
    crossing_ratio,
    estimated,
    gains,
    joined,
    offset_errors,
    relative_error,
    share_without_crossing,
    step_at_g,
)
from studies.small_motion.motion import CARRIED, RANDOM_TESTS, RANDOM_VALIDATION
from studies.small_motion.networks import CANDIDATES, SEEDS, Candidate, Workshop
from studies.small_motion.recorded import CANDIDATES as RECORDED
from studies.small_motion.recorded import IN_TWIN, RecordedWorkshop, closed_loop

SIGNALS: Final = ("velocity", "acceleration")
SMALL_G: Final = 1.0
"""Below it the error of the random validation run chooses between candidates."""


def computed_results(folder: Path) -> dict[str, Any]:
    """Errors of all candidates in the computed motions of liquid and gas.

    Parameters
    ----------
    folder : Path
        With its folders of runs and networks.
    """
    workshop = Workshop(folder / "networks", compute(folder / "runs", "two_phase"), "two_phase")
    found, reference = dict[str, Any](), None
    with progress("networks of computed runs", len(CANDIDATES)) as done:
        for candidate in CANDIDATES:
            random = _in_random_motion(workshop, candidate)
            # the first one is the source's
            reference = reference or random
            found[candidate.name] = _of_candidate(workshop, candidate, random, reference)
            done(candidate.name)
    return found


def _in_random_motion(workshop: Workshop, candidate: Candidate) -> list[Judged]:
    networks = [workshop.predictor(candidate, seed) for seed in SEEDS]
    tests = [[workshop.of(motion, seed) for seed in (0, 1)] for motion in RANDOM_TESTS]
    return [Judged.of(truths, networks) for truths in tests]


def _of_candidate(
    workshop: Workshop, candidate: Candidate, random: list[Judged], reference: list[Judged]
) -> dict[str, Any]:
    networks = [workshop.predictor(candidate, seed) for seed in SEEDS]
    validation = Judged.of([workshop.of(RANDOM_VALIDATION)], networks)
    carried = [workshop.of(CARRIED, seed) for seed in (0, 1)]
    return {
        "choice": estimated(validation.sums(validation.amplitude_g < SMALL_G), relative_error).as_list(),
        "random": by_amplitude(random),
        "all": estimated(joined([run.sums(run.counts) for run in random]), relative_error).as_list(),
        "gain": gains(random, reference),
        "step": step_at_g(random).as_list(),
        "undecided step": step_at_g(random, "undecided").as_list(),
        "history": by_history(random),
        **_crossings(random),
        "undecided": {signal: crossing_ratio(random, signal, "undecided").as_list() for signal in SIGNALS},
        "carried": carried_stages(Judged.of(carried, networks)),
        "offset": offset_errors(carried, networks),
    }


def _crossings(runs: list[Judged]) -> dict[str, Any]:
    return {
        "share": {signal: round(share_without_crossing(runs, signal), 4) for signal in SIGNALS},
        "crossing": {signal: crossing_ratio(runs, signal).as_list() for signal in SIGNALS},
        "force": {signal: crossing_ratio(runs, signal, "force").as_list() for signal in SIGNALS},
    }


def recorded_results(folder: Path, raw: Path) -> dict[str, Any]:
    """Errors on the recordings, force by force and in closed loop.

    Parameters
    ----------
    folder : Path
        With its folder of networks.
    raw : Path
        raw_data/numerical_tank.
    """
    workshop = RecordedWorkshop(folder / "networks", raw)
    found, reference = dict[str, Any](), None
    carried = list(compute(folder / "runs", "particles").values())
    for candidate in RECORDED:
        runs, networks = workshop.judged(candidate), [workshop.predictor(candidate, seed) for seed in SEEDS]
        reference = reference or runs
        found[candidate.name] = {
            "random": by_amplitude(runs),
            "gain": gains(runs, reference),
            "carried": carried_stages(Judged.of(carried, networks)),
            "offset": offset_errors(carried, networks),
            "step": step_at_g(runs).as_list(),
            "history": by_history(runs),
            **_crossings(runs),
        }
    return {"force": found, "closed loop": closed_loop(workshop, IN_TWIN)}


def all_results(folder: Path, raw: Path) -> dict[str, Any]:
    """Everything that tables and pictures show."""
    return {"two_phase": computed_results(folder), "recorded": recorded_results(folder, raw)}
