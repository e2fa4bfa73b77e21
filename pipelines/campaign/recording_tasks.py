"""Tasks that analyse one recording each: sweeps on the shaker, runs of a beam or a guided tank."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from campaigns.stored_task import StoredTask
from pipelines.campaign.plan import BeamPart, SweepPart
from pipelines.report.progress import progress
from sloshlab.configurations import SLOSHING, STILL_CONFIGURATIONS
from sloshlab.errors import InputError
from sloshlab.recording import RunAttributes, read_attributes_of_many

MOST_RECORDINGS: Final = 1_000_000
_AT_A_TIME: Final = 100
_OF_NO_WORKER: Final = {"folder", "name", "kind", "recordings", "rigs"}
"""Fields of a part that say which files there are, not what is done with them."""
Files = Mapping[str, Sequence[Path]]


@dataclass(frozen=True)
class _Found:
    path: Path
    attributes: RunAttributes
    rig: Path


def recording_tasks(part: SweepPart | BeamPart, kept_out: Path) -> list[StoredTask]:
    """One task for every sweep or VFA run with the still runs of its rig, or for every run of a structure.

    Parameters
    ----------
    part : SweepPart or BeamPart
    kept_out : Path
        Recordings below it are results.

    Raises
    ------
    InputError
        If a recording or its rig is missing or cannot be read.
    """
    found = _found(part, kept_out)
    if isinstance(part, BeamPart):
        return [_task(part, run, {}) for run in found]
    still: dict[tuple[Path, Path], list[Path]] = {}
    for run in found:
        if run.attributes.configuration in STILL_CONFIGURATIONS:
            still.setdefault((run.path.parent, run.rig), []).append(run.path)
    return [
        _task(part, run, {"still": still.get((run.path.parent, run.rig), [])})
        for run in found
        if run.attributes.configuration == SLOSHING
    ]


def _task(part: SweepPart | BeamPart, run: _Found, more: Files) -> StoredTask:
    worker = "analysed_beam" if isinstance(part, BeamPart) else "analysed_sweep"
    return StoredTask(
        name_of(part.name, run.path.relative_to(part.folder)),
        f"pipelines.campaign.recording_tasks:{worker}",
        {"recording": [run.path], **more, "rig": [run.rig]},
        part.model_dump(exclude=_OF_NO_WORKER),
    )


def analysed_sweep(
    folder: Path, files: Files, arguments: Mapping[str, Any], say_share: Callable[[float], None]
) -> dict[str, Any]:
    """Analyse one sweep; this is what a worker does.

    Parameters
    ----------
    folder : Path
        Takes the results.
    files : mapping
        ``recording``, ``still`` runs and ``rig``.
    arguments : mapping
        Settings of a `SweepPart`.
    say_share : callable
    """
    from pipelines.sweep.outputs import write_experiment
    from pipelines.sweep.shaker import ShakerSettings, analyse_shaker

    settings = ShakerSettings.checked(
        p=arguments["p"],
        m=arguments["m"],
        boundaries=arguments["boundaries"],
        allow_incomplete=arguments["allow_incomplete"],
    )
    experiment = analyse_shaker([*files["still"], *files["recording"]], files["rig"], settings)
    summary = write_experiment(experiment, folder, command=_command("shaker", files), report=arguments["report"])
    numbers = {name: summary[name] for name in ("windows", "unsteady_windows")}
    return {"flags": summary["flags"], "numbers": {"experiment": "sweep", **numbers}}


def analysed_beam(
    folder: Path, files: Files, arguments: Mapping[str, Any], say_share: Callable[[float], None]
) -> dict[str, Any]:
    """Analyse one run of a structure; this is what a worker does.

    Parameters
    ----------
    folder : Path
        Takes the results.
    files : mapping
        ``recording`` and ``rig``.
    arguments : mapping
        Settings of a `BeamPart`.
    say_share : callable
    """
    from pipelines.structure.analysis import analyse_beam, checked_settings
    from pipelines.structure.outputs import write_beam

    settings = checked_settings(
        modes=arguments["modes"], n_cycles=arguments["cycles"], segment_s=arguments["segment_s"]
    )
    experiment = analyse_beam(files["recording"], files["rig"][0], settings)
    summary = write_beam(experiment, folder, command=_command("beam", files), report=arguments["report"])
    damping = [*summary["mean_damping_ratio"].values(), *summary["random_damping_ratio"].values()]
    numbers = {"damping_ratio": float(damping[0])} if damping else {}
    return {"flags": summary["flags"], "numbers": {"experiment": experiment.kind, **numbers}}


def _command(command: str, files: Files) -> str:
    """The command that does the same with one recording."""
    runs = [path.name for role in ("still", "recording") for path in files.get(role, ())]
    return " ".join(["sloshlab", command, *runs, "--rig", files["rig"][0].name])


def name_of(part: str, path: Path) -> str:
    """Name of the task of a file: the parts of its path, without the suffix.

    Examples
    --------
    >>> name_of("shaker", Path("fill_0.50/sweep_3.00g.nc"))
    'shaker__fill_0.50__sweep_3.00g'
    """
    named = path.with_suffix("") if path.suffix == ".nc" else path
    return "__".join([*([part] if part else []), *named.parts])


def _found(part: SweepPart | BeamPart, kept_out: Path) -> list[_Found]:
    """Recordings of a part with their attributes and rigs."""
    paths = matching(part.folder, part.recordings, kept_out)
    if not paths:
        got = f"no recording {', '.join(part.recordings)}"
        raise InputError(f"folder {part.folder}", got=got, allowed="recordings with their rig*.toml")
    rigs = {path.name: path for path in matching(part.folder, part.rigs, kept_out)}
    found = []
    with progress("planning", len(paths)) as advance:
        for first in range(0, len(paths), _AT_A_TIME):
            block = paths[first : first + _AT_A_TIME]
            for path, attributes in zip(block, read_attributes_of_many(block), strict=True):
                found.append(_Found(path, attributes, _rig_of(path, attributes, rigs)))
                advance(path.name)
    return found


def _rig_of(path: Path, attributes: RunAttributes, rigs: Mapping[str, Path]) -> Path:
    """The rig that a recording names, beside it or among those of the part."""
    # the name comes from the recording: one that leads elsewhere is no rig of it
    named = Path(attributes.rig).name
    beside = path.parent / named
    if named and beside.is_file():
        return beside
    if named in rigs:
        return rigs[named]
    if len(rigs) == 1:
        return next(iter(rigs.values()))
    raise InputError(
        f"recording {path}: rig", got=f"{named!r}, which is not there", allowed="a rig file beside the recording"
    )


def matching(folder: Path, patterns: Iterable[str], kept_out: Path) -> list[Path]:
    """Files of a folder by their patterns, in the order of their paths.

    Parameters
    ----------
    folder : Path
    patterns : iterable of str
        ``*.nc``, or ``**/*.nc`` with all folders below; a name without a wildcard has to be there.
    kept_out : Path
        Files below it do not count.

    Raises
    ------
    InputError
        If a file or the folder is missing, or a pattern leads out of it.
    """
    if not folder.is_dir():
        raise InputError(f"folder {folder}", got="no such folder", allowed="a folder of recordings")
    own, found = kept_out.resolve(), set[Path]()
    for pattern in patterns:
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            raise InputError(f"pattern {pattern!r}", got="a place elsewhere", allowed="files of the folder")
        hits = [path for path in folder.glob(pattern) if path.is_file()]
        if not hits and not set(pattern) & set("*?["):
            raise InputError(f"file {folder / pattern}", got="no such file", allowed="a file that is there")
        found |= {path for path in hits if own not in path.resolve().parents}
        if len(found) > MOST_RECORDINGS:
            raise InputError(f"folder {folder}", got=f"more than {MOST_RECORDINGS} files", remedy="several plans")
    return sorted(found)
