"""Descriptions of tanks: what is impossible is refused in one line."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.numerical_tank.initial_state import particles_at_rest
from acquisition.numerical_tank.tank import Box, Liquid, LiquidColumn, Numerics, TankSetup, filled_tank
from sloshlab.errors import InputError

BOX = Box(0.1172, 0.0272, 0.078)


def test_mass_is_that_of_the_filled_box() -> None:
    tank = filled_tank(BOX, 0.5, 16)
    assert tank.n_particles == 69 * 8
    assert tank.liquid_mass_kg == pytest.approx(998.2 * 0.1172 * 0.0136 * 0.078, rel=1e-12)


def test_particles_at_rest_carry_hydrostatic_pressure() -> None:
    tank = filled_tank(BOX, 0.5, 16, numerics=Numerics(jitter=0.0))
    _, z, s = particles_at_rest(tank)
    pressure = s * 998.2 * tank.liquid.speed_of_sound_m_per_s**2
    assert z.min() == pytest.approx(0.0136 / 16, rel=1e-9)
    assert np.allclose(pressure, 998.2 * 9.81 * (0.0136 - z), rtol=1e-12)


def test_seed_decides_the_disturbance() -> None:
    first, same, other = (particles_at_rest(filled_tank(BOX, 0.5, 16, seed=seed))[0] for seed in (3, 3, 4))
    assert np.array_equal(first, same)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("rate_hz", [1000.0, 2048.0, 51200.0])
def test_step_divides_the_sampling_interval(rate_hz: float) -> None:
    free, tied = filled_tank(BOX, 0.5, 16), filled_tank(BOX, 0.5, 16, sampling_rate_hz=rate_hz)
    assert tied.step_s <= free.step_s
    assert tied.steps_per_sample * tied.step_s * rate_hz == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda: filled_tank(BOX, 0.0, 16), "filling level: got 0.0; allowed: 0 < level < 1"),
        (lambda: filled_tank(BOX, 1.0, 16), "filling level: got 1.0"),
        (lambda: filled_tank(BOX, float("nan"), 16), "filling level: got nan"),
        (lambda: filled_tank(BOX, 0.5, 0), "layers of particles over the height: got 0"),
        (lambda: filled_tank(BOX, 0.5, 4), "layers of particles in the liquid: got 2; allowed: at least 4"),
        (
            lambda: filled_tank(BOX, 0.5, 5000),
            "particles: got .*; allowed: at most 200000; remedy: .*larger spacing",
        ),
        (lambda: filled_tank(Box(-1.0, 1.0), 0.5, 16), "box.length_m: got -1.0; allowed: a finite number above 0"),
        (
            lambda: filled_tank(BOX, 0.5, 16, liquid=Liquid(speed_of_sound_m_per_s=1.0)),
            "speed_of_sound.*at least 10",
        ),
        (lambda: filled_tank(BOX, 0.5, 16, liquid=Liquid(viscosity_m2_per_s=-1.0)), "liquid.viscosity_m2_per_s"),
        (lambda: filled_tank(BOX, 0.5, 16, numerics=Numerics(courant_number=3.0)), "courant_number: got 3.0"),
        (lambda: filled_tank(BOX, 0.5, 16, numerics=Numerics(precision="half")), "precision.*single, double"),  # type: ignore[arg-type]
        (lambda: filled_tank(BOX, 0.5, 16, sampling_rate_hz=0.0), "sampling_rate_hz: got 0.0"),
        (lambda: TankSetup(BOX, LiquidColumn(0.2, 0.01), 0.001), "column.length_m: got 0.2; allowed: at most"),
        (lambda: replace(filled_tank(BOX, 0.5, 16), gravity_m_per_s2=-9.81), "gravity_m_per_s2: got -9.81"),
    ],
)
def test_impossible_tanks_are_refused_in_one_line(change, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=message) as caught:
        change()
    assert "\n" not in str(caught.value)
