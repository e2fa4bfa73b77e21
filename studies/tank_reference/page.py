"""The tables of the page, from results that were kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from studies.measured_facts.laboratory import FACTS
from studies.measured_facts.table import Fact, Results, facts
from studies.tank_reference.comparison import (
    STIFF_M_PER_S,
    Liquid,
    account_table,
    change_table,
    interfoam_liquid,
    particle_liquid,
    point_table,
    results_at_points,
    values_of,
)
from studies.tank_reference.diagnosis import misfit_table, verdict, verdict_table
from studies.tank_reference.dry_mass import balance_table, shifted_balance
from studies.tank_reference.interfoam_case import InterfoamCase
from studies.tank_reference.kept_results import KeptResult
from studies.tank_reference.particle_runs import ParticleCase, ParticleResult
from studies.tank_reference.planned_cases import (
    CHANGES,
    FINER_CELLS,
    GEOMETRIC,
    PAIRS,
    VARIED_POINTS,
    changed_case,
)
from studies.tank_reference.second_liquid import second_liquid

PRESENT: Final = "present tank"
ALGEBRAIC: Final = "interFoam"
REFERENCE: Final = "reference"
SECOND: Final = "second liquid"
_MARK: Final = {True: "yes", False: "**no**", None: "–"}


def shown_liquids(
    interfoam: Mapping[InterfoamCase, KeptResult], particles: Mapping[ParticleCase, ParticleResult]
) -> dict[str, Liquid]:
    """Liquids of the picture and of the table of points by their names, without those of no point.

    Parameters
    ----------
    interfoam, particles : mapping
        Kept results.
    """
    liquids: dict[str, Liquid] = {
        PRESENT: particle_liquid(particles),
        GEOMETRIC: interfoam_liquid(interfoam, solver=GEOMETRIC),
        ALGEBRAIC: interfoam_liquid(interfoam),
    }
    liquids[SECOND] = second_liquid()
    liquids |= {f"{ALGEBRAIC}, h/{cells}": interfoam_liquid(interfoam, cells) for cells in FINER_CELLS}
    return {name: liquid for name, liquid in liquids.items() if liquid}


def changes_of_reference(interfoam: Mapping[InterfoamCase, KeptResult]) -> dict[str, Liquid]:
    """The reference with every change, alone and in pairs, and with finer cells.

    Parameters
    ----------
    interfoam : mapping
        Kept results.
    """
    liquids: dict[str, Liquid] = {}
    for names in (*((name,) for name in CHANGES), *PAIRS):
        found = {point: interfoam.get(changed_case(point, *names)) for point in VARIED_POINTS}
        liquids[", ".join(names)] = {
            point: values_of(result) for point, result in found.items() if result is not None
        }
    for cells in FINER_CELLS:
        liquids[f"cells of h/{cells}"] = interfoam_liquid(interfoam, cells)
    return {name: liquid for name, liquid in liquids.items() if liquid}


def changes_of_present(
    interfoam: Mapping[InterfoamCase, KeptResult], particles: Mapping[ParticleCase, ParticleResult]
) -> dict[str, Liquid]:
    """What the present tank could be replaced by: a stiffer liquid, or all that the reference has and it has not.

    Parameters
    ----------
    interfoam, particles : mapping
        Kept results.
    """
    return {
        f"sound of {STIFF_M_PER_S:g} m/s": particle_liquid(particles, STIFF_M_PER_S),
        "gas, surface tension and walls that hold": interfoam_liquid(interfoam),
    }


def fact_table(present: Results | None, liquids: Mapping[str, Liquid]) -> Iterator[str]:
    """Yield the lines of a Markdown table: fact, laboratory, the present tank's campaign, liquids of points.

    Parameters
    ----------
    present : Results or None
        Of the campaign; without, its column is left out.
    liquids : mapping
        By their names.
    """
    columns: dict[str, dict[str, Fact]] = {}
    if present is not None:
        columns[f"{PRESENT}, campaign"] = _by_name(present)
    columns |= {f"{name}, points": _by_name(results_at_points(liquid)) for name, liquid in liquids.items()}
    yield "| fact | half | laboratory | " + " | ".join(columns) + " |"
    yield "|" + "---|" * (3 + len(columns))
    for name, fact in FACTS.items():
        cells = [_said(found[name]) for found in columns.values()]
        yield f"| {fact.what} | {fact.half} | {fact.published} | " + " | ".join(cells) + " |"
    for half in ("chooses", "judges"):
        counts = [_count(found, half) for found in columns.values()]
        yield f"| **met of those computed** | {half} |  | " + " | ".join(counts) + " |"


def _by_name(results: Results) -> dict[str, Fact]:
    return {fact.name: fact for fact in facts(results) if fact.name}


def _said(fact: Fact) -> str:
    return "–" if fact.agrees is None else f"{fact.found}: {_MARK[fact.agrees]}"


def _count(found: Mapping[str, Fact], half: str) -> str:
    known = [fact.agrees for name, fact in found.items() if FACTS[name].half == half and fact.agrees is not None]
    return f"{sum(known)} of {len(known)}"


def tables(
    interfoam: Mapping[InterfoamCase, KeptResult],
    particles: Mapping[ParticleCase, ParticleResult],
    present: Results | None = None,
) -> Iterator[str]:
    """Yield the lines of all tables, an empty one between them.

    Parameters
    ----------
    interfoam, particles : mapping
        Kept results.
    present : Results, optional
        Of the campaign of the present tank.
    """
    shown = shown_liquids(interfoam, particles)
    of_reference, of_present = changes_of_reference(interfoam), changes_of_present(interfoam, particles)
    yield from point_table(shown)
    yield ""
    yield from account_table(interfoam)
    yield ""
    yield from change_table(interfoam)
    yield ""
    named = {f"{REFERENCE}, {name}": liquid for name, liquid in of_reference.items()}
    named |= {f"{PRESENT}, {name}": liquid for name, liquid in of_present.items()}
    yield from misfit_table(shown | named)
    yield ""
    yield from verdict_table(
        {
            PRESENT: verdict(particle_liquid(particles), of_present),
            REFERENCE: verdict(interfoam_liquid(interfoam), of_reference),
        }
    )
    yield ""
    yield from fact_table(present, {name: liquid for name, liquid in shown.items() if name.count("/") < 2})
    if present is not None:
        yield ""
        yield from balance_table(shifted_balance(present))
