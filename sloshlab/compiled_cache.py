"""Where compiled loops are kept, so that only the first command after an installation compiles them.

numba keeps them beside the source. In an installation that cannot be written, such as that of an administrator or
a container, they go to the user's cache folder; where that cannot be written either, to a folder of this process,
for numba would refuse to compile at all.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

VARIABLE: Final = "NUMBA_CACHE_DIR"
_PACKAGE: Final = Path(__file__).resolve().parent


def keep_compiled_loops(
    package: Path = _PACKAGE, is_writable: Callable[[Path], bool] = lambda folder: os.access(folder, os.W_OK)
) -> None:
    """Tell numba where to keep compiled loops, unless it can do so beside the source or was told already.

    Parameters
    ----------
    package : Path
        Where the source is.
    is_writable : callable
        Whether a folder can be written.
    """
    if os.environ.get(VARIABLE) or is_writable(package):
        return
    chosen = _made(user_cache_folder() / "sloshlab" / "numba", is_writable) or _own_folder()
    # processes that are started by this one find it, too
    os.environ[VARIABLE] = str(chosen)
    if (numba := sys.modules.get("numba")) is not None:  # it has read its settings already
        numba.config.CACHE_DIR = str(chosen)  # type: ignore[attr-defined]


def user_cache_folder() -> Path:
    """Where programs keep what can be made again, on this system."""
    home = Path(os.path.expanduser("~"))
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")


def _made(folder: Path, is_writable: Callable[[Path], bool]) -> Path | None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if is_writable(folder) else None


def _own_folder() -> Path:
    """A folder of this process alone: what another user could write there would be run."""
    # every command imports this module
    import atexit
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="sloshlab-numba-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
