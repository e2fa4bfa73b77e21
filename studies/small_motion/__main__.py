"""``python -m studies.small_motion FOLDER``: computes what is missing, trains, and writes tables and pictures."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pipelines.report.terminal import say
from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from studies.small_motion.figures import amplitude_figure, offset_figure
from studies.small_motion.judging import all_results
from studies.small_motion.tables import all_tables

KEPT: Final = Path(__file__).with_name("results.json")
"""Numbers of the page, from which tables and pictures are drawn without computing anything."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, train, judge, and write.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(prog="python -m studies.small_motion", description=__doc__)
    parser.add_argument("folder", type=Path, help="of runs, networks, tables and pictures")
    parser.add_argument("--raw", type=Path, default=Path("raw_data/numerical_tank"), help="recordings of the beam")
    parser.add_argument("--kept", action="store_true", help="draw from the kept numbers; compute nothing")
    given = parser.parse_args(arguments)
    try:
        results = json.loads(KEPT.read_bytes()) if given.kept else all_results(given.folder, given.raw)
        with atomic_file.filled_folder(given.folder) as complete:
            text = "\n".join(all_tables(results))
            (complete / "tables.md").write_text(text, encoding="utf-8")
            (complete / "results.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
            (complete / "small_motion.png").write_bytes(amplitude_figure(results))
            (complete / "small_motion_offset.png").write_bytes(offset_figure(results))
    except SloshlabError as error:
        say(f"small_motion: {error}", error=True)
        return 1
    say(f"{given.folder / 'tables.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
