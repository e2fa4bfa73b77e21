"""What effects left out one by one and in pairs do to W̄ and β: means over starts, tables, the verdict.

``python -m studies.two_phase_verification.effects_tables`` prints what is kept, or computes it anew.
The verdict is that of `studies.tank_reference.diagnosis`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from studies.steady_state import MeanOverCycles
from studies.tank_reference.comparison import SPREAD_OF_W_BAR, Liquid, PointValues, laboratory_w_bar
from studies.tank_reference.diagnosis import CHANCE, CHOOSING, JUDGING, Misfit, Verdict, misfit, verdict
from studies.tank_reference.points import DrivenPoint
from studies.two_phase_verification.effects import (
    FOLLOWED_LONGER,
    KEPT,
    LONG_CYCLES,
    MEASURED_POINTS,
    N_STARTS,
    Names,
    case_of,
    combinations,
    compute,
)

Kept = Mapping[str, Mapping[str, Any]]
AS_IS: Final[Names] = ()
QUANTITIES: Final = ("w_bar", "beta")


def of_starts(
    kept: Kept, point: DrivenPoint, names: Names, quantity: str, n_cycles: int | None = None
) -> list[float]:
    """Return a quantity of every start that was computed.

    Parameters
    ----------
    kept : mapping
    point : DrivenPoint
    names : tuple of str
        Of the effects that are changed.
    quantity : {'w_bar', 'beta'}
    n_cycles : int, optional
        As of `case_of`.
    """
    found = (kept.get(case_of(point, names, seed, n_cycles).name) for seed in range(N_STARTS))
    return [float(result[quantity]) for result in found if result is not None]


def scatter_of_starts(kept: Kept, point: DrivenPoint, quantity: str) -> float:
    """Standard deviation between starts, pooled over all changes: three starts alone tell their scatter badly.

    Parameters
    ----------
    kept : mapping
    point : DrivenPoint
    quantity : {'w_bar', 'beta'}

    Returns
    -------
    float
        NaN where nothing has two starts.
    """
    groups = [np.array(of_starts(kept, point, names, quantity)) for names in combinations()]
    freedom = sum(max(group.size - 1, 0) for group in groups)
    squares = sum(float(((group - group.mean()) ** 2).sum()) for group in groups if group.size)
    return math.sqrt(squares / freedom) if freedom else math.nan


def liquids(kept: Kept) -> dict[Names, Liquid]:
    """W̄ and β by the effects that are changed, means over starts with the error of their pooled scatter.

    Parameters
    ----------
    kept : mapping
    """
    scatter = {
        (point, name): scatter_of_starts(kept, point, name) for point in MEASURED_POINTS for name in QUANTITIES
    }
    found: dict[Names, Liquid] = {}
    for names in combinations():
        values = {}
        for point in MEASURED_POINTS:
            starts = {name: of_starts(kept, point, names, name) for name in QUANTITIES}
            if starts["w_bar"]:
                means = [
                    MeanOverCycles(float(np.mean(of)), scatter[point, name] / math.sqrt(len(of)))
                    for name, of in starts.items()
                ]
                values[point] = PointValues(*means)
        found[names] = values
    return found


@dataclass(frozen=True)
class Interaction:
    """What a pair does beyond what its two effects do one by one.

    Attributes
    ----------
    names : tuple of str
    point : DrivenPoint
    w_bar : MeanOverCycles
        W̄ of the pair + W̄ as it is − the sum of W̄ of both alone.
    """

    names: Names
    point: DrivenPoint
    w_bar: MeanOverCycles

    @property
    def in_errors(self) -> float:
        """In standard errors, with its sign."""
        return self.w_bar.value / self.w_bar.standard_error


def interactions(found: Mapping[Names, Liquid]) -> list[Interaction]:
    """Interactions of all pairs at all points at which they were computed.

    Parameters
    ----------
    found : mapping
        Of `liquids`.
    """
    told = []
    for names in (names for names in combinations() if len(names) == 2):
        for point in MEASURED_POINTS:
            parts = [found[of].get(point) for of in (names, AS_IS, names[:1], names[1:])]
            if any(part is None for part in parts):
                continue
            both, none, one, other = (part.w_bar for part in parts if part is not None)
            error = math.hypot(*(part.standard_error for part in (both, none, one, other)))
            value = both.value + none.value - one.value - other.value
            told.append(Interaction(names, point, MeanOverCycles(value, error)))
    return told


def judged(found: Mapping[Names, Liquid]) -> Verdict:
    """Return the verdict by the rules of `studies.tank_reference.diagnosis`.

    Parameters
    ----------
    found : mapping
        Of `liquids`.
    """
    return verdict(found[AS_IS], {told(names): liquid for names, liquid in found.items() if names})


def told(names: Names) -> str:
    """Name of a computation in tables."""
    return " + ".join(names) or "as it is"


def value_table(found: Mapping[Names, Liquid]) -> Iterator[str]:
    """Yield a Markdown table of W̄ and β.

    Parameters
    ----------
    found : mapping
        Of `liquids`.
    """
    levels = [f"{point.acceleration_g:g} g" for point in MEASURED_POINTS]
    head = [f"{symbol}, {level}" for symbol in ("W̄", "β") for level in levels]
    yield "| changed | " + " | ".join(head) + " |"
    yield "|---" * (1 + len(head)) + "|"
    measured = [f"{laboratory_w_bar(point):.2f}" for point in MEASURED_POINTS] + ["< 0"] * len(levels)
    yield "| *laboratory* | " + " | ".join(measured) + " |"
    for names, liquid in found.items():
        cells = [
            str(getattr(liquid[point], quantity)) if point in liquid else "–"
            for quantity in QUANTITIES
            for point in MEASURED_POINTS
        ]
        yield f"| {told(names)} | " + " | ".join(cells) + " |"


def misfit_rows(found: Mapping[Names, Liquid]) -> Iterator[str]:
    """Yield a Markdown table of distances from the laboratory, the nearest where facts may choose first.

    Parameters
    ----------
    found : mapping
        Of `liquids`.
    """
    yield "| changed | misfit where it may choose | misfit where it is judged | facts met |"
    yield "|---|---|---|---|"
    for names, liquid in sorted(found.items(), key=lambda item: misfit(item[1], CHOOSING).value):
        chosen, left = misfit(liquid, CHOOSING), misfit(liquid, JUDGING)
        met = f"{facts_met(liquid)} of {2 * len(MEASURED_POINTS)}" if liquid else "–"
        yield f"| {told(names)} | {chosen} | {left} | {met} |"


def facts_met(liquid: Liquid) -> int:
    """How many of the six values meet the laboratory: W̄ within a tenth of it (0.1 where it is none), β below 0.

    Parameters
    ----------
    liquid : mapping
    """
    met = 0
    for point, values in liquid.items():
        measured = laboratory_w_bar(point)
        met += abs(values.w_bar.value - measured) <= SPREAD_OF_W_BAR * (measured or 1.0)
        met += values.beta.value < 0
    return met


def beyond_chance(found: Mapping[Names, Liquid]) -> list[tuple[Names, DrivenPoint, Misfit]]:
    """Changes of W̄ against the liquid as it is, of more than two standard errors.

    Parameters
    ----------
    found : mapping
        Of `liquids`.
    """
    told_of = []
    for names, liquid in found.items():
        for point in set(liquid) & set(found[AS_IS]) if names else ():
            one, none = liquid[point].w_bar, found[AS_IS][point].w_bar
            change = Misfit(one.value - none.value, math.hypot(one.standard_error, none.standard_error))
            if abs(change.value) > CHANCE * change.standard_error:
                told_of.append((names, point, change))
    return sorted(told_of, key=lambda item: (MEASURED_POINTS.index(item[1]), item[2].value))


def longer_rows(kept: Kept) -> Iterator[str]:
    """Yield a Markdown table of W̄ and β at the weakest motion after more cycles, start by start.

    Parameters
    ----------
    kept : mapping
    """
    yield f"| changed | W̄ of three starts, last {LONG_CYCLES // 2} of {LONG_CYCLES} cycles | β |"
    yield "|---|---|---|"
    for names in FOLLOWED_LONGER:
        of = [of_starts(kept, MEASURED_POINTS[0], names, quantity, LONG_CYCLES) for quantity in QUANTITIES]
        w_bar, beta = (", ".join(f"{value:.2f}" for value in values) or "–" for values in of)
        yield f"| {told(names)} | {w_bar} | {beta} |"


def tables(kept: Kept) -> Sequence[str]:
    """Return all that the page has.

    Parameters
    ----------
    kept : mapping
        Results by names of cases.
    """
    found = liquids(kept)
    lines = [*value_table(found), "", *misfit_rows(found), ""]
    lines.append("| changed | motion | W̄ more than as it is |\n|---|---|---|")
    lines += [f"| {told(names)} | {point.label} | {change} |" for names, point, change in beyond_chance(found)]
    lines += ["", *longer_rows(kept)]
    largest = sorted(interactions(found), key=lambda item: -abs(item.in_errors))
    lines += ["", "| pair | motion | W̄ beyond both alone | in errors |", "|---|---|---|---|"]
    lines += [
        f"| {told(item.names)} | {item.point.label} | {item.w_bar} | {item.in_errors:.1f} |"
        for item in largest[:8]
    ]
    scatter = [f"{point.label} {scatter_of_starts(kept, point, 'w_bar'):.3f}" for point in MEASURED_POINTS]
    lines += ["", f"{len(largest)} interactions, {len(kept)} runs; W̄ scatters by " + ", ".join(scatter)]
    answer = judged(found)
    lines += ["", f"{answer.answer}: {', '.join(answer.names)}; gain {answer.gain:.2f}, left {answer.left:.2f}"]
    # table rows have true minus signs, lines between head and body their hyphens
    return [line if line.startswith("|--") or "\n" in line else line.replace("-", "−") for line in lines]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute what is not there yet, as long as is allowed, and print the tables.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--output", type=Path, default=KEPT, help="JSON file that keeps the results")
    parser.add_argument("--most-seconds", type=float, default=0.0, help="begin no computation later than that")
    chosen = parser.parse_args(arguments)
    results = json.loads(chosen.output.read_text()) if chosen.output.exists() else {}
    compute(results, chosen.output, chosen.most_seconds)
    sys.stdout.write("\n".join(tables(results)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
