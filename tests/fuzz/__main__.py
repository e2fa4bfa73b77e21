"""``make fuzz``: damaged files to every reader, for a set time; exit 1 where anything but one line came out."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from tests.fuzz.campaign import Findings, content_of, fuzzed, outcome_of
from tests.fuzz.targets import TARGETS

_AT_ONCE = 200


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--first", type=int, default=2000, help="number of the first file; those before are tests")
    parser.add_argument("--targets", nargs="*", choices=list(TARGETS), default=list(TARGETS))
    parser.add_argument("--kept", type=Path, default=Path("results/fuzz"), help="folder of what was found")
    parser.add_argument("--one", nargs=2, metavar=("TARGET", "NUMBER"), help="read one damaged file")
    options = parser.parse_args()
    if options.one:
        print(_one(options.one[0], int(options.one[1])))
        return 0
    findings = Findings()
    until = time.monotonic() + options.seconds
    first = options.first
    while time.monotonic() < until:
        for name in options.targets:
            if time.monotonic() < until:
                fuzzed(name, first, _AT_ONCE, findings, options.kept)
        first += _AT_ONCE
    for line in findings.contained:
        print(f"ended by its limits: {line}")
    for line in findings.wrong:
        print(f"WRONG: {line}")
    print(f"{findings.n_inputs} files, {len(findings.contained)} ended by limits, {len(findings.wrong)} wrong")
    return 1 if findings.wrong else 0


def _one(name: str, number: int) -> str:
    with tempfile.TemporaryDirectory() as folder:
        TARGETS[name].prepare(Path(folder))
        path = Path(folder, TARGETS[name].file_name)
        path.write_bytes(content_of(name, number))
        return outcome_of(name, path)


raise SystemExit(main())
