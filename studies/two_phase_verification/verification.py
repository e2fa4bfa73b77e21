"""Run the verification cases and tabulate: ``python -m studies.two_phase_verification.verification``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Final

from studies.numerical_tank_verification.verification import verified
from studies.numerical_tank_verification.verification_cases import Finding
from studies.two_phase_verification.cases import (
    dam_break,
    drop,
    faraday_threshold,
    rest,
    standing_wave,
    stuck_drop,
)

QUICK: Final[tuple[Callable[[], list[Finding]], ...]] = (
    lambda: rest(12, 60.0),
    lambda: standing_wave(16),
    lambda: standing_wave(24),
    lambda: standing_wave(32),
    lambda: standing_wave(40),
    lambda: standing_wave(32, mode=2),
    lambda: drop(20),
    lambda: drop(40),
    lambda: stuck_drop(20),
    lambda: faraday_threshold(24),
    lambda: faraday_threshold(32),
    lambda: dam_break(24),
    lambda: dam_break(32),
)
LONG: Final[tuple[Callable[[], list[Finding]], ...]] = (
    lambda: rest(24, 60.0),
    lambda: standing_wave(48),
    lambda: drop(64),
    lambda: stuck_drop(30),
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
    return verified("Verify the tank of liquid and gas against theory and experiment.", QUICK, LONG, arguments)


if __name__ == "__main__":
    sys.exit(main())
