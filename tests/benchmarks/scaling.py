"""How cost grows with channels, networks and tanks: `python -m tests.benchmarks.scaling` prints JSON.

Each figure is the cost of twice as much over the cost of once, both taken in turn in one process; 2 is linear.
The figures with the recording's length stand with those of the analysis.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from tests.benchmarks.measurements import RIG, best_in_turn, sweep_analysis, write_chirp

CHANNELS_LABEL: Final = "ten channels over five, analysis of a sweep"
NETWORKS_LABEL: Final = "four networks over two, training"
TANKS_LABEL: Final = "eight tanks over four, aircraft in a gust"
SECONDS, N_DELAYS, N_NEURONS, N_EPOCHS = 60.0, 20, 6, 4


def scaling_figures() -> dict[str, float]:
    """All three."""
    return {
        CHANNELS_LABEL: _of_channels(),
        NETWORKS_LABEL: _of_networks(),
        TANKS_LABEL: _of_tanks(),
    }


def _of_channels() -> float:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(RIG)
        actions = {}
        for n_copies in (1, 2):
            path = folder / f"chirp_{n_copies}.nc"
            write_chirp(path, SECONDS, n_copies=n_copies)
            actions[str(n_copies)] = sweep_analysis(str(path), name)
            actions[str(n_copies)]()
        best = best_in_turn(actions, 3)
    return best["2"] / best["1"]


def _of_networks() -> float:
    from sloshlab.reduced_order_model.regressors import Delays, Run
    from sloshlab.reduced_order_model.training import TrainingSettings, fit

    x = np.random.default_rng(0).standard_normal(20_000)
    run = Run(x, np.tanh(np.convolve(x, 0.5 ** np.arange(6))[: x.size]))

    def trained(n: int) -> None:
        for seed in range(n):
            fit(
                "normalised_rbf", {"n_neurons": N_NEURONS}, Delays.tapped(N_DELAYS), [run], [run],
                sampling_rate_hz=512.0, settings=TrainingSettings(seed=seed, n_epochs=N_EPOCHS),
            )  # fmt: skip

    trained(1)
    best = best_in_turn({"2": lambda: trained(2), "4": lambda: trained(4)}, 3)
    return best["4"] / best["2"]


def _of_tanks() -> float:
    from tests.benchmarks.tanks_in_flight import flight_of

    actions = {}
    for n_tanks in (4, 8):
        flown = flight_of("frozen", n_tanks)
        flown(0.5)
        actions[str(n_tanks)] = lambda fly=flown: fly(5.0)  # type: ignore[misc]
    best = best_in_turn(actions, 3)
    return best["8"] / best["4"]


if __name__ == "__main__":
    print(json.dumps(scaling_figures(), indent=1, ensure_ascii=False))
