"""The tables of the page, from results that were kept."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
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
SECOND: Final = "second liquid"
_HALVES: Final = ("chooses", "judges")
_FACT_CHARACTERS, _PUBLISHED_CHARACTERS, _FIRST_CHARACTERS, _OTHER_CHARACTERS = 29, 17, 26, 14
"""Of cells of the tables of facts, so that no row is longer than 120 characters."""
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
    liquids: dict[str, Liquid] = {f"sound of {STIFF_M_PER_S:g} m/s": particle_liquid(particles, STIFF_M_PER_S)}
    for name, liquid in shown_liquids(interfoam, particles).items():
        if name != PRESENT:
            liquids[f"{name} in its place"] = liquid
    return liquids


def fact_table(half: str, columns: Mapping[str, Results]) -> Iterator[str]:
    """Yield the lines of a Markdown table: the facts of one half, the laboratory, and what liquids say.

    Parameters
    ----------
    half : {"chooses", "judges"}
    columns : mapping
        Liquids by their names.
    """
    found = {name: _by_name(results) for name, results in columns.items()}
    yield f"| fact that {half} | laboratory | " + " | ".join(found) + " |"
    yield "|" + "---|" * (2 + len(found))
    widths = (_FACT_CHARACTERS, _PUBLISHED_CHARACTERS, _FIRST_CHARACTERS, *[_OTHER_CHARACTERS] * (len(found) - 1))
    for name, fact in FACTS.items():
        if fact.half == half:
            yield from _wrapped((fact.what, fact.published, *(_said(of[name]) for of in found.values())), widths)
    yield "| met |  | " + " | ".join(_count(of, half) for of in found.values()) + " |"


def _wrapped(cells: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    """A row whose long cells go on in the rows below, which begin with an ellipsis."""
    columns = [textwrap.wrap(cell, width) or [""] for cell, width in zip(cells, widths, strict=True)]
    for k in range(max(map(len, columns))):
        row = [column[k] if k < len(column) else "" for column in columns]
        yield "| " + " | ".join([("… " if k else "") + row[0], *row[1:]]) + " |"


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
    for quantity in ("w_bar", "beta"):
        yield from point_table(shown, quantity)
        yield ""
    yield from account_table(interfoam)
    yield ""
    for quantity in ("w_bar", "beta"):
        yield from change_table(interfoam, quantity)
        yield ""
    named: dict[str, Liquid] = {
        f"{PRESENT}, sound of {STIFF_M_PER_S:g} m/s": particle_liquid(particles, STIFF_M_PER_S)
    }
    named |= {f"{ALGEBRAIC}, {name}": liquid for name, liquid in of_reference.items()}
    yield from misfit_table(shown | named)
    yield ""
    yield from verdict_table(
        {
            PRESENT: verdict(particle_liquid(particles), of_present),
            ALGEBRAIC: verdict(interfoam_liquid(interfoam), of_reference),
        }
    )
    yield ""
    columns = {name: results_at_points(liquid) for name, liquid in shown.items() if name != ALGEBRAIC}
    if present is not None:
        columns[PRESENT] = present
    for half in _HALVES:
        yield from fact_table(half, columns)
        yield ""
    if present is not None:
        yield from balance_table(shifted_balance(present))
