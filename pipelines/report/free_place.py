"""Is there room for a new file under its name? Asked before any work is done for it."""

from __future__ import annotations

import os
from pathlib import Path

from sloshlab.errors import InputError


def require_free_place(output: Path, *, overwrite: bool, described: str = "recording") -> None:
    """Refuse a place that is taken or cannot be written.

    Parameters
    ----------
    output : Path
        The file; folders that are not there yet will be made.
    overwrite : bool
        Whether a file, or a link, that is there may be replaced.
    described : str
        What it is, for messages.

    Raises
    ------
    InputError
        If a folder or, unless it may go, a file is there, or the folder of it cannot be written.
    """
    what = f"{described} {output}"
    if output.is_dir() and not output.is_symlink():
        raise InputError(what, got="a folder in the way", remedy="choose another name")
    # a link is taken, too, even one that leads nowhere: it is replaced itself
    if os.path.lexists(output) and not overwrite:
        raise InputError(what, got="a file that is there already", remedy="another name, or --overwrite")
    folder = next(folder for folder in output.absolute().parents if folder.exists())
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(what, got=f"{folder}, which cannot be written", allowed="a writable folder")
