"""Run the verification cases and tabulate: ``python -m studies.two_phase_verification.verification``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from sloshlab.atomic_file import write_bytes
from studies.numerical_tank_verification.verification import rows
from studies.numerical_tank_verification.verification_cases import Finding
from studies.two_phase_verification.cases import dam_break, drop, faraday_threshold, rest, standing_wave

QUICK: Final[tuple[Callable[[], list[Finding]], ...]] = (
    lambda: rest(12, 60.0),
    lambda: standing_wave(16),
    lambda: standing_wave(24),
    lambda: standing_wave(32),
    lambda: standing_wave(40),
    lambda: standing_wave(32, mode=2),
    lambda: drop(20),
    lambda: drop(40),
    lambda: faraday_threshold(24),
    lambda: faraday_threshold(32),
    lambda: dam_break(24),
    lambda: dam_break(32),
)
LONG: Final[tuple[Callable[[], list[Finding]], ...]] = (
    lambda: rest(24, 60.0),
    lambda: standing_wave(48),
    lambda: drop(64),
    lambda: faraday_threshold(40),
    lambda: dam_break(48),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the cases; return 0 if all tolerances are met, else 1.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(
        description="Verify the tank of liquid and gas against theory and experiment."
    )
    parser.add_argument("--long", action="store_true", help="also the cases that take many minutes")
    parser.add_argument("--output", type=Path, help="write the table to this file")
    chosen = parser.parse_args(arguments)
    lines = ["| case | quantity | measured | expected | tolerance | met |", "|---|---|---|---|---|---|"]
    met = True
    for case in QUICK + (LONG if chosen.long else ()):
        findings = case()
        met &= all(finding.met for finding in findings)
        lines += rows(findings)
        sys.stdout.write("\n".join(lines[-len(findings) :]) + "\n")
        sys.stdout.flush()
    if chosen.output:
        write_bytes(chosen.output, ("\n".join(lines) + "\n").encode())
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
