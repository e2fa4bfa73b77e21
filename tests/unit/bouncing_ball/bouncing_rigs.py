"""Rigs and balls that the tests of the bouncing ball share."""

from __future__ import annotations

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.rig import Rig

GUIDED_TANK = """
[tank]
height_m = 0.06
length_m = 0.10
width_m = 0.06
dry_mass_kg = 2.061
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
coulomb_force_n = 0.37
damping_kg_per_s = 1.58
"""
SHAKER = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""


def guided_tank() -> Rig:
    """Table 2.1."""
    return Rig.from_toml_text(GUIDED_TANK)


def shaker() -> Rig:
    """The tank on the shaker."""
    return Rig.from_toml_text(SHAKER)


def table_2_2(damping_in_flight: float = 0.0) -> BouncingBall:
    """Table 2.2."""
    return BouncingBall(0.0244, 1103.0, 13.04, 74.04, 0.0017, damping_in_flight)
