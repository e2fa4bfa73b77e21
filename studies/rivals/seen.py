"""What a rival may know of a case, computed once and kept: errors of the retuned baseline, models, features."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from pipelines.report.progress import progress
from sealed_trial.scoring.rivals import metadata_features
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import SloshlabError
from studies.rivals.baseline import retuned_baseline
from studies.rivals.regressed_models import RegressedModel, regressed_models
from studies.rivals.signal_features import features_of

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


def seen_cases(trial: Path, kept: Path, cases: Sequence[str] = ()) -> list[Seen]:
    """Every case of a trial; what is kept already is read.

    Parameters
    ----------
    trial : Path
        Made by ``sloshlab trial seal``.
    kept : Path
        Folder with one file a case.
    cases : sequence of str, optional
        Names; all by default.
    """
    names = list(cases) or sorted(path.name for path in (trial / "cases").iterdir())
    found = []
    with progress(f"looking at {trial.resolve().name}", len(names)) as advance:
        for name in names:
            found.append(_seen(trial / "cases" / name, kept / f"{name}.json"))
            advance(name)
    return found


def _seen(case: Path, file: Path) -> Seen:
    if file.is_file():
        document = json.loads(file.read_bytes())
        if document.pop("format", None) == _FORMAT:
            return _read(document)
    file.parent.mkdir(parents=True, exist_ok=True)
    seen = looked_at(case)
    document = {"format": _FORMAT, **asdict(seen), "models": [model.to_document() for model in seen.models]}
    write_bytes(file, (json.dumps(document) + "\n").encode())
    return seen


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
