"""Guards around readers of foreign files: sizes before allocation, failures and warnings as data."""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Final

from sloshlab.errors import FileFormatError, MissingExtraError, SloshlabError

LARGEST_TEXT_BYTES: Final = 1 << 30
LARGEST_BINARY_BYTES: Final = 6 << 30
LARGEST_DECODED_BYTES: Final = 6 << 30
# a reader may warn at every sample
_MOST_WARNINGS_KEPT = 5


def checked_size(path: Path, largest_bytes: int = LARGEST_BINARY_BYTES) -> int:
    """Size of an existing, non-empty, not too large regular file [bytes].

    Raises
    ------
    FileFormatError
        If there is no such file, or it is empty or too large.
    """
    try:
        if not path.is_file():
            kind = "a folder" if path.is_dir() else "no such file"
            raise FileFormatError(f"source {path}", got=kind, allowed="a file")
        size = path.stat().st_size
        # opened once, so that a missing permission is told here and not by a reader
        with path.open("rb"):
            pass
    except FileFormatError:
        raise
    except (OSError, ValueError) as error:
        raise FileFormatError(f"source {path}", got=f"{error}", allowed="a readable file") from error
    if size == 0:
        raise FileFormatError(f"source {path}", got="an empty file", allowed="a file with data")
    if size > largest_bytes:
        raise FileFormatError(
            f"source {path}: size",
            got=f"{size / 2**30:.1f} GiB",
            allowed=f"≤ {largest_bytes / 2**30:.1f} GiB",
            remedy="split the file into shorter ones and join them with join = 'time'",
        )
    return size


def check_declared(path: Path, what: str, needed_bytes: int, largest_bytes: int = LARGEST_DECODED_BYTES) -> None:
    """Refuse what a file declares before anything is allocated for it.

    Raises
    ------
    FileFormatError
        If `needed_bytes` is negative or above `largest_bytes`.
    """
    if not 0 <= needed_bytes <= largest_bytes:
        raise FileFormatError(
            f"source {path}: {what}",
            got=f"a declared size of {needed_bytes} bytes",
            allowed=f"≤ {largest_bytes} bytes",
            remedy="the file is damaged, or too long to be read at once",
        )


def library(name: str, purpose: str) -> ModuleType:
    """Import an optional reader.

    Raises
    ------
    MissingExtraError
        Naming the extra that brings it.
    """
    try:
        with warnings.catch_warnings():
            # what a library warns of when it is imported is nothing that its user can mend
            warnings.simplefilter("ignore")
            return importlib.import_module(name)
    except ImportError as error:
        raise MissingExtraError(name.partition(".")[0], extra="formats", purpose=purpose) from error


class ReaderGuard:
    """Context in which a library reads a foreign file.

    Whatever the library raises comes out as one `FileFormatError`; what it warns, logs or prints
    is kept in `traps` instead of reaching the terminal.

    Parameters
    ----------
    path : Path
        The file that is read.
    format_name : str
        Used in the message.
    loggers : tuple of str
        Loggers of the library whose records, and those of its modules, become traps.

    Examples
    --------
    >>> with ReaderGuard(Path("a.uff"), "UFF") as guard:
    ...     warnings.warn("odd header", stacklevel=1)
    >>> guard.traps
    ['odd header']
    """

    def __init__(self, path: Path, format_name: str, loggers: tuple[str, ...] = ()) -> None:
        self._path, self._format, self._loggers = path, format_name, loggers
        self.traps: list[str] = []

    def __enter__(self) -> ReaderGuard:
        self._stack = contextlib.ExitStack()
        self._caught = self._stack.enter_context(warnings.catch_warnings(record=True))
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", ResourceWarning)
        # some readers print, and standard output belongs to the command
        self._stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        self._records: list[str] = []
        for name in self._loggers:
            self._stack.enter_context(_captured(name, self._records))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()
        messages = [str(warning.message) for warning in self._caught or []] + self._records
        distinct = list(dict.fromkeys(" ".join(message.split())[:200] for message in messages))
        self.traps.extend(distinct[:_MOST_WARNINGS_KEPT])
        if len(distinct) > _MOST_WARNINGS_KEPT:
            self.traps.append(f"{len(distinct) - _MOST_WARNINGS_KEPT} more warnings of the reader")
        # Ctrl-C and the end of the process pass through
        if error is None or isinstance(error, SloshlabError) or not isinstance(error, Exception):
            return
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise FileFormatError(
            f"source {self._path}",
            got=f"a file that the {self._format} reader cannot read ({type(error).__name__}: {reason})",
            allowed=f"a complete {self._format} file",
            remedy="the file is cut short, damaged or of another format; export it again",
        ) from error


class _ListHandler(logging.Handler):
    def __init__(self, records: list[str]) -> None:
        super().__init__()
        self._records = records

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(TypeError, ValueError):
            self._records.append(record.getMessage())


@contextlib.contextmanager
def _captured(prefix: str, records: list[str]) -> Iterator[None]:
    """Send what a library logs to `records`, from all its modules, instead of to the terminal."""
    names = [prefix, *(name for name in logging.root.manager.loggerDict if name.startswith(f"{prefix}."))]
    loggers = [logging.getLogger(name) for name in names]
    before = [(logger, logger.handlers, logger.propagate) for logger in loggers]
    handler = _ListHandler(records)
    for logger in loggers:
        logger.handlers, logger.propagate = [handler], False
    try:
        yield
    finally:
        for logger, handlers, propagate in before:
            logger.handlers, logger.propagate = handlers, propagate
