"""The missing force of what does not move is drawn over its whole run."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from recorded_oscillators import RATE_HZ, run_of

from pipelines.diagnosis.figures_force import _in_time
from sloshlab.missing_force.latent_force import TANK, LatentForce


def test_a_run_without_motion_is_one_cycle() -> None:
    n = 500
    time = np.arange(n) / RATE_HZ
    run = run_of("still", {"acceleration_tip": np.zeros(n)}, {}, 0, experiment="other")
    axes = Figure().subplots()
    _in_time(axes, LatentForce(run, TANK, np.zeros(n), 0.1, time, np.zeros((n, 3))))
    assert all(line.get_xdata().size == n for line in axes.get_lines()[:2])
