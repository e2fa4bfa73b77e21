"""Effects left out of the tank of liquid and gas, one by one and in pairs.

Computed by ``python -m studies.two_phase_verification.effects_tables --most-seconds N --output FILE``;
what is in the file already is not computed again.
"""

from __future__ import annotations

import itertools
import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from sloshlab.atomic_file import write_bytes
from studies.tank_reference.points import BEAM_POINT, DrivenPoint
from studies.two_phase_verification.shaken import Shaking, shaken

KEPT: Final = Path(__file__).with_name("effects.json")
N_STARTS: Final = 3
MEASURED_POINTS: Final = (DrivenPoint(0.5, 11.4), DrivenPoint(4.0, 11.4), BEAM_POINT)
"""Where the laboratory tells W̄: two that may choose, one that only judges."""

EFFECTS: Final[Mapping[str, Callable[[Shaking], Shaking]]] = {
    "σ = 0": lambda case: replace(case, surface_tension_n_per_m=0.0),
    "walls slip": lambda case: replace(case, hold=False),
    "line free": lambda case: replace(case, advancing_angle_deg=175.0, receding_angle_deg=5.0),
    "light gas": lambda case: replace(case, gas_density_kg_per_m3=0.12),
    "side walls": lambda case: replace(case, layer_frequency_hz=case.frequency_hz / 2),
    "h/24": lambda case: replace(case, cells_per_height=24),
    "line sticks": lambda case: replace(case, advancing_angle_deg=80.0, receding_angle_deg=50.0, line_sticks=True),
}
"""What is changed of the liquid as it is, h/16, 90°, by short names for tables; the last three add what it lacks.

*Line free*: the walls do nothing to the angle of the interface. *Line sticks*: between 80° and 50°, assumed.
*Light gas*: a tenth of air's density. *Side walls*: layers of the walls before and behind the plane.
"""
WITHOUT_MEANING: Final = frozenset(
    {
        ("σ = 0", "line free"),
        ("σ = 0", "line sticks"),
        ("line free", "line sticks"),
    }
)
"""A contact line acts by surface tension alone, and does one thing or the other."""

Names = tuple[str, ...]

LONG_CYCLES: Final = 100
FOLLOWED_LONGER: Final[tuple[Names, ...]] = (
    (),
    ("line sticks",),
    ("σ = 0", "h/24"),
    ("h/24", "line sticks"),
)
"""Computed again at the weakest motion, where 48 cycles may be too few for a wave that is held or slowly beats."""


def combinations() -> list[Names]:
    """Names of the effects of every computation: none, one, two."""
    pairs = [pair for pair in itertools.combinations(EFFECTS, 2) if pair not in WITHOUT_MEANING]
    return [(), *((name,) for name in EFFECTS), *pairs]


def case_of(point: DrivenPoint, names: Names, seed: int, n_cycles: int | None = None) -> Shaking:
    """The computation of a point with effects changed.

    Parameters
    ----------
    point : DrivenPoint
    names : tuple of str
        Of `EFFECTS`.
    seed : int
        Of the start.
    n_cycles : int, optional
        By default 24, and 48 up to 1 g.
    """
    usual = 48 if point.acceleration_g <= 1.0 else 24
    case = Shaking(point.acceleration_g, point.frequency_hz, n_cycles or usual, 16, seed=seed)
    for name in names:
        case = EFFECTS[name](case)
    return case


def planned() -> list[Shaking]:
    """All cases, start by start, so that what is stopped has whole starts of everything."""
    starts = range(N_STARTS)
    longer = [
        case_of(MEASURED_POINTS[0], names, seed, LONG_CYCLES) for names in FOLLOWED_LONGER for seed in starts
    ]
    usual = [
        case_of(point, names, seed) for seed in starts for names in combinations() for point in MEASURED_POINTS
    ]
    return longer + usual


def compute(results: dict[str, dict[str, Any]], output: Path, most_s: float) -> None:
    """Compute what is not there yet, keeping every result at once.

    Parameters
    ----------
    results : dict
        By names of cases; added to.
    output : Path
    most_s : float
        No case is begun after so many seconds.
    """
    cases, begun_s = planned(), time.monotonic()
    for number, case in enumerate(cases):
        if case.name in results:
            continue
        if time.monotonic() - begun_s > most_s:
            break
        sys.stderr.write(f"{number + 1} of {len(cases)}: {case.name}\n")
        results[case.name] = {"case": asdict(case), **asdict(shaken(case))}
        write_bytes(output, (json.dumps(results, indent=1) + "\n").encode())
