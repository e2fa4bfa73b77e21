"""Tasks that train one reduced-order model each: the cases of a sensitivity study."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from campaigns.stored_task import StoredTask
from pipelines.campaign.plan import TrainPart
from pipelines.campaign.recording_tasks import Files, matching
from pipelines.liquid_model.study import CASES
from sloshlab.errors import InputError


def training_tasks(part: TrainPart, kept_out: Path) -> list[StoredTask]:
    """One task for every case of the study.

    Parameters
    ----------
    part : TrainPart
        Without names of files: the runs of the tank filled half, as `make rom-study` takes them.
    kept_out : Path
        Recordings below it are results.

    Raises
    ------
    InputError
        If a recording or the rig is missing.
    """
    files = _files(part, kept_out)
    settings = {"n_epochs": part.epochs, "n_starts": part.starts, "seed": part.seed}
    return [
        StoredTask(
            f"{part.name}__{case.name}" if part.name else case.name,
            "pipelines.campaign.training_tasks:trained",
            files,
            {"case": asdict(case), "rate_hz": part.rate_hz, "settings": settings},
        )
        for case in sorted(CASES[part.cases], key=lambda case: -case.cost)
    ]


def _files(part: TrainPart, kept_out: Path) -> dict[str, list[Path]]:
    if part.validation is not None and part.rig is not None:
        found = {
            "training": matching(part.folder, part.training, kept_out),
            "validation": matching(part.folder, [part.validation], kept_out),
            "still": matching(part.folder, part.still, kept_out),
            "rig": matching(part.folder, [part.rig], kept_out),
        }
    else:
        found = _usual_files(part.folder)
    for role in ("training", "validation", "rig"):
        if not found[role] or (role == "rig" and len(found[role]) > 1):
            allowed = "one rig file" if role == "rig" else "at least one recording"
            raise InputError(f"{role} of {part.folder}", got=f"{len(found[role])} files", allowed=allowed)
    return found


def _usual_files(folder: Path) -> dict[str, list[Path]]:
    """The longest VFA run filled half trains, the shortest validates, still runs identify the dry mass."""
    vfa = sorted(folder.glob("fill_0.50_vfa_*.nc"), key=lambda path: (-path.stat().st_size, path.name))
    still = [path for kind in ("empty", "frozen") for path in sorted(folder.glob(f"fill_0.50_{kind}_*.nc"))]
    rig = folder / "rig_fill_0.50.toml"
    found = {"training": vfa[:1], "validation": vfa[1:][-1:], "still": still}
    return {**found, "rig": [rig] if rig.is_file() else []}


def trained(
    folder: Path, files: Files, arguments: Mapping[str, Any], say_share: Callable[[float], None]
) -> dict[str, Any]:
    """Train one case; this is what a worker does.

    Parameters
    ----------
    folder : Path
        Takes the model.
    files : mapping
        Runs for ``training`` and ``validation``, ``still`` runs, and the ``rig``.
    arguments : mapping
        The ``case`` of the study, the ``rate_hz`` and ``settings`` of the training.
    say_share : callable

    Raises
    ------
    InputError
        If a recording is bad, or the case cannot be trained.
    """
    from pipelines.liquid_model.sensitivity_study import MODEL_NAME, trained_case
    from pipelines.liquid_model.study_cases import StudyCase
    from pipelines.liquid_model.training_runs import RunFiles, training_runs
    from sloshlab.reduced_order_model.storage import save_model
    from sloshlab.reduced_order_model.training import TrainingSettings

    run_files = RunFiles(
        tuple(files["training"]), tuple(files["validation"]), tuple(files["still"]), files["rig"][0]
    )
    runs = training_runs(run_files, arguments["rate_hz"])
    case = StudyCase(**arguments["case"])
    model, result = trained_case(
        case,
        [signals.run() for signals in runs.training],
        [signals.run() for signals in runs.validation],
        runs.rate_hz,
        settings=TrainingSettings(**arguments["settings"]),
        facts=runs.facts(),
        say_share=say_share,
    )
    if model is None:
        raise InputError(f"case {case.name}", got=result.ended)
    save_model(model, folder / MODEL_NAME)
    numbers = {
        "training_rms_n": result.training_mse**0.5,
        "validation_rms_n": result.validation_mse**0.5,
        "n_parameters": result.n_parameters,
        "n_epochs": result.n_epochs,
    }
    return {"flags": list(runs.flags), "numbers": {"ended": result.ended, **numbers}}
