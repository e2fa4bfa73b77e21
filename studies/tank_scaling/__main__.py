"""``python -m studies.tank_scaling FOLDER [--model ROM.nc]``: computes what is missing, tables and pictures."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.storage import load_model
from studies.tank_scaling.campaign import SIZES, VARIED_SIZES, Run, compute
from studies.tank_scaling.changes import left_out_shares, size_change
from studies.tank_scaling.figures import motion_figure, sizes_figure
from studies.tank_scaling.harmonic_runs import POINTS
from studies.tank_scaling.networks import ModelError, model_errors
from studies.tank_scaling.tables import (
    change_table,
    left_out_table,
    model_table,
    point_table,
    resolution_table,
    tank_table,
)

Results = Mapping[Run, Mapping[str, Any]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, and write tables, numbers and pictures.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(prog="python -m studies.tank_scaling", description=__doc__)
    parser.add_argument("folder", type=Path, help="of runs, tables and pictures")
    parser.add_argument("--model", type=Path, help="trained on the training tank, by sloshlab train")
    given = parser.parse_args(arguments)
    try:
        model = None if given.model is None else load_model(given.model)
        results = compute(given.folder / "runs")
        write_outcome(results, model, given.folder)
    except SloshlabError as error:
        say(f"tank_scaling: {error}", error=True)
        return 1
    return 0


def write_outcome(results: Results, model: ReducedOrderModel | None, folder: Path) -> None:
    """Write ``tables.md``, ``law.json`` and pictures.

    Parameters
    ----------
    results : mapping
    model : ReducedOrderModel or None
    folder : Path
    """
    errors = [] if model is None else model_errors(model, results, POINTS, VARIED_SIZES)
    with atomic_file.filled_folder(folder) as complete:
        (complete / "tables.md").write_text("\n".join(_tables(results, errors)) + "\n", encoding="utf-8")
        (complete / "law.json").write_text(json.dumps(law(results, errors), indent=1) + "\n", encoding="utf-8")
        (complete / "scaling_sizes.png").write_bytes(sizes_figure(results, POINTS, model))
        if model is not None:
            (complete / "scaling_motion.png").write_bytes(motion_figure(results, model, VARIED_SIZES))
    say(f"{folder / 'tables.md'}")


def law(results: Results, errors: Sequence[ModelError]) -> dict[str, Any]:
    """The numbers from which `sloshlab.reduced_order_model.scaling_error` quotes.

    Parameters
    ----------
    results : mapping
    errors : sequence of ModelError
    """
    walls, tension = left_out_shares(results, POINTS)
    return {
        "sizes": [asdict(size_change(results, POINTS, size)) for size in SIZES if size != 1],
        "wall_layers": walls,
        "surface_tension": tension,
        "models": [asdict(error) for error in errors],
    }


def _tables(results: Results, errors: Sequence[ModelError]) -> Iterator[str]:
    others = [size for size in SIZES if size != 1]
    parts = [
        tank_table(SIZES),
        point_table(results, POINTS, SIZES),
        change_table(results, POINTS, others),
        resolution_table(results),
        left_out_table(results, POINTS),
        model_table(errors),
    ]
    for part in parts:
        yield from part
        yield ""


if __name__ == "__main__":
    sys.exit(main())
