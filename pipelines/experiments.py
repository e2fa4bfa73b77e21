"""The experiments that make runs, each on a folder of recordings with its rigs beside them."""

from __future__ import annotations

import sys
from pathlib import Path

from pipelines.command_line import DONE_BUT_FLAGGED, run


def shaker_arguments(folder: Path, output: Path) -> list[str]:
    """Arguments of `sloshlab shaker` for all runs and rigs of a folder; the rig filled half comes first."""
    recordings = sorted(str(path) for path in folder.glob("*.nc"))
    rigs = sorted(folder.glob("rig*.toml"), key=lambda path: ("0.50" not in path.name, path.name))
    options = [part for rig in rigs for part in ("--rig", str(rig))]
    return ["shaker", *recordings, *options, "-o", str(output)]


def main() -> int:
    """Run ``shaker FOLDER OUTPUT`` and say where the report is; a flagged result is a result."""
    experiment, folder, output = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    if experiment != "shaker":
        print(f"unknown experiment {experiment!r}; allowed: shaker", file=sys.stderr)  # noqa: T201
        return 2
    code = run(shaker_arguments(folder, output))
    if code in (0, DONE_BUT_FLAGGED):
        print(f"The report is {(output / 'report.html').resolve()}")  # noqa: T201
        return 0
    return code


if __name__ == "__main__":
    sys.exit(main())
