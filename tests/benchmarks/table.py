"""The figures that were asked for, from the last run of `make bench`, as a table in Markdown.

`python -m tests.benchmarks.table` prints it; what it says of other runs stands in `docs/benchmarks.md`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.benchmarks.__main__ import AIMS, AT_LEAST, LONG_MEMORY_LABEL, READING_LABEL
from tests.benchmarks.command_start import (
    COMPLETION_LABEL,
    HELP_LABEL,
    IMPORT_LABEL,
    REFUSAL_LABEL,
    VIRTUAL_LABEL,
)
from tests.benchmarks.diagnosis import LONGEST_LABEL, MEDIAN_LABEL
from tests.benchmarks.flights import AIR_LABEL, FLIGHT_LABEL, FLUTTER_LABEL
from tests.benchmarks.history import RESULTS
from tests.benchmarks.numerical_tank import label as tank_label
from tests.benchmarks.reduced_order_model import TIME_LABEL
from tests.benchmarks.reduced_order_model_in_the_twin import LOOP_LABEL
from tests.benchmarks.scaling import CHANNELS_LABEL, NETWORKS_LABEL, TANKS_LABEL
from tests.benchmarks.study import STUDY_LABEL
from tests.benchmarks.tanks_in_flight import LABEL as GUST_LABEL
from tests.benchmarks.twin import RIVAL_LABEL


@dataclass(frozen=True)
class Row:
    """One work of the table.

    Attributes
    ----------
    work, label : str
        In words, and as the figures name it.
    before : str
        What was measured when the aims were set.
    reason : str
        Why it stays above its aim, said where it does.
    """

    work: str
    label: str
    before: str = "–"
    reason: str = ""


_SLOW_STARTS: Final = (
    "by the clock, on a machine where Python itself took 0.043 s to start, not 0.02 s as where 0.29 s of a help,"
    " 0.20 s of a completion and 1.45 s of a sweep were measured"
)
_FITS_OF_CANDIDATES: Final = (
    "nine tenths are fits of candidate models, each of some hundred simulations of all runs; where pairs compete,"
    " several dozen are fitted"
)
ROWS: Final = (
    Row(
        "windows and maps over reading and decoding the file",
        READING_LABEL,
        "3.69",
        "every sample is read once, and gone through for cycles, noise of pairs, clipping, holds and phase; a"
        " tenth is calls of xarray and NumPy for a hundred windows and two files",
    ),
    Row(
        "ten times the recording over one", "10 × longer recording costs", "8.68", "fresh memory is touched first"
    ),
    Row(
        "its peak memory over that of one",
        LONG_MEMORY_LABEL,
        "10.1",
        "results of cycles and the dense system of the maps grow with their number",
    ),
    Row("beam and ball: `solve_ivp` (RK45) at equal error over ours", RIVAL_LABEL.format("RK45"), "28.9"),
    Row(
        "the same, DOP853",
        RIVAL_LABEL.format("DOP853"),
        "33.8",
        "each of 200 000 steps waits for the one before, and the rival's time is the filling of its samples",
    ),
    Row("NFIR 70 × 35 on 480 s [s]", TIME_LABEL, "309"),
    Row("study of 32 networks [s]", STUDY_LABEL, "3600"),
    Row(
        "10 s of beam and model 60 × 20 [s]",
        LOOP_LABEL,
        "0.021",
        "runs scatter about the aim: 0.0116, 0.0119, 0.0121 s",
    ),
    *(
        Row(f"numerical tank, h/{layers}, per simulated second [s]", tank_label(layers), before)
        for layers, before in ((16, "1.62"), (24, "6.97"))
    ),
    Row(
        "help of a command, the slowest [s]",
        HELP_LABEL,
        "0.6",
        "Typer imports pydantic for its types, 0.14 s, and Rich's Markdown, 0.07 s; " + _SLOW_STARTS,
    ),
    Row(
        "words of a completion [s]",
        COMPLETION_LABEL,
        "0.6",
        "Typer imports pydantic, 0.14 s, and makes every command of the program; " + _SLOW_STARTS,
    ),
    Row("a file that is not there, refused [s]", REFUSAL_LABEL, "0.6"),
    Row("import of `sloshlab` [s]", IMPORT_LABEL, "0.6"),
    Row("six seconds of a virtual sweep [s]", VIRTUAL_LABEL, "several", _SLOW_STARTS),
    Row("ten channels over five", CHANNELS_LABEL),
    Row("four networks over two", NETWORKS_LABEL),
    Row("eight tanks over four", TANKS_LABEL),
    Row("wing with eight tanks: forces of the air [s]", AIR_LABEL),
    Row("wing with eight tanks: its modes and flutter [s]", FLUTTER_LABEL),
    Row("a virtual flight test [s]", FLIGHT_LABEL),
    Row("20 s in a gust with eight models 60 × 20 [s]", GUST_LABEL.format("frozen")),
    Row("the same with liquid sloshing sideways [s]", GUST_LABEL.format("lateral")),
    Row("a case diagnosed with its report, median [s]", MEDIAN_LABEL, reason=_FITS_OF_CANDIDATES),
    Row("the longest [s]", LONGEST_LABEL, reason=_FITS_OF_CANDIDATES),
)


def table(figures: Mapping[str, float]) -> str:
    """The rows with what was measured, as Markdown; a work that was not measured says so.

    Parameters
    ----------
    figures : mapping of str to float
        Of one run.
    """
    lines = ["| work | before | aim | measured | why it is missed |", "|---|---|---|---|---|"]
    for row in ROWS:
        aim, sign = AIMS.get(row.label, AT_LEAST.get(row.label)), "≥" if row.label in AT_LEAST else "≤"
        value = figures.get(row.label)
        missed = value is not None and aim is not None and (value < aim if sign == "≥" else value > aim)
        cells = (
            row.work,
            row.before,
            "–" if aim is None else f"{sign} {aim:g}",
            "not measured" if value is None else f"{value:.3g}",
            (row.reason or "not known") if missed else "",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main(path: Path = RESULTS) -> None:
    """Print the table of the last run."""
    if not path.is_file():
        sys.exit(f"benchmarks: got no {path}; remedy: make bench")
    run = json.loads(path.read_text(encoding="utf-8"))
    print(f"Revision {run['revision']} of {run['date']}, {run['machine']}.\n\n{table(run['figures'])}")


if __name__ == "__main__":
    main()
