"""How delays and neurons change a model (Fig. 2.26): many trainings, in processes, stopped and continued at will.

Every case leaves its model and a line of numbers in a folder of its own; started again, the study keeps those
that were trained on the same signals with the same settings.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import AnalysisError, InputError, SloshlabError
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit

RESULT_NAME: Final = "case.json"
MODEL_NAME: Final = "model.nc"


@dataclass(frozen=True)
class StudyCase:
    """One combination.

    Attributes
    ----------
    structure : {"nfir", "noe"}
    delays, output_delays, neurons : int
    network : str
    """

    structure: str
    delays: int
    output_delays: int
    neurons: int
    network: str = "normalised_rbf"

    @property
    def name(self) -> str:
        """Folder of the case.

        Examples
        --------
        >>> StudyCase("nfir", 70, 0, 35).name
        'nfir_70_35'
        """
        middle = f"{self.delays}" + (f"+{self.output_delays}" if self.output_delays else "")
        kind = "" if self.network == "normalised_rbf" else f"_{self.network}"
        return f"{self.structure}_{middle}_{self.neurons}{kind}"


SOURCE_CASES: Final = (
    *(StudyCase("nfir", delays, 0, neurons) for delays in (50, 60, 70) for neurons in range(5, 45, 5)),
    *(StudyCase("noe", 2, 2, neurons) for neurons in (10, 15, 20)),
)
"""24 NFIR and 3 NOE, as in the source."""


@dataclass(frozen=True)
class CaseResult:
    """What a case gave.

    Attributes
    ----------
    case : StudyCase
    training_mse, validation_mse : float
        In the square of the output's unit; infinite if it could not be trained.
    n_parameters, n_epochs : int
    seconds : float
        Of training.
    ended : str
        Why training ended, or failed.
    """

    case: StudyCase
    training_mse: float
    validation_mse: float
    n_parameters: int
    n_epochs: int
    seconds: float
    ended: str

    @property
    def mean_mse(self) -> float:
        """Mean of both, which is what the source shows."""
        return 0.5 * (self.training_mse + self.validation_mse)


@dataclass(frozen=True)
class _Task:
    case: StudyCase
    folder: Path
    made_of: str
    training: tuple[Run, ...]
    validation: tuple[Run, ...]
    sampling_rate_hz: float
    settings: TrainingSettings


def sensitivity_study(
    training: Sequence[Run],
    validation: Sequence[Run],
    sampling_rate_hz: float,
    folder: Path,
    settings: TrainingSettings,
    *,
    cases: Sequence[StudyCase] = SOURCE_CASES,
    n_workers: int = 2,
    told: Callable[[CaseResult, int, int], None] | None = None,
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
    told : callable, optional
        Takes a result, how many are done, and how many there are.

    Raises
    ------
    InputError
        If there are no cases or no workers.
    """
    if not cases or not 1 <= n_workers <= 256:
        raise InputError("study", got=f"{len(cases)} cases, {n_workers} workers", allowed="at least one of each")
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
        )
        for case in cases
    ]
    results = {task.case: known for task in tasks if (known := _known(task)) is not None}
    missing = sorted((task for task in tasks if task.case not in results), key=_cost, reverse=True)
    with _one_thread_each(), ProcessPoolExecutor(n_workers, mp_context=get_context("spawn")) as pool:
        running: list[Future[CaseResult]] = [pool.submit(train_case, task) for task in missing]
        try:
            for done in as_completed(running):
                result = done.result()
                results[result.case] = result
                if told is not None:
                    told(result, len(results), len(tasks))
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return sorted(results.values(), key=lambda result: result.validation_mse)


def train_case(task: _Task) -> CaseResult:
    """Train one case and leave model and numbers in its folder; this is what a worker does."""
    case = task.case
    delays = Delays.tapped(case.delays, case.output_delays)
    network: dict[str, Any] = {"n_neurons": case.neurons}
    if case.network == "multilayer":
        network = {"layers": str(case.neurons)}
    try:
        model, record = fit(
            case.network,
            network,
            delays,
            task.training,
            task.validation,
            task.sampling_rate_hz,
            task.settings,
        )
        save_model(model, task.folder / MODEL_NAME)
        result = CaseResult(
            case,
            record.best.training_mse,
            record.best.validation_mse,
            model.network.n_parameters,
            len(record.epochs),
            record.epochs[-1].elapsed_s,
            record.ended,
        )
    except AnalysisError as error:
        result = CaseResult(case, math.inf, math.inf, 0, 0, 0.0, " ".join(str(error).split()))
    content = {"made_of": task.made_of, "result": asdict(result)}
    atomic_file.write_bytes(task.folder / RESULT_NAME, (json.dumps(content, indent=1) + "\n").encode())
    return result


def _cost(task: _Task) -> int:
    case = task.case
    return (case.neurons * (case.delays + case.output_delays)) ** 2


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


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started within compute on one core each; a library reads this when it is loaded."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
