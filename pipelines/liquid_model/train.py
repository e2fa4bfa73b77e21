"""The command `train`: a reduced-order model of the liquid from runs on the shaker."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipelines.inputs.recordings import RunSource, attributes_of
from pipelines.liquid_model.extensions import remembering, trained_ensemble
from pipelines.liquid_model.model_settings import ModelSettings
from pipelines.liquid_model.training_runs import RunFiles, TrainingRuns, require_new_runs, training_runs
from pipelines.report.free_place import require_free_place
from pipelines.report.outputs import RESULT_ID, InMemory, provenance_of, sha256_of
from pipelines.report.progress import amounts
from pipelines.report.result_folder import require_result_folder, withdraw_result
from sloshlab import atomic_file
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.amplitude_weights import LARGEST_WEIGHT, WEIGHT_ONE_G
from sloshlab.reduced_order_model.ensemble import Ensemble
from sloshlab.reduced_order_model.ensemble_storage import load_ensemble, save_ensemble
from sloshlab.reduced_order_model.fit_quality import FitQuality, fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.stability import stability
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.tank_scaling import filled_model
from sloshlab.reduced_order_model.training import Epoch, TrainingRecord, TrainingSettings, fit
from sloshlab.reduced_order_model.validity_domain import ValidityDomain

REPORT_FILES: Final = ("report.html", "training_curve.nc", "maps.nc", "residual.nc")
"""Of a validation; some are written only if the runs allow it, but nothing may be in their way after hours."""


@dataclass(frozen=True)
class TrainedModel:
    """A model with all that a report of it needs.

    Attributes
    ----------
    model : ReducedOrderModel
    record : TrainingRecord
    runs : TrainingRuns
    wanted : ModelSettings
        What was to be trained.
    settings : TrainingSettings
    quality : FitQuality
        Of the free run over all validation runs together.
    ensemble : Ensemble, optional
    """

    model: ReducedOrderModel
    record: TrainingRecord
    runs: TrainingRuns
    wanted: ModelSettings
    settings: TrainingSettings
    quality: FitQuality
    ensemble: Ensemble | None = None

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using the model."""
        interrupted = ("training was interrupted; the best model so far is kept",)
        return self.runs.flags + (interrupted if self.record.interrupted else ())


def trained_model(files: RunFiles, wanted: ModelSettings, settings: TrainingSettings) -> TrainedModel:
    """Train a model on some runs of the shaker and validate it on others.

    Parameters
    ----------
    files : RunFiles
    wanted : ModelSettings
    settings : TrainingSettings

    Raises
    ------
    InputError
        If a recording, the rig or their combination is bad.
    """
    wanted = wanted.checked()
    runs = training_runs(files, wanted.rate_hz)
    n_epochs = (settings.n_epochs + 1) * (2 if wanted.structure == "noe" else 1)
    with amounts("train") as advance:

        def show_epoch(epoch: Epoch) -> None:
            done = epoch.start * n_epochs + epoch.number + 1
            errors = f"epoch {epoch.number}, error {epoch.training_mse**0.5:.4g} N, validation "
            advance(done, settings.n_starts * n_epochs, f"{errors}{epoch.validation_mse**0.5:.4g} N")

        model, record = fit(
            wanted.network,
            wanted.network_settings(),
            wanted.delay_lines(),
            wanted.runs(runs.training),
            wanted.runs(runs.validation),
            sampling_rate_hz=runs.rate_hz,
            settings=settings,
            agitation=wanted.agitation(),
            on_epoch=show_epoch,
        )
    errors = {"training_mse_n2": record.best.training_mse, "validation_mse_n2": record.best.validation_mse}
    model.facts.update(runs.facts() | errors)
    ensemble = trained_ensemble(model, wanted, runs, settings) if wanted.n_members else None
    if wanted.sudden_starts:
        model = remembering(model, wanted.sudden_starts, runs)
    return TrainedModel(model, record, runs, wanted, settings, _quality(model, runs.validation), ensemble)


def write_model(trained: TrainedModel, output: Path, place: Path) -> dict[str, Any]:
    """Write the model, and its ensemble beside it; return the summary of the command.

    Parameters
    ----------
    trained : TrainedModel
    output : Path
        What the summary calls it.
    place : Path
        Where it is written.
    """
    save_model(trained.model, place)
    if trained.ensemble is not None:
        save_ensemble(trained.ensemble, ensemble_file(place))
    best, quality = trained.record.best, trained.quality
    forgetting = stability(trained.model, [signals.velocity_m_per_s for signals in trained.runs.training])
    lines = [
        f"model: {output}",
        f"rate: {trained.runs.rate.reason}",
        f"training: {len(trained.record.epochs)} epochs, {trained.record.ended}; kept: epoch {best.number} of "
        f"start {best.start}",
        f"free run on the validation runs: fit {quality.fit_percent:.1f} % (as printed in the source "
        f"{quality.fit_percent_as_printed:.1f} %), error {quality.rms_error:.3g} N RMS",
        forgetting.line("N"),
        *_extension_lines(trained, output),
    ]
    unstable = (
        [] if forgetting.is_stable else ["the model does not forget its start: small errors grow in a free run"]
    )
    return {
        "lines": lines,
        "flags": [*trained.flags, *unstable],
        "output": str(output),
        "fit_percent": quality.fit_percent,
        "fit_percent_as_printed": quality.fit_percent_as_printed,
        "rms_error_n": quality.rms_error,
        "epochs": len(trained.record.epochs),
        "sampling_rate_hz": trained.model.sampling_rate_hz,
    }


def train_and_report(
    files: RunFiles,
    test: Sequence[RunSource],
    wanted: ModelSettings,
    settings: TrainingSettings,
    output: Path,
    *,
    command: str | None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Train, write the model, and write the report into a folder of its name beside it.

    Parameters
    ----------
    files : RunFiles
    test : sequence of Path or RecordingInMemory
        Further runs, for the report.
    wanted : ModelSettings
    settings : TrainingSettings
    output : Path
        The model; the report goes to the folder of that name without its suffix.
    command : str, optional
        What the user typed, for the report; without it there is no report.
    overwrite : bool
        Whether a model that is there may be replaced.

    Raises
    ------
    InputError
        If a recording, the rig or their combination is bad, or there is no place for the report.
    """
    # what can be refused is refused before hours of training
    require_new_runs(test, files)
    require_places(output, has_ensemble=wanted.n_members > 0, report=command is not None, overwrite=overwrite)
    for run in test if command is not None else ():
        attributes_of(run)  # before hours of training, not after them
    trained = trained_model(files, wanted, settings)
    return write_training(trained, test, output, command=command, overwrite=overwrite)


def require_places(output: Path, *, has_ensemble: bool, report: bool, overwrite: bool) -> None:
    """Refuse places that a model, its ensemble and its report cannot take.

    Parameters
    ----------
    output : Path
        The model.
    has_ensemble, report : bool
        Whether they will be written, too.
    overwrite : bool
        Whether a model that is there may be replaced.

    Raises
    ------
    InputError
        If something is in the way.
    """
    require_free_place(output, overwrite=overwrite, described="model")
    if has_ensemble:
        require_free_place(ensemble_file(output), overwrite=overwrite, described="ensemble")
    if report:
        require_result_folder(report_folder(output), REPORT_FILES)


def write_training(
    trained: TrainedModel,
    test: Sequence[RunSource],
    output: Path,
    *,
    command: str | None,
    overwrite: bool = False,
    known_sha256: Mapping[Path | InMemory, str] | None = None,
) -> dict[str, Any]:
    """Write a trained model, and the report into a folder of its name beside it; return the summary.

    Parameters
    ----------
    trained : TrainedModel
    test : sequence of Path or RecordingInMemory
        Further runs, for the report.
    output : Path
        The model.
    command : str, optional
        What the user typed, for the report; without it there is no report.
    overwrite : bool
        Whether a model that is there may be replaced.
    known_sha256 : mapping, optional
        Hashes of inputs that need not be computed again.
    """
    files, wanted, settings = trained.runs.files, trained.wanted, trained.settings
    folder, ensemble = report_folder(output), _ensemble_of(output)
    inputs = (*files.training, *files.validation, *test, *files.still, files.rig, *wanted.sudden_starts)
    provenance = provenance_of(command or "", inputs, known_sha256, settings=(wanted, settings))
    # model, ensemble and report of one training belong together
    for facts in (trained.model.facts, *([trained.ensemble.facts] if trained.ensemble is not None else [])):
        facts[RESULT_ID] = provenance[RESULT_ID]
    with atomic_file.together() as stagings:
        summary = write_model(trained, output, stagings.file(output, overwrite=overwrite))
        # what an earlier training left beside its model would be taken for that of the new one
        withdraw_result(folder, stagings)
        if ensemble is not None and not wanted.n_members:
            stagings.folder(ensemble.parent).removed.append(ensemble)
    if command is None:
        return summary
    # after the model, which took hours: whatever happens to the report, `sloshlab validate` makes another
    from pipelines.liquid_model.outputs import write_validation
    from pipelines.liquid_model.results import Training

    training = Training(trained.record, settings, trained.runs.rate.reason)
    of_report = write_validation(
        trained.model, trained.runs, test, folder, provenance=provenance, training=training
    )
    lines, flags = (
        summary["lines"] + of_report.pop("lines"),
        dict.fromkeys([*summary["flags"], *of_report.pop("flags")]),
    )
    return summary | of_report | {"lines": lines, "flags": list(flags)}


def _extension_lines(trained: TrainedModel, output: Path) -> list[str]:
    """What there is beyond the model without memory."""
    lines = []
    if trained.settings.galilean:
        lines.append("past velocities without their mean: a constant one changes nothing")
    if trained.wanted.weighs_small_motion:
        lines.append(
            f"errors of training and validation counted up to {LARGEST_WEIGHT} times where the motion is below "
            f"{WEIGHT_ONE_G:g} g"
        )
    if (break_up := trained.model.break_up) is not None:
        lines.append(
            f"break-up: growth {break_up.growth_per_s:.3g}/s, exponent {break_up.exponent:.2g}, "
            f"calming {break_up.calming_s:.3g} s, {100 * break_up.at_rest:.2g} % broken up at rest"
        )
    if trained.ensemble is not None:
        residual = trained.ensemble.residual
        lines.append(
            f"ensemble: {ensemble_file(output)}, {len(trained.ensemble.members)} members; "
            f"residual on the validation runs {residual.constant:.3g} N and {residual.slope:.2g} of the force"
        )
    return lines


def ensemble_file(model: Path) -> Path:
    """Return where the ensemble of a model goes."""
    return model.with_name(f"{model.stem}_ensemble.nc")


def _ensemble_of(model: Path) -> Path | None:
    """The ensemble that was trained with a model that is there."""
    ensemble = ensemble_file(model).absolute()
    if not (model.is_file() and ensemble.is_file()):
        return None
    try:
        of_model, of_ensemble = load_model(model).facts, load_ensemble(ensemble).facts
    except InputError:
        return None
    belongs = RESULT_ID in of_model and of_model[RESULT_ID] == of_ensemble.get(RESULT_ID)
    return ensemble if belongs else None


def report_folder(model: Path) -> Path:
    """Return where the report of a model goes.

    Examples
    --------
    >>> report_folder(Path("results/ROM.nc")).as_posix(), report_folder(Path("ROM")).as_posix()
    ('results/ROM', 'ROM_report')
    """
    return model.with_suffix("") if model.suffix else model.with_name(f"{model.name}_report")


def validate_model(
    path: Path, files: RunFiles, test: Sequence[RunSource], folder: Path, command: str
) -> dict[str, Any]:
    """Write the report of a model that is there already.

    Raises
    ------
    InputError
        If the model is damaged, was trained on one of the runs, or a run is bad.
    """
    from pipelines.liquid_model.outputs import write_validation

    require_result_folder(folder, REPORT_FILES)
    model = load_model(path)
    try:
        ValidityDomain.of_facts(model.facts["domain"])
        known = set(dict(model.facts["training"]).values())
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(
            f"model {path}",
            got="no domain of validity or no training runs",
            allowed="a model of `sloshlab train` or `sloshlab study`",
        ) from None
    for run in (*files.validation, *test):
        if sha256_of(run) in known:
            raise InputError(f"run {run}", got="one that the model was trained on", allowed="other runs")
    require_new_runs(test, files)
    runs = training_runs(files, model.sampling_rate_hz)
    model = filled_model(model, runs.rig.liquid.fill_level)
    inputs = (path, *files.validation, *test, *files.still, files.rig)
    provenance = provenance_of(command, inputs, settings="validation")
    return write_validation(model, runs, test, folder, provenance=provenance)


def _quality(model: ReducedOrderModel, runs: Sequence[LiquidSignals]) -> FitQuality:
    simulated = [model.simulate(run.velocity_m_per_s, run.dynamic_force_n) for run in runs]
    return fit_quality(np.concatenate([run.dynamic_force_n for run in runs]), np.concatenate(simulated))
