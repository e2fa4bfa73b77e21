"""Reads the recordings named on stdin, one outcome per line, in a process that a C library may take down."""

from __future__ import annotations

import json
import sys
import traceback

from sloshlab.errors import SloshlabError
from sloshlab.recording import read_recording


def outcome_of(path: str) -> str:
    """``read``, ``refused`` or the traceback of what must not come out."""
    try:
        read_recording(path).load()
    except SloshlabError as error:
        return "refused" if "\n" not in str(error) else f"more than one line: {error!r}"
    except BaseException:  # noqa: BLE001 - the outcome is what is tested
        return traceback.format_exc()
    return "read"


def main() -> None:
    """Announce every file before it is opened, so that the last one announced is the one that crashed."""
    for line in sys.stdin:
        path = line.rstrip("\n")
        print(json.dumps([path, "opened"]), flush=True)
        print(json.dumps([path, outcome_of(path)]), flush=True)


if __name__ == "__main__":
    main()
