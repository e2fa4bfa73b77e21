"""What a rival may know of a case, computed once and kept: errors of the retuned baseline, models, features."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from campaigns.task import Ending, Task
from campaigns.where import Where, executor_of
from campaigns.working import work_through
from pipelines.report.progress import progress
from sealed_trial.scoring.rivals import metadata_features
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError, SloshlabError
from studies.rivals.baseline import retuned_baseline
from studies.rivals.regressed_models import RegressedModel, regressed_models
from studies.rivals.signal_features import features_of

HERE: Final = Where(n_workers=2)
_FORMAT: Final = 1
"""Of the files; another one is computed anew."""


@dataclass(frozen=True)
class Seen:
    """One case.

    Attributes
    ----------
    case : str
    fitted, judged : float
        Mean squares of the whitened residuals of the retuned baseline, of fitted and of held-out runs.
    models : tuple of RegressedModel
    features, metadata : dict
        Numbers by name: of the signals, and of everything but the signals.
    seconds : float
        Of the processor, all together.
    trouble : str
        Why there is nothing of it; empty where there is.
    """

    case: str
    fitted: float = 1.0
    judged: float = 1.0
    models: tuple[RegressedModel, ...] = ()
    features: dict[str, float] | None = None
    metadata: dict[str, float] | None = None
    seconds: float = 0.0
    trouble: str = ""


def seen_cases(trial: Path, kept: Path, cases: Sequence[str] = (), *, where: Where = HERE) -> list[Seen]:
    """Every case of a trial; what is kept already is read.

    Parameters
    ----------
    trial : Path
        Made by ``sloshlab trial seal``.
    kept : Path
        Folder with one file a case.
    cases : sequence of str, optional
        Names; all by default.
    where : Where
        Processes of this machine, or a cluster.

    Raises
    ------
    InputError
        If a case cannot be looked at.
    """
    names = list(cases) or sorted(path.name for path in (trial / "cases").iterdir())
    files = {name: kept.absolute() / f"{name}.json" for name in names}
    missing = [name for name in names if _known(files[name]) is None]

    def task_of(name: str) -> Task:
        arguments = {"case": str((trial / "cases" / name).absolute()), "file": str(files[name])}
        return Task(name, "studies.rivals.seen:keep_seen", arguments)

    with progress(f"looking at {trial.resolve().name}", len(missing)) as advance:

        def finished(number: int, ending: Ending) -> None:
            if ending.status != "done":
                raise InputError(f"case {missing[number]}", got=ending.line or ending.status)
            advance(missing[number])

        work_through(map(task_of, missing), executor_of(where), finished=finished)
    found = {name: _known(file) for name, file in files.items()}
    lost = [name for name, seen in found.items() if seen is None]
    if lost:
        raise InputError(f"case {lost[0]}", got="nothing that could be read back", remedy="give the command again")
    return [seen for seen in found.values() if seen is not None]


def _known(file: Path) -> Seen | None:
    """What is kept of a case, if it has the format of today."""
    if not file.is_file():
        return None
    document = json.loads(file.read_bytes())
    return _read(document) if document.pop("format", None) == _FORMAT else None


def keep_seen(arguments: Mapping[str, Any], say_share: Callable[[float], None]) -> None:
    """Look at a case and keep what is seen; this is what a worker does.

    Parameters
    ----------
    arguments : mapping
        Folder of the ``case``, and ``file``.
    say_share : callable
    """
    file = Path(arguments["file"])
    file.parent.mkdir(parents=True, exist_ok=True)
    seen = looked_at(Path(arguments["case"]))
    document = {"format": _FORMAT, **asdict(seen), "models": [model.to_document() for model in seen.models]}
    write_bytes(file, (json.dumps(document) + "\n").encode())


def _read(document: dict[str, Any]) -> Seen:
    models = tuple(RegressedModel.from_document(model) for model in document["models"])
    return Seen(**{**document, "models": models})


def looked_at(case: Path) -> Seen:
    """Retune, regress and describe a case.

    Parameters
    ----------
    case : Path
        Folder with rig and recordings; nothing else is opened.
    """
    start = time.process_time()
    try:
        found = retuned_baseline(case)
        models = regressed_models(found)
        features = features_of(found, models)
    except SloshlabError as error:
        # A case that one rival cannot simulate is answered by nobody who needs the simulation.
        return Seen(case.name, metadata=metadata_features(case), trouble=str(error))
    judged = found.retuned.held_out_rms if found.held_out else found.retuned.fitted_rms
    return Seen(
        case.name,
        found.retuned.fitted_rms**2,
        judged**2,
        tuple(models),
        features,
        metadata_features(case),
        time.process_time() - start,
    )
