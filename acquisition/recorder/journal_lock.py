"""One recorder per journal: a lock on the file that the operating system lets go when the recorder ends, however.

`flock` where there is one, `msvcrt.locking` on Windows. A file system without locks (some network drives) makes
every journal look as if its recorder had ended.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import time
from pathlib import Path
from typing import Final

from sloshlab.errors import JournalError

_HELD_BY_ANOTHER: Final = frozenset({errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK})
# whoever asks whether a journal is live holds its lock for a moment itself
_ATTEMPTS: Final = 10
_PAUSE_S: Final = 0.01

if sys.platform == "win32":
    import msvcrt

    # far behind every sample, as locked bytes of Windows cannot be read by others
    _LOCKED_BYTE: Final = 1 << 40

    def _try_lock(descriptor: int) -> None:
        place = os.lseek(descriptor, 0, os.SEEK_CUR)
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(descriptor, place, os.SEEK_SET)
else:
    import fcntl

    def _try_lock(descriptor: int) -> None:
        # of the open file, not of the process: a second recorder in the same program is another one, too
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _takes_lock(descriptor: int) -> bool:
    """Lock an open journal until all descriptors of this opening are closed; False if another has it."""
    for _ in range(_ATTEMPTS):
        try:
            _try_lock(descriptor)
        except OSError as error:
            if error.errno in _HELD_BY_ANOTHER:
                time.sleep(_PAUSE_S)
                continue
        # locked, or a file system without locks
        return True
    return False


def is_live(path: Path) -> bool:
    """Whether a recorder that runs has this journal."""
    try:
        # a named pipe would keep an opening that waits
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return False
    try:
        return stat.S_ISREG(os.fstat(descriptor).st_mode) and not _takes_lock(descriptor)
    finally:
        os.close(descriptor)


def lock_new_journal(path: Path, descriptor: int) -> None:
    """Take the lock of a journal that has just been made.

    Raises
    ------
    JournalError
        If another recorder was faster to make one of this name.
    """
    # one that came between making and locking may have taken this one for dead, and removed it
    if not _takes_lock(descriptor) or not _is_at(path, descriptor):
        raise live_journal(path)


def remove_dead_journal(path: Path) -> None:
    """Make way for a new journal: remove the name, never write to what it may share with another name.

    Raises
    ------
    JournalError
        If a recorder that runs has it.
    OSError
        If it cannot be removed.
    """
    try:
        if not stat.S_ISREG(os.lstat(path).st_mode):
            # a link: what it leads to is another's
            path.unlink()
            return
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return
    try:
        # held until the name is gone, so that of two that overwrite at once only one takes it for dead
        if not _takes_lock(descriptor):
            raise live_journal(path)
        # another may have done so, and made one of its own, since it was opened
        if _is_at(path, descriptor):
            path.unlink()
    finally:
        os.close(descriptor)


def live_journal(path: Path) -> JournalError:
    """The error for a journal into which another recorder records."""
    return JournalError(
        f"journal {path}",
        got="the journal of a recorder that is running",
        allowed="a recording of its own for each recorder",
        remedy="record under another name, or end the other recorder first",
    )


def _is_at(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except OSError:
        return False
