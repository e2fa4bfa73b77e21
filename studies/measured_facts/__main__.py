"""The table of measured facts: ``python -m studies.measured_facts RESULTS [--output FILE]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from sloshlab import atomic_file
from sloshlab.errors import SloshlabError
from studies.measured_facts.table import Results, facts, table


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and write it if asked to.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="What was measured beside what an analysis gives.")
    parser.add_argument("results", type=Path, help="folder with windows.nc and maps.nc")
    parser.add_argument("--output", type=Path, help="write the table to this file")
    chosen = parser.parse_args(arguments)
    try:
        text = table(list(facts(Results.of_folder(chosen.results))))
    except SloshlabError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(f"{text}\n")
    if chosen.output:
        atomic_file.write_bytes(chosen.output, f"{text}\n".encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
