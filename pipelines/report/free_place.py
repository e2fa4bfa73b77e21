"""Is there room for a new recording, or for results, under its name? Asked before any work is done for it."""

from __future__ import annotations

import os
from pathlib import Path

from sloshlab.errors import InputError


def require_free_place(output: Path, *, overwrite: bool) -> None:
    """Refuse a place that is taken or cannot be written.

    Parameters
    ----------
    output : Path
        The recording; folders that are not there yet will be made.
    overwrite : bool
        Whether a file that is there may be replaced.

    Raises
    ------
    InputError
        If a folder or, unless it may go, a file is there, or the folder of it cannot be written.
    """
    what = f"recording {output}"
    if output.is_dir():
        raise InputError(what, got="a folder in the way", remedy="choose another name")
    if output.exists() and not overwrite:
        raise InputError(what, got="a file that is there already", remedy="another name, or --overwrite")
    folder = next(folder for folder in output.absolute().parents if folder.exists())
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(what, got=f"{folder}, which cannot be written", allowed="a writable folder")


def require_free_folder(output: Path, what: str) -> None:
    """Refuse a folder that cannot be filled.

    Parameters
    ----------
    output : Path
        Folders that are not there yet will be made.
    what : str
        The folder is of, for messages.

    Raises
    ------
    InputError
        If a file is there, or the folder cannot be written.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{what} {output}", got="a file in the way", remedy="choose another folder")
    there = next(folder for folder in (output.absolute(), *output.absolute().parents) if folder.exists())
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"{what} {output}", got=f"{there}, which cannot be written", allowed="a writable folder")
