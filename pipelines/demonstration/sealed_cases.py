"""Where the sealed case of a demonstration comes from: ready-made from `raw_data/cases`, or drawn from a seed."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from pipelines.report.free_place import require_free_folder
from pipelines.report.progress import progress
from sealed_trial.demonstrations import (
    DEMONSTRATIONS,
    DOMAIN,
    demonstration_entropy,
    drawn_demonstration,
    noise_generator,
)
from sealed_trial.sealing.sealed_case import (
    CASE,
    COMMITMENT,
    LOCKED,
    PublishedCase,
    key_of,
    read_published,
    seal_case,
)
from sloshlab.atomic_file import filled_folder
from sloshlab.errors import AnalysisError, InputError

READY_MADE: Final = Path(__file__).resolve().parents[2] / "raw_data" / "cases"
"""In a checkout; an installed package has none, and draws."""
TRUTH: Final = "truth.json"
DIAGNOSIS: Final = "diagnosis"


def conceal(name: str, seed: int | None, folder: Path, ready_made: Path = READY_MADE) -> tuple[PublishedCase, int]:
    """Put a case with a sealed truth into a folder; return what is published of it, and its seed.

    Parameters
    ----------
    name : str
        One of `DEMONSTRATIONS`.
    seed : int, optional
        Draws a case; the ready-made one by default.
    folder : Path
        New, empty, or of an earlier demonstration, which is taken away.
    ready_made : Path
        Folder of ready-made cases.

    Raises
    ------
    InputError
        If the folder is in use, or a ready-made case was changed.
    AnalysisError
        If no case can be drawn from the seed.
    """
    _take_away(earlier_files(folder))
    if seed is None and (ready_made / name).is_dir():
        published = read_published(ready_made / name)
        _copy(ready_made / name, published, folder)
        return published, DEMONSTRATIONS[name].seed
    chosen = DEMONSTRATIONS[name].seed if seed is None else seed
    with progress("drawing the case", 1):
        return draw(name, chosen, folder), chosen


def draw(name: str, seed: int, folder: Path) -> PublishedCase:
    """Draw a case and seal it.

    Raises
    ------
    AnalysisError
        If no case can be drawn from the seed.
    """
    try:
        case = drawn_demonstration(name, seed)
    except ArithmeticError as error:
        raise AnalysisError(f"demo {name}", got=str(error), remedy="another --seed") from error
    noise = noise_generator(demonstration_entropy(name, seed))
    return seal_case(folder, name, case, key_of(DOMAIN, name, seed), noise)


def _copy(source: Path, published: PublishedCase, folder: Path) -> None:
    with filled_folder(folder) as complete:
        for file in (*(f"{CASE}/{file}" for file in published.files), COMMITMENT, LOCKED):
            (complete / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / file, complete / file)


def earlier_files(folder: Path) -> list[Path]:
    """Files of an earlier demonstration in a folder, but for its diagnosis, which looks after its own.

    Raises
    ------
    InputError
        If the folder holds something else, or cannot be filled.
    """
    require_free_folder(folder, f"--output {folder}")
    if not folder.is_dir() or not any(folder.iterdir()):
        return []
    try:
        published = PublishedCase.model_validate_json((folder / COMMITMENT).read_bytes()).files
    except (OSError, ValueError) as error:
        raise InputError(
            f"--output {folder}",
            got="a folder with files of somebody's own",
            allowed="a new or empty one, or that of an earlier demonstration",
            remedy="choose another folder",
        ) from error
    known = {(folder / CASE / file).resolve() for file in published}
    # names in a file may lead anywhere: only what lies in the case is meant
    inside = [
        file
        for file in sorted((folder / CASE).rglob("*"))
        if file.is_file() and not file.is_symlink() and file.resolve() in known
    ]
    return [*inside, *(folder / name for name in (TRUTH, LOCKED, COMMITMENT))]


def _take_away(files: Iterable[Path]) -> None:
    for file in files:
        file.unlink(missing_ok=True)
