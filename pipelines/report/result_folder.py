"""A folder of results: its files belong to one run of one command, and say which.

`result.json` names the run and every file with its SHA-256. By it the next run into the folder knows which files
are results of an earlier one: these it replaces or takes away; everything else is somebody's own and stays.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, Final

from pipelines.report.outputs import RESULT_ID, sha256_of
from sloshlab import atomic_file
from sloshlab.errors import InputError

MANIFEST_NAME: Final = "result.json"
_FORMAT: Final = 1
_LARGEST_MANIFEST_BYTES: Final = 20_000_000
_REMEDY: Final = "another folder, or move it away"


@contextlib.contextmanager
def result_folder(folder: Path, provenance: Mapping[str, Any]) -> Iterator[Path]:
    """Yield an empty folder; on success its files are the result in `folder`, all together, and the only one.

    Files of an earlier result that are not written again are removed. On any exception, an interrupt included,
    `folder` is as it was, or still absent.

    Parameters
    ----------
    folder : Path
        Made if missing.
    provenance : mapping
        From `provenance_of`; goes into `result.json` but for the command, which says where, not what.

    Yields
    ------
    Path
        Where to write.

    Raises
    ------
    InputError
        If somebody's own file or folder is in the place of a result.
    """
    with atomic_file.together() as stagings:
        staging = stagings.folder(folder)
        yield staging.folder
        files = sorted(path for path in staging.folder.rglob("*") if path.is_file())
        names = [path.relative_to(staging.folder).as_posix() for path in files]
        earlier = earlier_files(folder)
        require_free_places(folder, [*names, MANIFEST_NAME], earlier)
        staging.removed += [folder.absolute() / name for name in earlier if name not in {*names, MANIFEST_NAME}]
        told = {name: value for name, value in provenance.items() if name not in ("command", RESULT_ID)}
        content = {
            "sloshlab_result": _FORMAT,
            RESULT_ID: provenance[RESULT_ID],
            **told,
            "files": {name: sha256_of(path) for name, path in zip(names, files, strict=True)},
        }
        atomic_file.write_bytes(
            staging.folder / MANIFEST_NAME, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()
        )


def withdraw_result(folder: Path, stagings: atomic_file.Stagings) -> None:
    """Take an earlier result away when the files of `stagings` come; nothing happens where there is none."""
    if earlier := earlier_files(folder):
        stagings.folder(folder).removed += [folder.absolute() / name for name in earlier]


def require_result_folder(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder that cannot take results, before any work is done for them.

    Parameters
    ----------
    folder : Path
        Folders that are not there yet will be made.
    names : iterable of str
        Files that will be written for certain.

    Raises
    ------
    InputError
        If something is in the way that is no earlier result, or the folder cannot be written.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise InputError(f"results {folder}", got="a file in the way", remedy="choose another folder")
    there = next(place for place in (folder.absolute(), *folder.absolute().parents) if place.exists())
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"results {folder}", got=f"{there}, which cannot be written", allowed="a writable folder")
    require_free_places(folder, [*names, MANIFEST_NAME], earlier_files(folder))


def require_free_places(folder: Path, names: Iterable[str], earlier: Iterable[str]) -> None:
    """Refuse places that are taken by anything but an earlier result.

    Raises
    ------
    InputError
    """
    own = set(earlier)
    for name in names:
        for above in PurePosixPath(name).parents[:-1]:
            place = folder / above
            if os.path.lexists(place) and (place.is_symlink() or not place.is_dir()):
                got = "a link" if place.is_symlink() else "a file"
                raise InputError(f"results {place}", got=f"{got} in the place of a folder", remedy=_REMEDY)
        place = folder / name
        if not os.path.lexists(place) or name in own:
            continue
        if place.is_dir() and not place.is_symlink():
            raise InputError(f"results {place}", got="a folder in the place of a file", remedy=_REMEDY)
        got = "a file that sloshlab did not write, or that was changed since"
        raise InputError(f"results {place}", got=got, allowed="an earlier result", remedy=_REMEDY)


def earlier_files(folder: Path) -> list[str]:
    """Names of the files of an earlier result that are as it wrote them, its manifest among them.

    A manifest that is damaged vouches for nothing, not even for itself.
    """
    path = folder / MANIFEST_NAME
    try:
        if path.is_symlink() or path.stat().st_size > _LARGEST_MANIFEST_BYTES:
            return []
        content = json.loads(path.read_bytes())
        if content["sloshlab_result"] != _FORMAT:
            return []
        files = {str(name): str(digest) for name, digest in content["files"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return []
    return [MANIFEST_NAME, *(name for name, digest in files.items() if _is_unchanged(folder, name, digest))]


def _is_unchanged(folder: Path, name: str, digest: str) -> bool:
    """Whether a file is in the folder, reached through no link, and has its digest."""
    parts = PurePosixPath(name)
    # the manifest may come from anywhere: nothing outside its folder is vouched for
    if parts.is_absolute() or ".." in parts.parts or not parts.parts:
        return False
    places = [folder / name, *(folder / above for above in parts.parents[:-1])]
    if any(place.is_symlink() for place in places):
        return False
    try:
        return (folder / name).is_file() and sha256_of(folder / name) == digest
    except OSError:
        return False
