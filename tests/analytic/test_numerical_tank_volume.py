"""Violent shaking must not change how much liquid there is; half a minute of computing."""

import pytest

from studies.numerical_tank_verification.verification_cases import shaken_volume


@pytest.mark.slow
def test_all_the_liquid_is_there_after_violent_shaking() -> None:
    """4 g at 11.4 Hz: settled height within 2 %, nobody outside, momentum to rounding, energy within 5 %."""
    missed = [finding for finding in shaken_volume(4.0, 8.0) if not finding.met]
    assert missed == []
