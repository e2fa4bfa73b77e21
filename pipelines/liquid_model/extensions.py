"""What `sloshlab train` can add to a model: memory of the liquid, an ensemble for prediction intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pipelines.inputs.recordings import RunSource
from pipelines.liquid_model.model_settings import ModelSettings
from pipelines.liquid_model.training_runs import TrainingRuns, require_new_runs, signals_of, sloshing_run
from pipelines.report.progress import amounts
from sloshlab.reduced_order_model.break_up_fit import with_break_up
from sloshlab.reduced_order_model.ensemble import Ensemble, fit_ensemble
from sloshlab.reduced_order_model.liquid_at_rest import from_rest
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.training import Epoch, TrainingSettings

REST_S: Final = 1.0
"""Of rest before a sudden start, so that delay lines and memory are filled from the first instant on."""


def remembering(model: ReducedOrderModel, starts: Sequence[RunSource], runs: TrainingRuns) -> ReducedOrderModel:
    """Return a model whose break-up follows recordings of sudden starts.

    Parameters
    ----------
    model : ReducedOrderModel
        Trained on the training runs.
    starts : sequence of Path or RecordingInMemory
        Recordings that begin with the liquid at rest; on the rig of the runs.
    runs : TrainingRuns

    Raises
    ------
    InputError
        If a recording is bad or one of the others.
    """
    require_new_runs(starts, runs.files)
    signals = [signals_of(sloshing_run(path, runs.still.reference)[0], runs.rig, runs.dry) for path in starts]
    rested = [from_rest(signal, runs.rate_hz, rest_s=REST_S) for signal in signals]
    found = with_break_up(model, [signals.run() for signals in (*runs.training, *rested)])
    found.facts["sudden_starts"] = [path.name for path in starts]
    return found


def trained_ensemble(
    model: ReducedOrderModel, wanted: ModelSettings, runs: TrainingRuns, settings: TrainingSettings
) -> Ensemble:
    """Train an ensemble of the structure of a model.

    Parameters
    ----------
    model : ReducedOrderModel
    wanted : ModelSettings
        How many members, and how errors count.
    runs : TrainingRuns
    settings : TrainingSettings
        Of every member.
    """
    network = dict(model.network.settings())
    network.pop("n_inputs")
    with amounts("ensemble") as advance:

        def show_epoch(member: int, epoch: Epoch) -> None:
            per_member = settings.n_starts * (settings.n_epochs + 1)
            done = member * per_member + epoch.start * (settings.n_epochs + 1) + epoch.number + 1
            advance(done, wanted.n_members * per_member)

        ensemble, _ = fit_ensemble(
            model.network.kind,
            network,
            Delays(model.delays.inputs, model.delays.outputs),
            wanted.runs(runs.training),
            wanted.runs(runs.validation),
            sampling_rate_hz=runs.rate_hz,
            settings=settings,
            n_members=wanted.n_members,
            agitation=model.agitation,
            on_epoch=show_epoch,
        )
    ensemble.facts.update(model.facts)
    return ensemble
