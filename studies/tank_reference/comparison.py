"""Liquids beside each other at the same points, and what each change of the reference does there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import xarray as xr

from studies.measured_facts.laboratory import FACTS, FILLING_LEVEL
from studies.measured_facts.table import Results
from studies.steady_state import MeanOverCycles
from studies.tank_reference.interfoam_case import InterfoamCase
from studies.tank_reference.kept_results import KeptResult
from studies.tank_reference.particle_runs import ParticleCase, ParticleResult, counted
from studies.tank_reference.planned_cases import (
    CHANGES,
    PAIRS,
    REFERENCE_CELLS,
    VARIED_POINTS,
    case_at,
    changed_case,
    cycles_at,
)
from studies.tank_reference.points import BEAM_POINT, BOX, COMMON_POINTS, WATER_DENSITY_KG_PER_M3, DrivenPoint

POINTS: Final = (*COMMON_POINTS, BEAM_POINT)
STIFF_M_PER_S: Final = 20.0
SPREAD_OF_W_BAR: Final = 0.1
"""Share of W̄ within which two liquids agree, as everywhere with facts of the source."""


@dataclass(frozen=True)
class PointValues:
    """W̄ and β of one liquid at one point."""

    w_bar: MeanOverCycles
    beta: MeanOverCycles


Liquid = Mapping[DrivenPoint, PointValues]


def laboratory_w_bar(point: DrivenPoint) -> float:
    """W̄ that the source states at a point; NaN where it states none.

    Parameters
    ----------
    point : DrivenPoint

    Examples
    --------
    >>> laboratory_w_bar(DrivenPoint(4.0, 11.4)), laboratory_w_bar(DrivenPoint(0.5, 11.4))
    (1.65, 0.0)
    """
    for name in ("largest", "beam"):
        numbers = FACTS[name].numbers
        u_bar = numbers["u_bar"] if "u_bar" in numbers else numbers["acceleration_g"] / numbers["omega_bar"] ** 2
        if math.isclose(point.omega_bar, numbers["omega_bar"], rel_tol=0.01) and math.isclose(
            point.u_bar, u_bar, rel_tol=0.02
        ):
            return float(numbers["value"])
    is_quiet = point.acceleration_g < FACTS["threshold"].numbers["value"]
    return float(FACTS["quiet"].numbers["value"]) if is_quiet else math.nan


def interfoam_liquid(
    results: Mapping[InterfoamCase, KeptResult], cells_over_height: int = REFERENCE_CELLS, **changed: Any
) -> dict[DrivenPoint, PointValues]:
    """The reference at the points at which it was computed.

    Parameters
    ----------
    results : mapping
    cells_over_height : int
    **changed
        Of `InterfoamCase`.
    """
    found = {point: results.get(case_at(point, cells_over_height, **changed)) for point in POINTS}
    return {point: values_of(result) for point, result in found.items() if result is not None}


def values_of(result: KeptResult) -> PointValues:
    """W̄ and β of a case."""
    return PointValues(result.counted("w_bar"), result.counted("beta"))


def particle_liquid(
    results: Mapping[ParticleCase, ParticleResult], speed_of_sound_m_per_s: float | None = None
) -> dict[DrivenPoint, PointValues]:
    """The numerical tank of particles at the points at which it was computed.

    Parameters
    ----------
    results : mapping
    speed_of_sound_m_per_s : float, optional
        Another than the usual one.
    """
    found = {}
    for point in POINTS:
        case = ParticleCase(point, cycles_at(point))
        if speed_of_sound_m_per_s is not None:
            case = ParticleCase(point, cycles_at(point), speed_of_sound_m_per_s=speed_of_sound_m_per_s)
        w_bar, beta = (counted(results, case, name) for name in ("w_bar", "beta"))
        if w_bar is not None and beta is not None:
            found[point] = PointValues(w_bar, beta)
    return found


def results_at_points(liquid: Liquid) -> Results:
    """A liquid of single points as facts are evaluated on: one window per point, and no map.

    Parameters
    ----------
    liquid : mapping
    """
    points = list(liquid)
    mass = WATER_DENSITY_KG_PER_M3 * FILLING_LEVEL * BOX.length_m * BOX.height_m * BOX.depth_m
    w_bar = np.array([liquid[point].w_bar.value for point in points])
    speeds = np.array([point.amplitude_m_per_s2 / point.omega_rad_per_s for point in points])
    columns = {
        "run": np.array(["points"] * len(points)),
        "acceleration_g": np.array([point.acceleration_g for point in points]),
        "frequency_hz": np.array([point.frequency_hz for point in points]),
        "omega_bar": np.array([point.omega_bar for point in points]),
        "fill_level": np.full(len(points), FILLING_LEVEL),
        "w_bar": w_bar,
        "beta": np.array([liquid[point].beta.value for point in points]),
        "work_j": w_bar * mass * speeds**2,
    }
    return Results(xr.Dataset({name: ("window", values) for name, values in columns.items()}))


def point_table(liquids: Mapping[str, Liquid], quantity: str) -> Iterator[str]:
    """Yield the lines of a Markdown table: W̄ or β of every liquid at every point.

    Parameters
    ----------
    liquids : mapping
        By their names, in the order of columns.
    quantity : {"w_bar", "beta"}
    """
    is_work = quantity == "w_bar"
    head = ["point", "ω̄", "ū", "W̄: laboratory" if is_work else "β: laboratory", *liquids]
    yield "| " + " | ".join(head) + " |"
    yield "|" + "---|" * len(head)
    for point in POINTS:
        values = [liquid.get(point) for liquid in liquids.values()]
        cells = [point.label, f"{point.omega_bar:.2f}", f"{point.u_bar:.3f}"]
        cells.append(_measured(laboratory_w_bar(point)) if is_work else "< 0")
        cells += ["–" if value is None else str(getattr(value, quantity)) for value in values]
        yield "| " + " | ".join(cells) + " |"


def _measured(w_bar: float) -> str:
    return "–" if math.isnan(w_bar) else "≈ 0" if w_bar == 0 else f"{w_bar:g}"


def account_table(results: Mapping[InterfoamCase, KeptResult]) -> Iterator[str]:
    """Yield the lines of a Markdown table: where the work of the shaker goes in the reference, and its volume.

    Parameters
    ----------
    results : mapping
    """
    yield (
        "| point | solver, cells | W̄ at the walls | W̄ by momentum | resolved viscosity | stored | scheme |"
        " volume | height |"
    )
    yield "|" + "---|" * 9
    kinds = sorted({(case.solver, case.cells_over_height) for case in results})
    for point, (solver, cells) in itertools.product(POINTS, kinds):
        result = results.get(case_at(point, cells, solver=solver))
        if result is not None:
            yield _account_row(point, result)


def _account_row(point: DrivenPoint, result: KeptResult) -> str:
    numbers = (
        result.counted("w_bar").value,
        result.counted("body_force_w_bar").value,
        result.viscous_w_bar,
        result.stored_w_bar,
        result.scheme_w_bar,
    )
    listed = " | ".join(f"{number:.3f}" for number in numbers).replace("-", "−")
    return (
        f"| {point.label} | `{result.case.solver}`, h/{result.case.cells_over_height} | {listed} |"
        f" {100 * result.largest_volume_change:.2g} % | {result.height_over_rest:.2f} |"
    )


def change_table(results: Mapping[InterfoamCase, KeptResult], quantity: str) -> Iterator[str]:
    """Yield the lines of a Markdown table: W̄ or β with every change, alone and in pairs.

    Parameters
    ----------
    results : mapping
    quantity : {"w_bar", "beta"}
    """
    computed = [point for point in VARIED_POINTS if changed_case(point) in results]
    name_of = {"w_bar": "W̄", "beta": "β"}[quantity]
    yield (
        f"| {name_of} of `interFoam`, h/{REFERENCE_CELLS}, with | "
        + " | ".join(point.label for point in computed)
        + " |"
    )
    yield "|" + "---|" * (1 + len(computed))
    for names in ((), *((name,) for name in CHANGES), *PAIRS):
        found = [results.get(changed_case(point, *names)) for point in computed]
        if any(found):
            cells = ["–" if result is None else str(result.counted(quantity)) for result in found]
            yield f"| {', '.join(names) or 'everything'} | " + " | ".join(cells) + " |"
