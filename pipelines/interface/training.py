"""Reduced-order models of the liquid in Python: recordings to a model and its validation report."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from pipelines.inputs.recordings import RunLike, RunsLike, RunSource, run_source, run_sources
from pipelines.inputs.rigs import RigLike, rig_source
from pipelines.interface import html
from pipelines.interface.drawing import axes_to_draw_on
from pipelines.interface.provenance import call_text, hashes_of
from pipelines.liquid_model.model_settings import ModelSettings
from pipelines.liquid_model.outputs import training_curve
from pipelines.liquid_model.train import (
    TrainedModel,
    report_folder,
    require_places,
    trained_model,
    write_training,
)
from pipelines.liquid_model.training_runs import RunFiles, require_new_runs, signals_of, sloshing_run
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.training import TrainingSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class LiquidModelPlots:
    """Figures of a training, each on axes that are given or new.

    Attributes
    ----------
    trained : TrainedModel
    """

    trained: TrainedModel

    def curve(self, *, ax: Axes | None = None) -> Axes:
        """Draw the RMS error of the force [N] on training and validation runs over the epochs.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        """
        from pipelines.liquid_model.figures_training import draw_training_curve

        with axes_to_draw_on(ax) as axes:
            draw_training_curve(axes, self.trained.record)
            axes.legend()
        return axes


@dataclass(frozen=True, eq=False)
class LiquidModel:
    """A trained model of the liquid: what `train` returns.

    Attributes
    ----------
    trained : TrainedModel
        The model with its training, its runs and its free run over the validation run.
    call : str
        What was asked for, as the report shows it.
    hashes : mapping
        SHA-256 of everything that was handed over, at the time of the training.
    test : tuple of Path or RecordingInMemory
        Further runs, for the report.
    """

    trained: TrainedModel
    call: str
    hashes: Mapping[Any, str] = field(repr=False)
    test: tuple[RunSource, ...] = ()

    @property
    def model(self) -> ReducedOrderModel:
        """Velocity of the tank [m/s] in, dynamic force of the liquid Δf [N] out."""
        return self.trained.model

    @property
    def fit_percent(self) -> float:
        """Fit of the free run on the validation run [%]; 100 is perfect."""
        return float(self.trained.quality.fit_percent)

    @property
    def rms_error_n(self) -> float:
        """RMS error of Δf of the free run on the validation run [N]."""
        return float(self.trained.quality.rms_error)

    @property
    def curve(self) -> xr.Dataset:
        """RMS errors [N] over the epochs: the contents of ``training_curve.nc``."""
        return training_curve(self.trained.record)

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the model; empty is good."""
        return self.trained.flags

    @property
    def plot(self) -> LiquidModelPlots:
        """Figures on axes: ``plot.curve(ax=…)``."""
        return LiquidModelPlots(self.trained)

    def simulate(self, run: RunLike) -> xr.Dataset:
        """Free run of the model on the motion of a recording.

        Parameters
        ----------
        run : path or xarray.Dataset
            A sloshing run of the rig that the model was trained on.

        Returns
        -------
        xarray.Dataset
            ``dynamic_force_n`` and ``simulated_dynamic_force_n`` over ``time`` [s], at the rate of the model: Δf =
            (M_dry + m_l) ü − F_ext [N], upward positive, as measured and as simulated. NaN while the delays fill.

        Raises
        ------
        InputError
            If the recording is bad.
        """
        recording, _ = sloshing_run(run_source(run), self.trained.runs.still.reference)
        of_run = signals_of(recording, self.trained.runs.rig, self.trained.runs.dry)
        signals = of_run.at_rate(self.model.sampling_rate_hz)
        free = self.model.simulate(signals.velocity_m_per_s, signals.dynamic_force_n)
        time = float(recording["time"][0]) + np.arange(free.size) / self.model.sampling_rate_hz
        words = {"units": "N", "long_name": "dynamic force of the liquid, upward positive"}
        variables = {
            "dynamic_force_n": ("time", signals.dynamic_force_n, words),
            "simulated_dynamic_force_n": ("time", free, words),
        }
        return xr.Dataset(variables, {"time": ("time", time, {"units": "s"})})

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the model, and its ensemble beside it; return its path.

        Parameters
        ----------
        path : path-like
            ``ROM.nc``; the ensemble goes to ``ROM_ensemble.nc``.
        overwrite : bool
            Whether a model that is there may be replaced.

        Raises
        ------
        InputError
            If a file is in the way.
        """
        return self._written(Path(path), None, overwrite)

    def report(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the model, and its validation report into a folder of its name beside it.

        Parameters
        ----------
        path : path-like
            ``ROM.nc``; the report goes into the folder ``ROM``.
        overwrite : bool
            Whether a model that is there may be replaced.

        Returns
        -------
        Path
            The report.

        Raises
        ------
        InputError
            If a file is in the way.
        """
        return report_folder(self._written(Path(path), self.call, overwrite)) / "report.html"

    def _written(self, path: Path, command: str | None, overwrite: bool) -> Path:
        has_ensemble = self.trained.ensemble is not None
        require_places(path, has_ensemble=has_ensemble, report=command is not None, overwrite=overwrite)
        write_training(
            self.trained, self.test, path, command=command, overwrite=overwrite, known_sha256=self.hashes
        )
        return path

    def _repr_html_(self) -> str:
        best = self.trained.record.best
        lines = [
            f"free run on the validation run: fit {self.fit_percent:.1f} %, error {self.rms_error_n:.3g} N RMS",
            f"{len(self.trained.record.epochs)} epochs, {self.trained.record.ended}; kept: epoch {best.number}",
            f"rate: {self.trained.runs.rate.reason}",
        ]
        return html.card("Reduced-order model of the liquid", lines, flags=self.flags)


def train(
    runs: RunsLike,
    rig: RigLike,
    *,
    still: RunsLike | None = None,
    test: RunsLike | None = None,
    model: str = "nfir",
    delays: int = 70,
    output_delays: int = 2,
    neurons: int = 35,
    network: str = "normalised_rbf",
    rate_hz: float | None = None,
    epochs: int = 60,
    starts: int = 1,
    seed: int = 0,
    galilean: bool = False,
    weigh_small_motion: bool = False,
    memory_s: float | None = None,
    sudden_start: RunsLike | None = None,
    ensemble: int = 0,
) -> LiquidModel:
    """Train a reduced-order model of the liquid on runs of the shaker.

    Parameters
    ----------
    runs : paths, xarray.Datasets, or an xarray.DataTree
        Sloshing runs; the last one validates, all others train.
    rig : path or Rig
    still, test, sudden_start : path, xarray.Dataset, or several of them, optional
        Empty or frozen runs, for the dry mass; further runs, for the report only; runs from rest, for the
        break-up.
    model : {"nfir", "noe"}
        Without feedback, or with its own past forces.
    delays, output_delays : int
        Past velocities, and with ``noe`` past forces.
    neurons : int
    network : str
        ``normalised_rbf``, ``rbf`` or ``multilayer``.
    rate_hz : float, optional
        Rate of the model [Hz]; by default chosen from the runs.
    epochs, starts, seed : int
        At most so many epochs, from so many starts; the same seed gives the same model.
    galilean : bool
        Whether the network sees past velocities without their mean, so that a constant one changes nothing.
    weigh_small_motion : bool
        Whether errors count by the inverse square of the local amplitude, up to eight times.
    memory_s : float, optional
        Time constant of a slow state of the liquid [s].
    ensemble : int
        Members of an ensemble for intervals; 0 for none.

    Returns
    -------
    LiquidModel
        Nothing is written before its `report` or `save`.

    Raises
    ------
    InputError
        If a recording, the rig or their combination is bad.

    Notes
    -----
    The command `sloshlab train` does the same; networks, training and validation are in
    ``docs/reduced_order_model.md``.
    """
    more = {name: () if given is None else tuple(run_sources(given)) for name, given in (
        ("still", still), ("test", test), ("sudden_start", sudden_start))}  # fmt: skip
    files = RunFiles.of(run_sources(runs), more["still"], rig_source(rig))
    require_new_runs(more["test"], files)
    wanted = ModelSettings(
        model,
        delays,
        output_delays,
        neurons,
        network=network,
        rate_hz=rate_hz,
        memory_s=memory_s,
        sudden_starts=more["sudden_start"],
        n_members=ensemble,
        weighs_small_motion=weigh_small_motion,
    )
    settings = TrainingSettings(n_epochs=epochs, n_starts=starts, seed=seed, galilean=galilean)
    trained = trained_model(files, wanted, settings)
    used = (*files.training, *files.validation)
    call = call_text("train", used, rig=files.rig, model=model, delays=delays, neurons=neurons, seed=seed)
    hashes = hashes_of((*used, *more["test"], *files.still, files.rig, *more["sudden_start"]))
    return LiquidModel(trained, call, hashes, more["test"])
