"""Which cases are computed, those that say most first: a computation that ends early says something, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from studies.tank_reference.interfoam_case import InterfoamCase
from studies.tank_reference.points import BEAM_POINT, COMMON_POINTS, DrivenPoint

REFERENCE_CELLS: Final = 12
"""Over the height: at the common points, and where one thing or two are changed."""
FINER_CELLS: Final = (16, 24)
VIOLENT_CYCLES: Final = 24
WEAK_CYCLES: Final = 48
"""A subharmonic wave needs twenty or more to grow."""
_WEAK_G: Final = 1.0

VARIED_POINTS: Final = (
    DrivenPoint(4.0, 11.4),
    BEAM_POINT,
    DrivenPoint(0.5, 11.4),
    DrivenPoint(6.0, 18.0),
)
"""At the measured maximum, where the beam works, below the measured threshold, at the numerical tank's maximum."""

GEOMETRIC: Final = "interIsoFoam"
"""Volume of fluid with an interface that is reconstructed in every cell, in place of one that is compressed."""
_STRONGEST: Final = DrivenPoint(4.0, 11.4)

CHANGES: Final[Mapping[str, Mapping[str, Any]]] = {
    "another start": {"seed": 1},
    "no surface tension": {"surface_tension_n_per_m": 0.0},
    "walls slip": {"walls": "slip"},
    "gas a tenth as dense": {"gas_density_kg_per_m3": 0.12},
    "geometric interface": {"solver": GEOMETRIC},
    "contact angle 60°": {"contact_angle_deg": 60.0},
    "steps half as long": {"courant_number": 0.25},
}
"""What is left out or altered, one at a time; another start leaves nothing out and shows what chance does."""
MAIN_CHANGES: Final = tuple(CHANGES)[:5]
PAIRS: Final = (
    ("no surface tension", "walls slip"),
    ("no surface tension", "gas a tenth as dense"),
    ("walls slip", "gas a tenth as dense"),
)


def case_at(point: DrivenPoint, cells_over_height: int, **changed: Any) -> InterfoamCase:
    """A case of as many cycles as its point needs.

    Parameters
    ----------
    point : DrivenPoint
    cells_over_height : int
    **changed
        Of `InterfoamCase`.
    """
    return replace(InterfoamCase(point, cells_over_height, cycles_at(point)), **changed)


def cycles_at(point: DrivenPoint) -> int:
    """Cycles that a point needs, in all.

    Parameters
    ----------
    point : DrivenPoint
    """
    return WEAK_CYCLES if point.acceleration_g <= _WEAK_G else VIOLENT_CYCLES


def changed_case(point: DrivenPoint, *names: str) -> InterfoamCase:
    """A case with some of the `CHANGES`; without any, what they are compared with.

    Parameters
    ----------
    point : DrivenPoint
    *names : str
    """
    changes: dict[str, Any] = {}
    for name in names:
        changes |= CHANGES[name]
    return case_at(point, REFERENCE_CELLS, **changes)


SOLID_CASE: Final = case_at(_STRONGEST, REFERENCE_CELLS, dimensions=3, n_cycles=12)
"""In three dimensions, as many cells across as the size of the others asks for."""


def planned_cases() -> list[InterfoamCase]:
    """All cases, without those of the same kind twice."""
    points = (BEAM_POINT, *COMMON_POINTS)
    strong_first = sorted(points, key=lambda point: point.acceleration_g <= _WEAK_G)
    cases = [case_at(point, REFERENCE_CELLS) for point in (_STRONGEST, *strong_first)]
    cases += [case_at(_STRONGEST, cells) for cells in FINER_CELLS]
    cases.append(case_at(VARIED_POINTS[3], REFERENCE_CELLS, solver=GEOMETRIC))
    cases += [changed_case(point, name) for point in VARIED_POINTS[:3] for name in MAIN_CHANGES]
    cases += [case_at(point, REFERENCE_CELLS, solver=GEOMETRIC) for point in points]
    cases.append(case_at(_STRONGEST, FINER_CELLS[0], solver=GEOMETRIC))
    cases += [changed_case(_STRONGEST, *pair) for pair in PAIRS]
    cases += [changed_case(point, name) for point in VARIED_POINTS for name in CHANGES]
    cases += [case_at(point, FINER_CELLS[0]) for point in VARIED_POINTS]
    cases.append(SOLID_CASE)
    cases += [changed_case(point, *pair) for point in VARIED_POINTS for pair in PAIRS]
    return list(dict.fromkeys(cases))
