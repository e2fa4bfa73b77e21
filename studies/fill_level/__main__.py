"""``python -m studies.fill_level FOLDER``: computes what is missing, trains, and writes a table and a picture."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from studies.fill_level.campaign import compute
from studies.fill_level.figures import errors_figure
from studies.fill_level.networks import Workshop, as_json, errors, other_seed_errors, table


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, train, compare, and write.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(prog="python -m studies.fill_level", description=__doc__)
    parser.add_argument("folder", type=Path, help="of runs, networks, table and picture")
    given = parser.parse_args(arguments)
    try:
        workshop = Workshop(given.folder / "networks", compute(given.folder / "runs"))
        found, floors = errors(workshop), other_seed_errors(workshop)
        with atomic_file.filled_folder(given.folder) as complete:
            (complete / "table.md").write_text("\n".join(table(found, floors)) + "\n", encoding="utf-8")
            (complete / "errors.json").write_text(as_json(found, floors) + "\n", encoding="utf-8")
            (complete / "fill_level.png").write_bytes(errors_figure(found, floors))
    except SloshlabError as error:
        say(f"fill_level: {error}", error=True)
        return 1
    say(f"{given.folder / 'table.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
