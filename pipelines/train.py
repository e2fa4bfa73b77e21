"""The command `train`: a reduced-order model of the liquid from runs on the shaker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipelines.outputs import sha256_of
from pipelines.progress import amounts
from pipelines.sweep_stages import naming, require_usable
from sloshlab.conditioning.calibration import DryMass, check_signs, identify_dry_mass
from sloshlab.conditioning.combined_channels import acceleration_channels, force_channels
from sloshlab.errors import AnalysisError, InputError
from sloshlab.recording import read_recording
from sloshlab.reduced_order_model.fit_quality import FitQuality, fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals, liquid_signals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.model_rate import ModelRate, chosen_rate
from sloshlab.reduced_order_model.network_list import NETWORKS
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.training import Epoch, TrainingRecord, TrainingSettings, fit
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from sloshlab.rig import Rig


@dataclass(frozen=True)
class ModelSettings:
    """What is to be trained.

    Attributes
    ----------
    structure : {"nfir", "noe"}
        Without feedback, or with its own outputs fed back.
    delays, output_delays : int
        Length of the delay lines; output delays of NOE only.
    neurons : int
    network : str
        One of `NETWORKS`.
    rate_hz : float, optional
        By default chosen from the data.
    """

    structure: str
    delays: int
    output_delays: int
    neurons: int
    network: str = "normalised_rbf"
    rate_hz: float | None = None

    def checked(self) -> ModelSettings:
        """Return self if nothing is impossible.

        Raises
        ------
        InputError
            If something is.
        """
        if self.structure not in ("nfir", "noe"):
            raise InputError("--model", got=repr(self.structure), allowed="nfir, noe")
        if self.network not in NETWORKS:
            raise InputError("--network", got=repr(self.network), allowed=", ".join(NETWORKS))
        return self

    def delay_lines(self) -> Delays:
        """Return the delays of the model."""
        return Delays.tapped(self.delays, self.output_delays if self.structure == "noe" else 0)


@dataclass(frozen=True)
class TrainedModel:
    """A model with all that a report of it needs.

    Attributes
    ----------
    model : ReducedOrderModel
    record : TrainingRecord
    training, validation : list of LiquidSignals
        At the rate of the model.
    rate : ModelRate
    quality : FitQuality
        Of the free run over all validation runs together.
    flags : tuple of str
    """

    model: ReducedOrderModel
    record: TrainingRecord
    training: list[LiquidSignals]
    validation: list[LiquidSignals]
    rate: ModelRate
    quality: FitQuality
    flags: tuple[str, ...]


def trained_model(
    training: Sequence[Path],
    validation: Sequence[Path],
    still: Sequence[Path],
    rig_path: Path,
    wanted: ModelSettings,
    settings: TrainingSettings,
) -> TrainedModel:
    """Train a model on some runs of the shaker and validate it on others.

    Parameters
    ----------
    training, validation, still : sequence of Path
        Recordings; the still ones, empty or frozen, identify the dry mass.
    rig_path : Path
    wanted : ModelSettings
    settings : TrainingSettings

    Raises
    ------
    InputError
        If a recording, the rig or their combination is bad.
    """
    wanted, rig = wanted.checked(), Rig.from_toml(rig_path)
    _require_different(training, validation)
    dry = _dry_mass(still, rig)
    signals = [[_signals(path, rig, dry) for path in paths] for paths in (training, validation)]
    rate = chosen_rate(signals[0])
    rate_hz = wanted.rate_hz or rate.sampling_rate_hz
    fast, slow = ([one.at_rate(rate_hz) for one in group] for group in signals)
    with amounts("train") as advance:

        def told(epoch: Epoch) -> None:
            advance(
                epoch.start * (settings.n_epochs + 1) + epoch.number, settings.n_starts * (settings.n_epochs + 1)
            )

        model, record = fit(
            wanted.network,
            _network_settings(wanted),
            wanted.delay_lines(),
            [one.run() for one in fast],
            [one.run() for one in slow],
            rate_hz,
            settings,
            told=told,
        )
    domain = ValidityDomain.of([motion_cycles(one.velocity_m_per_s, rate_hz) for one in fast])
    model.facts.update(_facts(training, validation, rig, dry, record, domain))
    flags = [] if dry is not None else [f"dry mass taken from {rig_path.name}, not identified; give --still runs"]
    flags += ["training was interrupted; the best model so far is kept"] if record.interrupted else []
    return TrainedModel(model, record, fast, slow, rate, _quality(model, slow), tuple(flags))


def _network_settings(wanted: ModelSettings) -> dict[str, Any]:
    if wanted.network == "multilayer":
        return {"layers": str(wanted.neurons)}
    return {"n_neurons": wanted.neurons}


def write_model(trained: TrainedModel, output: Path) -> dict[str, Any]:
    """Write the model; return what is to be said.

    Parameters
    ----------
    trained : TrainedModel
    output : Path
    """
    save_model(trained.model, output)
    best, quality = trained.record.best, trained.quality
    lines = [
        f"model: {output}",
        f"rate: {trained.rate.reason}",
        f"training: {len(trained.record.epochs)} epochs, {trained.record.ended}; kept: epoch {best.number} of "
        f"start {best.start}",
        f"free run on the validation runs: fit {quality.fit_percent:.1f} % (as printed in the source "
        f"{quality.fit_percent_as_printed:.1f} %), error {quality.rms_error:.3g} N RMS",
    ]
    return {
        "lines": lines,
        "flags": list(trained.flags),
        "output": str(output),
        "fit_percent": quality.fit_percent,
        "fit_percent_as_printed": quality.fit_percent_as_printed,
        "rms_error_n": quality.rms_error,
        "epochs": len(trained.record.epochs),
        "sampling_rate_hz": trained.model.sampling_rate_hz,
    }


def _require_different(training: Sequence[Path], validation: Sequence[Path]) -> None:
    hashes = {sha256_of(path): path for path in training}
    for path in validation:
        if sha256_of(path) in hashes:
            raise InputError(
                f"validation run {path}",
                got=f"the training run {hashes[sha256_of(path)]}",
                allowed="a run that the model is not trained on",
                remedy="record another run, or split off one of several training runs",
            )


def _dry_mass(paths: Sequence[Path], rig: Rig) -> DryMass | None:
    if not paths:
        return None
    runs: dict[str, list[xr.Dataset]] = {"empty": [], "frozen": []}
    for path in paths:
        recording = _usable(path, rig)
        configuration = str(recording.attrs.get("configuration"))
        if configuration not in runs:
            raise AnalysisError(
                f"{path}: configuration", got=repr(configuration), allowed="empty or frozen with --still"
            )
        runs[configuration].append(recording)
    first = (runs["empty"] + runs["frozen"])[0]
    return identify_dry_mass(
        runs["empty"],
        runs["frozen"],
        liquid_mass_kg=rig.liquid_mass_kg,
        force_names=force_channels(first),
        acceleration_names=acceleration_channels(first),
    )


def _usable(path: Path, rig: Rig) -> xr.Dataset:
    with naming(path):
        recording = read_recording(path)
        require_usable(recording, path)
        check_signs(recording, rig)
    return recording


def _signals(path: Path, rig: Rig, dry: DryMass | None) -> LiquidSignals:
    recording = _usable(path, rig)
    if recording.attrs.get("configuration") != "sloshing":
        raise AnalysisError(
            f"{path}: configuration", got=repr(recording.attrs.get("configuration")), allowed="sloshing"
        )
    if dry is None:
        return liquid_signals(recording, rig)
    return liquid_signals(recording, rig, dry_mass_kg=dry.mass_kg, gain_ratio=dry.gain_ratio)


def _quality(model: ReducedOrderModel, runs: Sequence[LiquidSignals]) -> FitQuality:
    simulated = [model.simulate(one.velocity_m_per_s, one.dynamic_force_n) for one in runs]
    return fit_quality(np.concatenate([one.dynamic_force_n for one in runs]), np.concatenate(simulated))


def _facts(
    training: Sequence[Path],
    validation: Sequence[Path],
    rig: Rig,
    dry: DryMass | None,
    record: TrainingRecord,
    domain: ValidityDomain,
) -> dict[str, Any]:
    return {
        "training": {path.name: sha256_of(path) for path in training},
        "validation": {path.name: sha256_of(path) for path in validation},
        "fill_level": rig.liquid.fill_level,
        "tank_height_m": rig.tank.height_m,
        "liquid_mass_kg": rig.liquid_mass_kg,
        "dry_mass_kg": rig.tank.dry_mass_kg if dry is None else dry.mass_kg,
        "training_mse_n2": record.best.training_mse,
        "validation_mse_n2": record.best.validation_mse,
        "domain": domain.facts(),
    }
