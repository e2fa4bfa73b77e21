"""``python -m studies.other_laboratories make FOLDER [NAME…]``, ``… diagnose FOLDER [NAME…]``, ``… score FOLDER``.

``make`` takes about two minutes. ``diagnose`` goes on where it was stopped: cases that have an answer keep it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from studies.other_laboratories.answers import RECORD, diagnose, row, table
from studies.other_laboratories.case_files import write_case
from studies.other_laboratories.catalogue import cases


def main() -> int:
    """Make, diagnose or score."""
    parser = argparse.ArgumentParser(prog="python -m studies.other_laboratories", description=__doc__)
    parser.add_argument("what", choices=("make", "diagnose", "score"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", help="laboratories or cases; all by default")
    arguments = parser.parse_args()
    if arguments.what == "make":
        for case in cases(arguments.names):
            _say(str(write_case(case, arguments.folder)))
    elif arguments.what == "diagnose":
        for file in sorted(arguments.folder.glob("*/truth.json")):
            home = file.parent
            if (home.name in arguments.names or not arguments.names) and not (home / RECORD).exists():
                diagnose(home)
                _say(row(home))
    else:
        _say("\n".join(table(arguments.folder)))
    return 0


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
