"""Run the verification cases and tabulate: ``python -m studies.numerical_tank_verification.verification``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from sloshlab.atomic_file import write_bytes
from studies.numerical_tank_verification.verification_cases import (
    Finding,
    dam_break,
    hanging_surface,
    hydrostatic_rest,
    numerical_damping,
    shaken_volume,
    standing_wave,
)

Case = Callable[[], list[Finding]]

QUICK: Final[tuple[Case, ...]] = (
    lambda: hydrostatic_rest(8, 2.0),
    lambda: standing_wave(12),
    lambda: standing_wave(16),
    lambda: dam_break(16),
)
LONG: Final[tuple[Case, ...]] = (
    lambda: hydrostatic_rest(8, 20.0),
    lambda: standing_wave(24),
    lambda: standing_wave(24, mode=2),
    lambda: numerical_damping(12),
    lambda: numerical_damping(24),
    lambda: dam_break(24),
    lambda: dam_break(32),
    lambda: hanging_surface(12),
    lambda: hanging_surface(24),
    lambda: shaken_volume(1.5, 10.0),
    lambda: shaken_volume(4.0, 60.0),
    lambda: shaken_volume(6.0, 60.0),
)


def rows(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the rows of a Markdown table.

    Parameters
    ----------
    findings : sequence of Finding

    Examples
    --------
    >>> print(*rows([Finding("rest", "force / weight", -1.0, -1.0, 0.01)]), sep="\\n")
    | rest | force / weight | -1 | -1 | 0.01 | yes |
    """
    for f in findings:
        verdict = ("yes" if f.met else "**no**") if f.tolerance < float("inf") else "for information"
        allowed = f"{f.tolerance:.3g}" if f.tolerance < float("inf") else ""
        yield f"| {f.case} | {f.quantity} | {f.measured:.4g} | {f.expected:.4g} | {allowed} | {verdict} |"


def verified(
    description: str, quick: Sequence[Case], long: Sequence[Case], arguments: Sequence[str] | None
) -> int:
    """Run cases and tabulate what they find; return 0 if all tolerances are met, else 1.

    Parameters
    ----------
    description : str
        Of the command.
    quick, long : sequence of Case
        Those that always run, and those that run when they are asked for.
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--long", action="store_true", help="also the cases that take many minutes")
    parser.add_argument("--output", type=Path, help="write the table to this file")
    chosen = parser.parse_args(arguments)
    lines = ["| case | quantity | measured | expected | tolerance | met |", "|---|---|---|---|---|---|"]
    met = True
    for case in (*quick, *(long if chosen.long else ())):
        findings = case()
        met &= all(finding.met for finding in findings)
        lines += rows(findings)
        sys.stdout.write("\n".join(lines[-len(findings) :]) + "\n")
        sys.stdout.flush()
    if chosen.output:
        write_bytes(chosen.output, ("\n".join(lines) + "\n").encode())
    return 0 if met else 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the cases; return 0 if all tolerances are met, else 1.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    return verified("Verify the numerical tank against theory and experiment.", QUICK, LONG, arguments)


if __name__ == "__main__":
    sys.exit(main())
