"""A look-alike of a liquid that follows the tank less: a dry mass taken too large in the balance of forces.

Δf = (M_dry + m_l) ü − F_ext, so that ε too much in M_dry lowers every β by ε/m_l, whatever the liquid does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from studies.measured_facts.laboratory import FACTS, WEAKEST_G
from studies.measured_facts.table import Fact, Results, facts


@dataclass(frozen=True)
class ShiftedBalance:
    """What a shift of every β does to the facts.

    Attributes
    ----------
    shift : float
        Of β; chosen so that the mean at the weakest level is the source's.
    before, after : Fact
        β < 0, which chose nothing.
    """

    shift: float
    before: Fact
    after: Fact


def shifted_balance(results: Results) -> ShiftedBalance:
    """Shift every β so that one fact is met, and judge the other by it.

    Parameters
    ----------
    results : Results
        Of a campaign that reaches the weakest level.
    """
    weakest = results.level(WEAKEST_G, band=(0.0, float("inf"))).beta
    shift = float(FACTS["weakest"].numbers["value"] - weakest.mean())
    shifted = replace(results, windows=results.windows.assign(beta=results.windows.beta + shift))
    return ShiftedBalance(shift, _judging(results), _judging(shifted))


def _judging(results: Results) -> Fact:
    return next(fact for fact in facts(results) if fact.name == "effective_mass")


def balance_table(found: ShiftedBalance) -> Iterator[str]:
    """Yield the lines of a Markdown table.

    Parameters
    ----------
    found : ShiftedBalance
    """
    yield f"| β < 0 | as computed | every β shifted by {found.shift:.3f} |".replace("-", "−")
    yield "|---|---|---|"
    yield f"| everywhere | {found.before.found} | {found.after.found} |"
