"""``python -m studies.rivals TRIAL --truths FILE --training TRIAL … -o OUT``: rivals answer the cases of a trial.

Goes on where it was stopped: what is seen of a case is kept in ``OUT/seen``.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Final

from campaigns.where import Where
from sealed_trial.running import DIAGNOSES
from sealed_trial.sealing.trial_folder import check_data, read_commitments
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError, SloshlabError
from studies.rivals.comparison import Row, answered, learning_curve, of_diagnoses, rivals_of, to_document
from studies.rivals.page import held_out_lines, learning_lines, pairwise_lines, table_lines, write_figure
from studies.rivals.seen import seen_cases
from studies.rivals.training import Known, opened, require_apart

_PARTS: Final = 3
"""Of the development cases, in their order: how much more of them would help."""


def main() -> int:
    """Look at all cases, learn from the development ones, answer and mark the others."""
    parser = argparse.ArgumentParser(prog="python -m studies.rivals", description=__doc__)
    parser.add_argument("trial", type=Path, help="whose cases are judged, diagnosed by sloshlab already")
    parser.add_argument("--truths", type=Path, help="its opened truths; those of a development trial by default")
    parser.add_argument("--key", type=Path, help="key of a sealed trial, in place of its truths")
    parser.add_argument("--training", type=Path, nargs="+", default=[], help="development trials to learn from")
    parser.add_argument("--diagnoses", default=DIAGNOSES, help="folder of the trial with the answers of sloshlab")
    parser.add_argument("--workers", type=int, default=2, help="cases looked at at once")
    parser.add_argument("--scheduler", help="tcp://HOST:PORT of a Dask scheduler, or slurm; else this machine")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    try:
        rows = _compared(arguments)
    except SloshlabError as error:
        print(f"rivals: {error}", file=sys.stderr)
        return 1
    print("\n".join(table_lines(rows)))
    return 0


def _compared(arguments: argparse.Namespace) -> list[Row]:
    trial, output = arguments.trial, arguments.output
    where = Where(arguments.scheduler, arguments.workers)
    require_apart(arguments.training, trial)
    names = [folder.resolve().name for folder in (trial, *arguments.training)]
    if len(set(names)) < len(names):
        raise InputError("TRIAL and --training", got="two folders of one name", allowed="names of their own")
    for case in read_commitments(trial).cases:
        check_data(trial, case)
    known = []
    for folder in arguments.training:
        truths = opened(folder)
        seen = seen_cases(folder, output / "seen" / folder.resolve().name, where=where)
        known += [Known(each, truths[each.case]) for each in seen]
    judged = seen_cases(trial, output / "seen" / trial.resolve().name, where=where)
    rivals = rivals_of(known)
    # Opened last: nothing of the rivals depends on them.
    truths = opened(trial, arguments.truths, arguments.key)
    rows = [of_diagnoses(trial / arguments.diagnoses, truths)]
    rows += [answered(rival, judged, truths, output / "answers" / rival.name) for rival in rivals]
    sizes = sorted({-(-len(known) * part // _PARTS) for part in range(1, _PARTS + 1)})
    curve = learning_curve(known, sizes, judged, truths)
    parts = [table_lines(rows), held_out_lines(rows, truths), pairwise_lines(rows), learning_lines(curve, sizes)]
    parts.append([f"{row.name}: {row.learnt}" for row in rows if row.learnt])
    write_bytes(output / "rivals.md", ("\n\n".join("\n".join(lines) for lines in parts) + "\n").encode())
    write_bytes(output / "rivals.json", (json.dumps(to_document(rows), indent=1) + "\n").encode())
    write_figure(rows, output / "rivals.png")
    return rows


if __name__ == "__main__":
    sys.exit(main())
