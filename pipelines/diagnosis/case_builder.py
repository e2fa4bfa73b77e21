"""The command `case`: a case folder made of a rig file and recordings, checked, and what its runs can decide."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Final, cast

from pipelines.report.free_place import require_free_folder
from pipelines.report.outputs import sha256_of
from pipelines.report.progress import progress
from sloshlab import atomic_file
from sloshlab.errors import InputError, SloshlabError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.identification.case import MOST_RUNS, Case, CaseRun, read_case
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.readiness import require_comparable, require_one_rig
from sloshlab.identification.repeats import require_repeats
from sloshlab.identification.rig_model import RigModel
from sloshlab.informative_runs import InformativeRuns, informative_runs
from sloshlab.recording import read_recording, run_attributes
from sloshlab.rig import Rig

RIG: Final = "rig.toml"
RECORDINGS: Final = "recordings"


@dataclass
class _Examined:
    """A case that is or will be, as far as it could be read, and every defect that was found."""

    defects: list[SloshlabError] = field(default_factory=list)
    rig: Rig | None = None
    beside: list[PurePosixPath] = field(default_factory=list)
    runs: list[CaseRun] = field(default_factory=list)


def new_case(folder: Path, rig: Path, recordings: Sequence[Path], *, link: bool = False) -> dict[str, Any]:
    """Check a rig file and recordings and make a case folder of them; nothing is made if one has a defect.

    Parameters
    ----------
    folder : Path
        Must be absent or empty.
    rig : Path
        Rig description; files that its twin names are taken along.
    recordings : sequence of Path
        Recordings, or folders of them.
    link : bool
        Whether recordings are linked instead of copied.

    Returns
    -------
    dict
        Summary of the command; `defects` are lines, and there is no case where there is one.
    """
    _require_new(folder)
    files = _recordings_of(recordings)
    found = _examined(rig, files, folder)
    if found.defects:
        return _refused(found.defects)
    with atomic_file.filled_folder(folder) as complete:
        shutil.copyfile(rig, complete / RIG)
        for name in found.beside:
            (complete / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(rig.parent / name, complete / name)
        (complete / RECORDINGS).mkdir()
        for file in files:
            place = complete / RECORDINGS / file.name
            if link:
                place.symlink_to(file.resolve())
            else:
                shutil.copyfile(file, place)
    runs = informative_runs(Case(folder.name, folder, found.rig, tuple(found.runs)))
    how = "linked" if link else "copied"
    return _told(runs, [f"case: {folder} ({len(files)} recordings {how})"], [f"next: sloshlab diagnose {folder}"])


def check_case(folder: Path) -> dict[str, Any]:
    """Check a case folder; return the summary of the command.

    Parameters
    ----------
    folder : Path
    """
    if not folder.is_dir():
        # says what a case is
        read_case(folder)
    files = sorted((folder / RECORDINGS).glob("*.nc"))
    if not files:
        raise InputError(
            f"case {folder}",
            got="no recordings/*.nc",
            allowed="rig.toml and recordings/*.nc",
            remedy="make it with `sloshlab case new`",
        )
    found = _examined(folder / RIG, files, folder)
    if found.defects:
        return _refused(found.defects)
    runs = informative_runs(Case(folder.resolve().name, folder, found.rig, tuple(found.runs)))
    return _told(runs, [f"case {folder}: no defect"], [])


def _told(runs: InformativeRuns, first: list[str], last: list[str]) -> dict[str, Any]:
    return {
        "lines": [*first, *runs.lines, *last],
        "defects": [],
        "possible": [decision.question for decision in runs.possible],
        "impossible": [decision.question for decision in runs.open],
        "lacking": list(runs.lacking),
    }


def _refused(defects: Sequence[SloshlabError]) -> dict[str, Any]:
    return {"lines": [], "defects": [str(defect) for defect in defects]}


def _require_new(folder: Path) -> None:
    require_free_folder(folder, f"case {folder}")
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(
            f"case {folder}", got="a folder with files in it", allowed="a new or empty one", remedy="another name"
        )


def _recordings_of(given: Sequence[Path]) -> list[Path]:
    """The files, those of folders in the order of their names."""
    files: list[Path] = []
    for path in given:
        files += sorted(path.glob("*.nc")) if path.is_dir() else [path]
    if not 1 <= len(files) <= MOST_RUNS:
        raise InputError(
            "--recordings",
            got=f"{len(files)} recordings",
            allowed=f"1 … {MOST_RUNS}",
            remedy="name RUN.nc or folders",
        )
    return files


def _examined(rig: Path, files: Sequence[Path], folder: Path) -> _Examined:
    """Everything that can be wrong with each file, then with all of them together."""
    found = _Examined()
    try:
        found.rig = Rig.from_toml(rig)
        found.beside = _files_beside(found.rig, rig)
    except SloshlabError as error:
        found.defects.append(error)
    found.defects += _ambiguous(files)
    with progress("reading recordings", len(files)) as advance:
        for file in files:
            try:
                recording = read_recording(file)
                found.runs.append(CaseRun(file.stem, recording, run_attributes(recording)))
                found.defects += _of_another_rig(found.runs[-1], found.rig)
            except SloshlabError as error:
                found.defects.append(error)
            advance(file.name)
    if not found.defects:
        found.defects += _together(Case(folder.resolve().name, rig.parent, found.rig, tuple(found.runs)))
    return found


def _files_beside(rig: Rig, rig_file: Path) -> list[PurePosixPath]:
    """Files that the twin of a rig names, which have to lie below the rig file."""
    parameters = {} if rig.twin is None else rig.twin.parameters
    names = []
    for key in ("maps", "rom"):
        if key not in parameters:
            continue
        name = PurePosixPath(str(parameters[key]))
        if name.is_absolute() or ".." in name.parts or not (rig_file.parent / name).is_file():
            raise InputError(
                f"rig {rig_file}: twin.parameters.{key}",
                got=str(name),
                allowed="a file beside the rig file",
                remedy="put it there, and name it without a folder",
            )
        names.append(name)
    return names


def _ambiguous(files: Sequence[Path]) -> list[SloshlabError]:
    """Recordings of one name, and recordings that are given twice."""
    defects: list[SloshlabError] = []
    names: dict[str, Path] = {}
    contents: dict[str, Path] = {}
    for file in files:
        if file.suffix != ".nc":
            defects.append(
                InputError(
                    f"recording {file}",
                    got=f"a name that ends in {file.suffix or 'nothing'}",
                    allowed="a recording, RUN.nc",
                    remedy="make one of files of other programs with `sloshlab import`",
                )
            )
        if not file.is_file():
            continue
        content = sha256_of(file)
        if content in contents:
            defects.append(
                InputError(
                    f"recording {file}",
                    got=f"the same bytes as {contents[content]}",
                    allowed="every run once",
                    remedy="leave one out: a copy is no repeat",
                )
            )
        elif file.name in names:
            defects.append(
                InputError(
                    f"recording {file}",
                    got=f"the file name of {names[file.name]}",
                    allowed="a name of its own for every run",
                    remedy="rename one of them",
                )
            )
        names.setdefault(file.name, file)
        contents.setdefault(content, file)
    return defects


def _of_another_rig(run: CaseRun, rig: Rig | None) -> list[SloshlabError]:
    """An experiment that needs another structure, and channels that it needs."""
    experiment = EXPERIMENTS[run.attributes.experiment]
    defects: list[SloshlabError] = []
    kind = "" if rig is None or rig.structure is None else rig.structure.kind
    if rig is not None and experiment.structure and experiment.structure != kind:
        defects.append(
            InputError(
                f"recording {run.name}: experiment",
                got=f"{experiment.name} on a rig whose structure is {kind or 'absent'}",
                allowed=f"a rig with structure.kind = {experiment.structure!r}",
                remedy="put the recording beside its own rig file",
            )
        )
    lacking = experiment.missing_channels(str(name) for name in run.recording.data_vars)
    if lacking:
        defects.append(
            InputError(
                f"recording {run.name}: channels",
                got=f"none that begins with {', '.join(lacking)}",
                allowed=f"what {experiment.name} needs: {', '.join(experiment.required_channels)}",
                remedy="record or import the channel, or state the experiment as other",
            )
        )
    return defects


def _together(case: Case) -> list[SloshlabError]:
    """What is asked of a case before a search, the first refusal of each question."""
    defects: list[SloshlabError] = []
    try:
        require_one_rig(case)
        assert case.rig is not None
        model = cast(DiagnosedModel, RigModel(case.rig, case.folder, case.runs))
    except SloshlabError as error:
        return [error]
    for question in (require_repeats, require_comparable):
        try:
            question(case, model)
        except SloshlabError as error:
            defects.append(error)
    return defects
