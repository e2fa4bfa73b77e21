"""``python -m studies.tank_scaling FOLDER [--model ROM.nc]``: computes what is missing, tables and pictures."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from acquisition.virtual_laboratory.campaign import file_record
from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import SloshlabError
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.storage import load_model
from studies.tank_scaling.campaign import SIZES, SMALL_SIZES, Run, compute, cycles_by_name
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
    """Write ``tables.md``, ``cycles.json`` and ``law.json`` with a manifest, and pictures.

    Parameters
    ----------
    results : mapping
    model : ReducedOrderModel or None
    folder : Path
    """
    errors = [] if model is None else model_errors(model, results, POINTS, SIZES)
    with atomic_file.filled_folder(folder) as complete:
        (complete / "tables.md").write_text("\n".join(_tables(results, errors)) + "\n", encoding="utf-8")
        numbers = {"cycles.json": cycles_by_name(results), "law.json": law(results, errors)}
        for name, content in numbers.items():
            (complete / name).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        manifest = {
            "command": "make tank-scaling",
            "sloshlab_version": __version__,
            "files": {name: file_record(complete / name) for name in numbers},
        }
        (complete / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
        (complete / "scaling_sizes.png").write_bytes(sizes_figure(results, POINTS, model))
        if model is not None:
            (complete / "scaling_motion.png").write_bytes(motion_figure(results, model, SIZES))
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
        "sizes": [asdict(size_change(results, POINTS, size)) for size in (*SMALL_SIZES, *SIZES) if size != 1],
        "wall_layers": walls,
        "surface_tension": tension,
        "models": [_of_json(asdict(error)) for error in errors],
    }


def _of_json(numbers: Mapping[str, float]) -> dict[str, float | None]:
    """Numbers as JSON has them, which knows no NaN."""
    return {name: None if math.isnan(number) else number for name, number in numbers.items()}


def _tables(results: Results, errors: Sequence[ModelError]) -> Iterator[str]:
    others = [size for size in (*SMALL_SIZES, *SIZES) if size != 1]
    parts = [
        tank_table((*SMALL_SIZES, *SIZES)),
        point_table(results, POINTS, (*SMALL_SIZES, *SIZES)),
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
