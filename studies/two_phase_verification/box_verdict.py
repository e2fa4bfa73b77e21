"""What the third dimension explains of the mismatch with the laboratory: tables, and the verdict.

``python -m studies.two_phase_verification.box_verdict`` prints what `box_shaken` and the plane with the same cells
have kept. The third dimension competes with the effects that the plane switches, by the rules of
`studies.tank_reference.diagnosis`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from studies.steady_state import MeanOverCycles
from studies.tank_reference.comparison import Liquid, PointValues, laboratory_w_bar
from studies.tank_reference.diagnosis import Verdict, misfit_table, verdict, verdict_table
from studies.tank_reference.points import DrivenPoint
from studies.two_phase_verification import box_shaken
from studies.two_phase_verification.effects import KEPT, MEASURED_POINTS
from studies.two_phase_verification.effects_tables import AS_IS, facts_met, liquids, told
from studies.two_phase_verification.shaken import Shaking

Kept = Mapping[str, Mapping[str, Any]]

BOX: Final = Path(__file__).with_name("box_shaken.json")
PLANE: Final = Path(__file__).with_name("plane_beside_box.json")
PLANE_IS: Final = "plane"
DIMENSION: Final = "third dimension"
N_CYCLES: Final = {
    DrivenPoint(case.acceleration_g, case.frequency_hz): case.n_cycles for case in box_shaken.POINTS["first"]
}


def mean_of_starts(means: Sequence[MeanOverCycles]) -> MeanOverCycles:
    """Return the mean over starts; its error is what cycles say, or how far the starts are apart if that is more.

    Parameters
    ----------
    means : sequence of MeanOverCycles
        One a start.

    Examples
    --------
    >>> str(mean_of_starts([MeanOverCycles(1.0, 0.03), MeanOverCycles(1.0, 0.04)]))
    '1.00 ± 0.03'
    >>> str(mean_of_starts([MeanOverCycles(0.8, 0.03), MeanOverCycles(1.2, 0.04)]))
    '1.00 ± 0.20'
    """
    values = np.array([mean.value for mean in means])
    within = math.hypot(*(mean.standard_error for mean in means)) / values.size
    between = float(values.std(ddof=1)) / math.sqrt(values.size) if values.size > 1 else 0.0
    return MeanOverCycles(float(values.mean()), max(within, between))


def liquid_of(kept: Kept, cells_per_height: int) -> Liquid:
    """Return W̄ and β at the points that were computed with so many cells and nothing changed, means over starts.

    Parameters
    ----------
    kept : mapping
        Results by the names of their cases.
    cells_per_height : int
    """
    found: dict[DrivenPoint, PointValues] = {}
    for point, n_cycles in N_CYCLES.items():
        wanted = Shaking(point.acceleration_g, point.frequency_hz, n_cycles, cells_per_height)
        runs = [run for run in kept.values() if replace(Shaking(**run["case"]), seed=wanted.seed) == wanted]
        if runs:
            found[point] = PointValues(
                mean_of_starts([MeanOverCycles(run["w_bar"], run["w_bar_error"]) for run in runs]),
                mean_of_starts([MeanOverCycles(run["beta"], run["beta_error"]) for run in runs]),
            )
    return found


@dataclass(frozen=True)
class Compared:
    """The plane and the box with the same cells.

    Attributes
    ----------
    cells_per_height : int
    plane, box : mapping
        W̄ and β by point.
    """

    cells_per_height: int
    plane: Liquid
    box: Liquid

    def named(self) -> dict[str, Liquid]:
        """Return both by their names in tables."""
        size = f", h/{self.cells_per_height}"
        return {PLANE_IS + size: self.plane, DIMENSION + size: self.box}


def compared(box: Kept, plane: Kept) -> list[Compared]:
    """Return plane and box for every number of cells of the box, the coarsest first.

    Parameters
    ----------
    box, plane : mapping
        What is kept of both.
    """
    sizes = sorted({result["case"]["cells_per_height"] for result in box.values()})
    return [Compared(size, liquid_of(plane, size), liquid_of(box, size)) for size in sizes]


def judged(pairs: Sequence[Compared], effects: Mapping[str, Liquid]) -> Verdict:
    """Return what may be said of the plane, with the third dimension among all that was switched.

    Parameters
    ----------
    pairs : sequence of Compared
        The finest of which the box was computed at all points is the one that counts.
    effects : mapping
        Liquids in the plane with one or two effects changed.
    """
    finest = max((pair for pair in pairs if len(pair.box) == len(N_CYCLES)), key=lambda of: of.cells_per_height)
    return verdict(finest.plane, {DIMENSION: finest.box, **effects})


def tables(box: Kept, plane: Kept, effects: Kept) -> Iterator[str]:
    """Yield all that the page has.

    Parameters
    ----------
    box, plane, effects : mapping
        Results by names of cases.
    """
    pairs = compared(box, {**plane, **effects})
    found = {name: liquid for pair in pairs for name, liquid in pair.named().items()}
    yield "| motion | laboratory | " + " | ".join(found) + " |"
    yield "|---" * (2 + len(found)) + "|"
    for quantity, symbol in (("w_bar", "W̄"), ("beta", "β")):
        for point in MEASURED_POINTS:
            measured = f"{laboratory_w_bar(point):.2f}" if quantity == "w_bar" else "< 0"
            cells = [str(getattr(of[point], quantity)) if point in of else "–" for of in found.values()]
            yield f"| {point.label}: {symbol} | {measured} | " + " | ".join(cells) + " |"
    met = [f"{facts_met(of)} of {2 * len(of)}" for of in found.values()]
    yield "| values met | | " + " | ".join(met) + " |"
    yield ""
    yield from misfit_table(found)
    yield ""
    switched = {told(names): liquid for names, liquid in liquids(effects).items() if names != AS_IS}
    yield from verdict_table({PLANE_IS: judged(pairs, switched)})


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    argparse.ArgumentParser(description=str(__doc__).partition("\n")[0]).parse_args(arguments)
    box, plane, effects = (json.loads(path.read_text(encoding="utf-8")) for path in (BOX, PLANE, KEPT))
    sys.stdout.write("\n".join(tables(box, plane, effects)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
