"""Violent shaking must not change how much liquid there is; half a minute of computing."""

import pytest

from acquisition.numerical_tank.verification_cases import Finding, shaken_volume


@pytest.fixture(scope="module")
def after_violent_shaking() -> list[Finding]:
    """4 g at 11.4 Hz for eight seconds."""
    return shaken_volume(4.0, 8.0)


@pytest.mark.slow
def test_violent_shaking_loses_no_particle_momentum_or_energy(after_violent_shaking: list[Finding]) -> None:
    """Nobody outside, momentum to rounding, energy within 5 %."""
    _, *others = after_violent_shaking
    assert [one for one in others if not one.met] == []


@pytest.mark.slow
@pytest.mark.xfail(reason="2 to 3 % more, and chaotic: docs/numerical_tank.md says so in its table", strict=False)
def test_all_the_liquid_is_there_after_violent_shaking(after_violent_shaking: list[Finding]) -> None:
    """Settled height within 2 %."""
    settled, *_ = after_violent_shaking
    assert settled.met, settled


@pytest.mark.slow
def test_it_is_there_within_four_per_cent(after_violent_shaking: list[Finding]) -> None:
    """Without the packing correction the liquid fills the whole box within seconds."""
    settled, *_ = after_violent_shaking
    assert settled.measured == pytest.approx(1.0, abs=0.04)
