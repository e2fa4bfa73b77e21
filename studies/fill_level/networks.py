"""Networks that know one fill, networks that see the fill, and their errors at a fill that was left out."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from pipelines.report.progress import progress
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit
from studies.fill_level.campaign import FILLS, RATE_HZ, ComputedRun, FilledRun
from studies.fill_level.motion import TEST, TRAINING, VALIDATION, VariedMotion

FloatArray = NDArray[np.float64]

MODEL_RATE_HZ: Final = 128.0
N_DELAYS: Final = 20
N_NEURONS: Final = 15
N_EPOCHS: Final = 12
SEEDS: Final = (0,)
BAND_HZ: Final = 30.0
"""Of the comparison: beyond the fundamental, below the splashes, which no motion decides."""
WAYS: Final = ("own", "left out", "nearest", "all", "without fill")


@dataclass(frozen=True)
class Training:
    """Which network.

    Attributes
    ----------
    fills : tuple of float
        Whose runs it is trained on.
    sees_fill : bool
    seed : int
    """

    fills: tuple[float, ...]
    sees_fill: bool
    seed: int

    @property
    def name(self) -> str:
        """Name without spaces, for files."""
        fills = "_".join(f"{fill:.3f}" for fill in self.fills)
        return f"fills_{fills}{'_seen' if self.sees_fill else ''}_seed_{self.seed}"


@dataclass(frozen=True)
class FillError:
    """Of one network at one fill, in the test that trained and chose nothing.

    Attributes
    ----------
    way : str
        Of `WAYS`.
    fill_level : float
    force : float
        RMS of model − computed over the RMS of the computed force, up to `BAND_HZ`.
    energy : float
        Work of the whole test, model over computed, less one.
    """

    way: str
    fill_level: float
    force: float
    energy: float


@dataclass(frozen=True, eq=False)
class Workshop:
    """Trains networks, or takes them from the folder where it keeps them.

    Attributes
    ----------
    folder : Path
    computed : mapping of FilledRun to ComputedRun
    """

    folder: Path
    computed: Mapping[FilledRun, ComputedRun]

    @cached_property
    def _runs(self) -> dict[tuple[float, VariedMotion, int], Run]:
        return {(run.fill_level, run.motion, run.seed): model_run(each) for run, each in self.computed.items()}

    def run(self, fill: float, motion: VariedMotion, seed: int = 0) -> Run | None:
        """The run of a fill at the rate of the models; None where it was not computed."""
        return self._runs.get((fill, motion, seed))

    def model(self, wanted: Training) -> ReducedOrderModel:
        """The network, trained if it is not there."""
        path = self.folder / f"{wanted.name}.nc"
        if path.is_file():
            return load_model(path)
        training, validation = (
            [run for fill in wanted.fills if (run := self.run(fill, motion)) is not None]
            for motion in (TRAINING, VALIDATION)
        )
        model, record = fit(
            "normalised_rbf",
            {"n_neurons": N_NEURONS},
            Delays.tapped(N_DELAYS),
            training,
            validation,
            sampling_rate_hz=MODEL_RATE_HZ,
            settings=TrainingSettings(n_epochs=N_EPOCHS, seed=wanted.seed),
            with_fill=wanted.sees_fill,
        )
        model.facts["validation_mse"] = record.best.validation_mse
        self.folder.mkdir(parents=True, exist_ok=True)
        save_model(model, path)
        return model


def model_run(computed: ComputedRun) -> Run:
    """Velocity in, specific force out, at the rate of the models."""
    zeros = np.zeros_like(computed.velocity_m_per_s)
    signals = LiquidSignals(
        computed.velocity_m_per_s, computed.specific_force_m_per_s2, zeros, RATE_HZ, computed.run.name
    ).at_rate(MODEL_RATE_HZ)
    return replace(signals.run(), fill_level=computed.run.fill_level)


def trainings(fill: float, seed: int) -> dict[str, Training]:
    """The networks that are asked about a fill, by `WAYS`."""
    others = tuple(other for other in FILLS if other != fill)
    nearest = min(others, key=lambda other: abs(other - fill))
    return {
        "own": Training((fill,), False, seed),
        "left out": Training(others, True, seed),
        "nearest": Training((nearest,), False, seed),
        "without fill": Training(others, False, seed),
        "all": Training(FILLS, True, seed),
    }


def errors(workshop: Workshop) -> list[FillError]:
    """Of all networks at all fills."""
    # way by way: what says most is there first
    asked = [(fill, seed, way) for way in WAYS for fill in FILLS for seed in SEEDS]
    found = []
    with progress("networks", len(asked)) as done:
        for fill, seed, way in asked:
            test = workshop.run(fill, TEST)
            assert test is not None
            model = asked_at(workshop.model(trainings(fill, seed)[way]), fill)
            found.append(FillError(way, fill, *compared(model.simulate(test.x), test)))
            done(f"{way}, {fill:.3f}")
    return found


def asked_at(model: ReducedOrderModel, fill: float) -> ReducedOrderModel:
    """The model at a fill, beyond those of its training, too: the study shows what that is worth."""
    if model.fill is None:
        return model
    wider = replace(model.fill, lowest=min(model.fill.lowest, fill), highest=max(model.fill.highest, fill))
    return replace(model, fill=wider).at_fill(fill)


def compared(simulated: FloatArray, test: Run) -> tuple[float, float]:
    """Relative RMS error in the band, and relative error of the energy."""
    # the rate is changed by a filter, which knows nothing of the ends of the run
    known = np.isfinite(simulated) & np.isfinite(test.x) & np.isfinite(test.y)
    own, computed = (in_band(np.nan_to_num(values))[known] for values in (simulated, test.y))
    velocity = test.x[known]
    force = float(np.sqrt(np.mean((own - computed) ** 2) / np.mean(computed**2)))
    return force, float(own @ velocity / (computed @ velocity)) - 1


def other_seed_errors(workshop: Workshop) -> dict[float, float]:
    """Relative RMS difference of two computations of one test, over √2: what a network could reach at best."""
    found = {}
    for fill in FILLS:
        runs = workshop.run(fill, TEST), workshop.run(fill, TEST, 1)
        if runs[0] is not None and runs[1] is not None:
            first, second = (in_band(np.nan_to_num(run.y)) for run in runs if run is not None)
            found[fill] = float(np.sqrt(np.mean((first - second) ** 2) / 2 / np.mean(first**2)))
    return found


def in_band(force: FloatArray) -> FloatArray:
    """A force at the rate of the models up to `BAND_HZ`, without delay."""
    return np.asarray(sosfiltfilt(butter(4, BAND_HZ, fs=MODEL_RATE_HZ, output="sos"), force), np.float64)


def table(found: Sequence[FillError], floors: Mapping[float, float]) -> list[str]:
    """Lines of Markdown: error of the force, and of the energy in brackets, means over the starts."""
    lines = [
        "| fill level | own fill | left out, sees the fill | nearest fill | all five | others, not seen | floor |",
        "|---|---|---|---|---|---|---|",
    ]
    for fill in FILLS:
        cells = []
        for way in WAYS:
            here = [error for error in found if error.way == way and error.fill_level == fill]
            force, energy = (np.mean([getattr(error, name) for error in here]) for name in ("force", "energy"))
            cells.append(f"{100 * force:.0f} % ({100 * energy:+.0f} %)".replace("-", "−"))
        floor = f"{100 * floors[fill]:.0f} %" if fill in floors else "–"
        extrapolated = fill in (FILLS[0], FILLS[-1])
        name = f"{fill:.3f}, an end" if extrapolated else f"{fill:.3f}"
        lines.append(f"| {name} | {' | '.join(cells)} | {floor} |")
    return lines


def as_json(found: Sequence[FillError], floors: Mapping[float, float]) -> str:
    """All numbers."""
    kept = {f"{fill:.3f}": floor for fill, floor in floors.items()}
    return json.dumps({"errors": [vars(error) for error in found], "floors": kept})
