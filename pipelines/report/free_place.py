"""Is there room for a new file under its name? Asked before any work is done for it."""

from __future__ import annotations

import os
from pathlib import Path

from sloshlab.errors import InputError


def require_free_place(
    output: Path, *, overwrite: bool, described: str = "recording", remedy: str = "another name, or --overwrite"
) -> None:
    """Refuse a place that is taken or cannot be written.

    Parameters
    ----------
    output : Path
        The file; folders that are not there yet will be made.
    overwrite : bool
        Whether a file, or a link, that is there may be replaced.
    described : str
        What it is, for messages.
    remedy : str
        What to do about a file that is there.

    Raises
    ------
    InputError
        If a folder or, unless it may go, a file is there, or the folder of it cannot be written.
    """
    what = f"{described} {output}"
    if output.is_dir() and not output.is_symlink():
        raise InputError(what, got="a folder in the way", allowed="a file", remedy="choose another name")
    # a link is taken, too, even one that leads nowhere: it is replaced itself
    if os.path.lexists(output) and not overwrite:
        raise InputError(what, got="a file that is there already", remedy=remedy)
    _require_writable(output.absolute().parent, what)


def require_free_file(output: Path, what: str) -> None:
    """Refuse a place that no file can be written to; one that is there will be replaced.

    Parameters
    ----------
    output : Path
        Folders that are not there yet will be made.
    what : str
        What messages call it.

    Raises
    ------
    InputError
        If a folder is there, or the folder of it cannot be written.
    """
    if output.is_dir():
        raise InputError(what, got="a folder in the way", allowed="a file", remedy="choose another name")
    _require_writable(output.absolute().parent, what)


def require_free_folder(output: Path, what: str) -> None:
    """Refuse a folder that cannot be filled.

    Parameters
    ----------
    output : Path
        Folders that are not there yet will be made.
    what : str
        What messages call it.

    Raises
    ------
    InputError
        If a file is there, or the folder cannot be written.
    """
    if output.exists() and not output.is_dir():
        raise InputError(what, got="a file in the way", allowed="a folder", remedy="choose another folder")
    _require_writable(output.absolute(), what)


def _require_writable(folder: Path, what: str) -> None:
    there = next(place for place in (folder, *folder.parents) if place.exists())
    if not there.is_dir():
        raise InputError(what, got=f"{there}, which is a file", allowed="a folder", remedy="choose another place")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(what, got=f"{there}, which cannot be written", allowed="a writable folder")
