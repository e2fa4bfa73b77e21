"""How delays and neurons change a model (Fig. 2.26): many trainings, in processes, stopped and continued at will.

Every case leaves its model and a line of numbers in a folder of its own; started again, the study keeps those
that were trained on the same signals with the same settings.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from campaigns.executor import Executor
from campaigns.local_executor import LocalExecutor
from campaigns.task import Ending, Task
from campaigns.working import work_through
from pipelines.liquid_model.stored_signals import read_signals, write_signals
from pipelines.liquid_model.study_cases import SOURCE_CASES, CaseResult, StudyCase
from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import AnalysisError, InputError, SloshlabError
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.training import Epoch, TrainingSettings, fit

RESULT_NAME: Final = "case.json"
MODEL_NAME: Final = "model.nc"
_SIGNALS_NAME: Final = ".signals.npz"


@dataclass(frozen=True)
class _Task:
    case: StudyCase
    folder: Path
    made_of: str
    training: tuple[Run, ...]
    validation: tuple[Run, ...]
    sampling_rate_hz: float
    settings: TrainingSettings
    facts: dict[str, Any] = field(default_factory=dict)


def sensitivity_study(
    training: Sequence[Run],
    validation: Sequence[Run],
    sampling_rate_hz: float,
    folder: Path,
    settings: TrainingSettings,
    *,
    cases: Sequence[StudyCase] = SOURCE_CASES,
    n_workers: int = 2,
    facts: Mapping[str, Any] | None = None,
    on_case: Callable[[CaseResult, int, int], None] | None = None,
    on_progress: Callable[[float], None] | None = None,
    executor: Executor | None = None,
) -> list[CaseResult]:
    """Train every case that has not been trained yet; return all results, the best by validation error first.

    Parameters
    ----------
    training, validation : sequence of Run
    sampling_rate_hz : float
    folder : Path
        One folder per case is made in it.
    settings : TrainingSettings
    cases : sequence of StudyCase
    n_workers : int
        Processes; each computes on one core.
    facts : mapping, optional
        Kept with every model.
    on_case : callable, optional
        Takes a result, how many are done, and how many there are.
    on_progress : callable, optional
        Takes the share of the whole study that is done, by the time it takes.
    executor : Executor, optional
        In place of processes of this machine.

    Raises
    ------
    InputError
        If there are no cases, or workers are none or too many.
    KeyboardInterrupt
        At Ctrl-C; cases that were done stay.
    """
    if not cases:
        raise InputError("study", got="no cases", allowed="at least one")
    signals = _hash_of(training, validation, sampling_rate_hz, settings)
    tasks = [
        _Task(
            case,
            folder / case.name,
            hashlib.sha256(f"{signals} {asdict(case)}".encode()).hexdigest(),
            tuple(training),
            tuple(validation),
            sampling_rate_hz,
            settings,
            dict(facts or {}),
        )
        for case in cases
    ]
    results = {task.case: known for task in tasks if (known := _known(task)) is not None}
    missing = sorted((task for task in tasks if task.case not in results), key=lambda task: -task.case.cost)
    shares = {task.case: 0.0 for task in missing}
    everything = sum(case.cost for case in cases)

    def progressed(number: int, share: float) -> None:
        shares[missing[number].case] = share
        if on_progress is not None:
            done = sum(case.cost * shares.get(case, 1.0) for case in cases)
            on_progress(done / everything)

    def finished(number: int, ending: Ending) -> None:
        case = missing[number].case
        known = _known(missing[number]) if ending.status == "done" else None
        results[case] = known or _failed(case, ending.line or "its result cannot be read")
        progressed(number, 1.0)
        if on_case is not None:
            on_case(results[case], len(results), len(tasks))

    # a task each: what one leaves behind in its process cannot touch another
    where = executor or LocalExecutor(n_workers, fresh=True)
    with _signals_in(folder / _SIGNALS_NAME, missing) as signals_file:
        handed = (_as_task(task, signals_file) for task in missing)
        work_through(handed, where, progressed=progressed, finished=finished)
    return sorted(results.values(), key=lambda result: (result.validation_mse, result.n_parameters))


@contextlib.contextmanager
def _signals_in(file: Path, tasks: Sequence[_Task]) -> Iterator[Path]:
    """The signals, which are those of all tasks, in a file that other processes read."""
    if tasks:
        write_signals(file, tasks[0].training, tasks[0].validation)
    try:
        yield file
    finally:
        file.unlink(missing_ok=True)


def _as_task(task: _Task, signals: Path) -> Task:
    arguments = {
        "case": asdict(task.case),
        "folder": str(task.folder.absolute()),
        "made_of": task.made_of,
        "signals": str(signals.absolute()),
        "sampling_rate_hz": task.sampling_rate_hz,
        "settings": asdict(task.settings),
        "facts": task.facts,
    }
    return Task(task.case.name, "pipelines.liquid_model.sensitivity_study:train_case_of_task", arguments)


def train_case_of_task(arguments: Mapping[str, Any], say_share: Callable[[float], None]) -> None:
    """Train one case as another process is told it; this is what a worker does.

    Parameters
    ----------
    arguments : mapping
        A `StudyCase`, the ``folder`` for its model, the file with the ``signals``, and settings.
    say_share : callable
    """
    training, validation = read_signals(Path(arguments["signals"]))
    task = _Task(
        StudyCase(**arguments["case"]),
        Path(arguments["folder"]),
        arguments["made_of"],
        training,
        validation,
        arguments["sampling_rate_hz"],
        TrainingSettings(**arguments["settings"]),
        arguments["facts"],
    )
    train_case(task, say_share)


def train_case(task: _Task, say_share: Callable[[float], None]) -> CaseResult:
    """Train one case and leave model and numbers in its folder.

    Raises
    ------
    KeyboardInterrupt
        If it was stopped; nothing is left behind then, so that the case is trained anew.
    """
    model, result = trained_case(
        task.case,
        task.training,
        task.validation,
        task.sampling_rate_hz,
        settings=task.settings,
        facts=task.facts,
        say_share=say_share,
    )
    if model is not None:
        save_model(model, task.folder / MODEL_NAME)
    content = {"made_of": task.made_of, "result": asdict(result)}
    atomic_file.write_bytes(task.folder / RESULT_NAME, (json.dumps(content, indent=1) + "\n").encode())
    return result


def trained_case(
    case: StudyCase,
    training: Sequence[Run],
    validation: Sequence[Run],
    sampling_rate_hz: float,
    *,
    settings: TrainingSettings,
    facts: Mapping[str, Any],
    say_share: Callable[[float], None],
) -> tuple[ReducedOrderModel | None, CaseResult]:
    """Train one case; the model is None if it could not be trained.

    Parameters
    ----------
    case : StudyCase
    training, validation : sequence of Run
    sampling_rate_hz : float
    settings : TrainingSettings
    facts : mapping
        Kept with the model.
    say_share : callable
        Called with the share of the epochs that is done.

    Raises
    ------
    KeyboardInterrupt
        If it was stopped.
    """
    n_epochs = settings.n_starts * (settings.n_epochs + 1) * (2 if case.output_delays else 1)

    def show_epoch(epoch: Epoch) -> None:
        say_share(min(1.0, (epoch.start * n_epochs / settings.n_starts + epoch.number + 1) / n_epochs))

    try:
        model, record = fit(
            case.network,
            {"layers": str(case.neurons)} if case.network == "multilayer" else {"n_neurons": case.neurons},
            Delays.tapped(case.delays, case.output_delays),
            training,
            validation,
            sampling_rate_hz=sampling_rate_hz,
            settings=settings,
            on_epoch=show_epoch,
        )
    except AnalysisError as error:
        return None, _failed(case, " ".join(str(error).split()))
    if record.interrupted:
        raise KeyboardInterrupt
    best = record.best
    model.facts.update(facts)
    model.facts.update(training_mse_n2=best.training_mse, validation_mse_n2=best.validation_mse)
    return model, CaseResult(
        case,
        best.training_mse,
        best.validation_mse,
        model.network.n_parameters,
        len(record.epochs),
        record.epochs[-1].elapsed_s,
        record.ended,
    )


def _failed(case: StudyCase, why: str) -> CaseResult:
    return CaseResult(case, math.inf, math.inf, 0, 0, 0.0, why)


def _hash_of(
    training: Sequence[Run], validation: Sequence[Run], rate_hz: float, settings: TrainingSettings
) -> str:
    digest = hashlib.sha256(f"{__version__} {rate_hz!r} {asdict(settings)}".encode())
    for group in (training, validation):
        digest.update(b"|")
        for run in group:
            digest.update(run.x.tobytes())
            digest.update(run.y.tobytes())
    return digest.hexdigest()


def _known(task: _Task) -> CaseResult | None:
    """The result of an earlier session, if it was of the same signals and settings."""
    try:
        content = json.loads((task.folder / RESULT_NAME).read_text(encoding="utf-8"))
        if content["made_of"] != task.made_of:
            return None
        return CaseResult(**{**content["result"], "case": StudyCase(**content["result"]["case"])})
    except (OSError, ValueError, KeyError, TypeError, SloshlabError):
        return None
