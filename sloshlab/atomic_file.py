"""Files, and folders of files, that appear complete or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replaced(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it takes the place of `path`.

    On any exception, an interrupt included, the temporary file is removed and `path` is as it was.

    Parameters
    ----------
    path : path-like
        The file to write; missing folders above it are made.

    Yields
    ------
    Path
        Where to write. It has the suffix of `path`, because some writers choose their format by it.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    # beside the target, because a file can be moved into place at once only within one file system
    handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=".part" + target.suffix, dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files that nobody else may read; the mask can only be read by setting it
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        # atomic: readers see the old file or the new one, never a part
        os.replace(temporary, target)
    finally:
        # also after success, when it has been moved away
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def filled_folder(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder; on success its files take their places in `folder`, all together.

    On any exception, an interrupt included, `folder` is as it was, or still absent.

    Parameters
    ----------
    folder : path-like
        Made if missing. Files that are there and are not written again stay.

    Yields
    ------
    Path
        An empty folder on the same file system.
    """
    target = Path(folder).absolute()
    # on the same file system as the target, or a move would be a copy that an interrupt leaves half done
    beside = target if target.is_dir() else target.parent
    beside.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".part", dir=beside))
    try:
        yield temporary
        target.mkdir(exist_ok=True)
        for source in sorted(path for path in temporary.rglob("*") if path.is_file()):
            place = target / source.relative_to(temporary)
            place.parent.mkdir(parents=True, exist_ok=True)
            os.replace(source, place)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write `content` to `path` atomically."""
    with replaced(path) as temporary:
        temporary.write_bytes(content)
