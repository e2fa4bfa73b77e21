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
from sloshlab.limited_process import ReadingLimits

LARGEST_TEXT_BYTES: Final = 1 << 30
LARGEST_BINARY_BYTES: Final = 6 << 30
LARGEST_DECODED_BYTES: Final = 6 << 30

LARGEST_EXPANSION: Final = 100
"""Decoded bytes per byte of a file. Measured signals are compressed to a half or a tenth, and four bytes of text
or two of a converter become eight; only signals that hardly change go beyond, and deflate ends at a thousand."""

SMALLEST_DECODED_ALLOWANCE: Final = 256 << 20
"""What a file of any size may unpack to: eight channels that never change, an hour at 1 kHz."""

_COMPUTING_S = 20.0
_COMPUTING_S_PER_MIB = 5.0
"""A BLF log takes 1.1 s per MiB on one core of 2 GHz, text at most 0.2 s, the other formats 0.03 s or less;
a slower machine and a database with many signals take several times as long."""

_MEMORY_BYTES = 512 << 20
_MEMORY_PER_DECODED = 4
"""Beside the numbers, their text or packed form is in memory, and pieces of both while they are converted."""

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


def decoded_allowance(size: int) -> int:
    """What a file of a size may unpack to, both in bytes.

    Examples
    --------
    >>> decoded_allowance(1000) >> 20, decoded_allowance(10 << 20) >> 20, decoded_allowance(1 << 30) >> 30
    (256, 1000, 6)
    """
    return min(LARGEST_DECODED_BYTES, max(SMALLEST_DECODED_ALLOWANCE, LARGEST_EXPANSION * size))


def limits_for(size: int) -> ReadingLimits:
    """Memory and computing time for reading a file of a size [bytes].

    Examples
    --------
    >>> limits_for(2 << 20).computing_s
    30.0
    """
    return ReadingLimits(
        memory_bytes=_MEMORY_BYTES + _MEMORY_PER_DECODED * decoded_allowance(size),
        computing_s=_COMPUTING_S + _COMPUTING_S_PER_MIB * size / 2**20,
    )


class DeclaredBytes:
    """Sum of what a file declares, refused where it becomes more than a file of its size may hold.

    Parameters
    ----------
    path : Path
        An existing file.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._total = path, 0
        self._allowed = decoded_allowance(path.stat().st_size)

    def add(self, what: str, n_bytes: int) -> None:
        """Add a part before anything is allocated for it.

        Raises
        ------
        FileFormatError
            If all parts together are too large.
        """
        self._total += n_bytes
        check_declared(self._path, f"{what} and all before", self._total, self._allowed)


class BoundedReader(io.BufferedReader):
    """A file of which a reader gets no more than there is, before memory is taken for what it asks for."""

    def __init__(self, path: Path) -> None:
        super().__init__(path.open("rb", buffering=0))
        self._n_bytes = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """At most `size` bytes; all that are left where it is negative or None."""
        left = max(0, self._n_bytes - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))


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
        # and so does the end of memory, which is no fault of the format
        if error is None or isinstance(error, (SloshlabError, MemoryError)) or not isinstance(error, Exception):
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
