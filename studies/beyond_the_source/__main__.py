"""``python -m studies.beyond_the_source COMPARISON FOLDER RESULTS``: trains, compares, keeps a table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from studies.beyond_the_source.frequencies import frequency_lines
from studies.beyond_the_source.intervals import interval_lines
from studies.beyond_the_source.memory import memory_lines
from studies.beyond_the_source.models import RATE_HZ, Workshop
from studies.beyond_the_source.recordings import Recordings

COMPARISONS = {"memory": memory_lines, "frequencies": frequency_lines, "intervals": interval_lines}


def main() -> int:
    """Run one comparison."""
    parser = argparse.ArgumentParser(prog="python -m studies.beyond_the_source", description=__doc__)
    parser.add_argument("comparison", choices=COMPARISONS)
    parser.add_argument("folder", type=Path, help="raw_data/numerical_tank")
    parser.add_argument("results", type=Path, help="folder of models and tables")
    parser.add_argument("--epochs", type=int, default=30)
    arguments = parser.parse_args()
    try:
        arguments.results.mkdir(parents=True, exist_ok=True)
        workshop = Workshop(arguments.results, arguments.epochs)
        lines = COMPARISONS[arguments.comparison](Recordings(arguments.folder, RATE_HZ), workshop)
    except SloshlabError as error:
        print(f"beyond_the_source: {error}", file=sys.stderr)
        return 1
    text = "\n".join(lines) + "\n"
    atomic_file.write_bytes(arguments.results / f"{arguments.comparison}.txt", text.encode())
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
