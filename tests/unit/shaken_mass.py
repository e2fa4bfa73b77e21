"""A rigid tank of known mass on a shaker with two accelerometers of unlike noise: nothing of the twin is in it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from recorded_oscillators import RATE_HZ, run_of

from sloshlab.identification.case import Case, CaseRun
from sloshlab.rig import Rig

MASS_KG = 0.8
QUIET, LOUD, CELL = "acceleration_roof_1", "acceleration_roof_2", "force_interface"
NOISE = {QUIET: 0.05, LOUD: 0.12, CELL: 0.01}
"""m/s², m/s², N."""
LIQUID_KG = 0.5 * 0.0272 * 0.1172 * 0.0780 * 1000.0
RIG = f"""
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = {MASS_KG - LIQUID_KG}
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[twin]
tank_model = "frozen"
"""


def shaken_run(
    name: str, seed: int, acceleration: np.ndarray, drift_of_quiet: float = 0.0, gain_of_quiet: float = 1.0
) -> CaseRun:
    """Readings of a motion, each with noise of its own, and one that drifts [m/s³] and has another gain."""
    drift = drift_of_quiet * np.arange(acceleration.size) / RATE_HZ
    channels = {QUIET: gain_of_quiet * acceleration + drift, LOUD: acceleration, CELL: MASS_KG * acceleration}
    return run_of(name, channels, NOISE, seed, experiment="other", repeat=seed)


def case_of(folder: Path, runs: Sequence[CaseRun]) -> Case:
    """Of some runs."""
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    return Case("case", folder, Rig.from_toml(folder / "rig.toml"), tuple(runs))
