"""Reading a file that nobody vouches for, in a process of its own that may be lost.

Libraries that read foreign formats trust what a file declares: a damaged or hostile one makes them crash, run for
ever or take all memory, and no exception ends that. The read is therefore done in a child with limits of memory
and computing time; whatever becomes of it, this process gets a value or one error.

On Linux the child is a fork, which has everything imported already and costs milliseconds. Elsewhere (Windows has
no fork, and system libraries of macOS do not bear it) a new interpreter is started, which costs about a second.
What is read comes back as text and raw arrays, never as a pickle: the child is not trusted more than the file.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import importlib
import json
import math
import mmap
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from sloshlab import errors, interrupt, out_of_core
from sloshlab.errors import InputError, MissingExtraError, SourceError
from sloshlab.netcdf_lock import NETCDF_LOCK
from sloshlab.out_of_core import unnamed_file
from sloshlab.returned_values import Packed, Store, Unpacked

CAN_FORK: Final = sys.platform == "linux"

T = TypeVar("T")

_LONGEST_ANSWER_BYTES = 256 << 20
"""Text that a child may hand back; the numbers are beside it."""
_WAITING_PER_COMPUTING = 4
_WAITING_S = 60
"""Waiting for a disk, a network or other programs is no computing; beyond this the file does not come at all."""


@dataclass(frozen=True)
class ReadingLimits:
    """What reading one file may take.

    Attributes
    ----------
    memory_bytes : int
        Memory beside that of the program itself.
    computing_s : float
        Computing time of one processor [s]; four times as long and a minute may pass by the clock.
    """

    memory_bytes: int
    computing_s: float

    @property
    def waiting_s(self) -> float:
        """Time by the clock [s]."""
        return _WAITING_S + _WAITING_PER_COMPUTING * self.computing_s


@dataclass(frozen=True)
class UntrustedFile:
    """A file to be read, and how it is refused.

    Attributes
    ----------
    what : str
        What messages call it.
    limits : ReadingLimits
    refusal : type of InputError
        What is raised where a limit is exceeded or the reader crashes.
    """

    what: str
    limits: ReadingLimits
    refusal: type[InputError] = InputError

    def refused(self, got: str, remedy: str = "") -> InputError:
        """The error that says so."""
        usual = "it is damaged, or made to do harm; export or copy it again"
        return self.refusal(self.what, got=got, allowed="a complete file", remedy=remedy or usual)

    def read(self, reader: Callable[..., T], *arguments: Any, fork: bool = CAN_FORK) -> T:
        """What a reader returns, from another process.

        Parameters
        ----------
        reader : callable
            A function of a module, by whose name a new interpreter finds it. What it returns may consist of
            numbers, texts, None, arrays of numbers or texts, lists, tuples and mappings.
        arguments : object
            Of the same kinds.
        fork : bool
            Whether the process is a fork of this one.

        Raises
        ------
        InputError
            What the reader raised, or `refusal` where a limit is exceeded or the process dies.
        RuntimeError
            If the reader raised anything but a `SloshlabError`, with its traceback.
        """
        if _Child.store is not None:  # what a limited process reads in turn is within its limits
            return reader(*arguments)
        answer, files = (_by_fork if fork else _by_interpreter)(self, reader, arguments)
        if "error" in answer:
            raise _error_of_child(answer["error"])
        if "memory" in answer:
            raise self.refused(f"more than the {self.limits.memory_bytes / 2**30:.1f} GiB that reading may take")
        if "unexpected" in answer:
            raise RuntimeError(f"{self.what}: {answer['unexpected']}")
        value: T = Unpacked(*files).value(answer["result"])
        return value

    def of_the_dead(self, status: int) -> InputError:
        """Why a process ended without an answer: minus the signal, or its exit code."""
        if status == -getattr(signal, "SIGXCPU", 0) != 0:
            return self.refused(
                f"more than the {self.limits.computing_s:.0f} s of computing that reading may take",
                "it is damaged or too long to be read at once; split it",
            )
        with contextlib.suppress(ValueError):
            return self.refused(f"a file on which the reader crashed ({signal.Signals(-status).name})")
        return self.refused(f"a file on which the reader crashed (exit code {status})")

    def too_late(self) -> InputError:
        """The error of a process that did not end."""
        return self.refused(f"no end of reading after {self.limits.waiting_s:.0f} s")


def empty(n: int, dtype: DTypeLike) -> NDArray[Any]:
    """Uninitialised array; within a child it lies where the other process finds it without a copy."""
    return out_of_core.empty(n, dtype) if _Child.store is None else _Child.store.empty(n, np.dtype(dtype))


class _Child:
    """What this process is, where it is such a child."""

    store: Store | None = None


def _by_fork(
    file: UntrustedFile, reader: Callable[..., Any], arguments: tuple[Any, ...]
) -> tuple[dict[str, Any], list[memoryview]]:
    with contextlib.ExitStack() as closing:
        numbers = [os.memfd_create("numbers")]
        closing.callback(os.close, numbers[0])
        # without a folder for temporary files everything is in memory
        with contextlib.suppress(OSError):
            numbers.append(closing.enter_context(unnamed_file()))
        # held, so that no other thread is within the netCDF library at this moment (in the fork it would stay
        # there), and that no other child keeps this one's end of the pipe
        with NETCDF_LOCK, warnings.catch_warnings():
            # of forks of a process with threads: the child uses nothing that they may hold
            warnings.simplefilter("ignore", DeprecationWarning)
            ours, theirs = os.pipe()
            closing.callback(os.close, ours)
            child = os.fork()
            if child == 0:
                os.close(ours)
                _in_fork(file.limits, numbers, theirs, lambda: reader(*arguments))
            os.close(theirs)
        try:
            answer = _received(ours, file)
        except BaseException:
            with contextlib.suppress(ProcessLookupError):  # where the system throws codes away, it may be gone
                os.kill(child, signal.SIGKILL)
            raise
        finally:
            # an interrupt between its end and the note of it would have somebody else's process killed, or none
            with interrupt.held():
                status = _ended(child)
        if status or not answer:
            raise file.of_the_dead(status)
        return json.loads(answer), [_mapped(descriptor) for descriptor in numbers]


def _received(descriptor: int, file: UntrustedFile) -> bytes:
    """Everything that is written to a pipe until it is closed."""
    until = time.monotonic() + file.limits.waiting_s
    waiting = select.poll()
    waiting.register(descriptor, select.POLLIN)
    answer = bytearray()
    while True:
        if not waiting.poll(max(0.0, 1e3 * (until - time.monotonic()))):
            raise file.too_late()
        part = os.read(descriptor, 1 << 16)
        answer += part
        if not part:
            return bytes(answer)
        if len(answer) > _LONGEST_ANSWER_BYTES:
            raise file.refused(f"more than {_LONGEST_ANSWER_BYTES} bytes of names and texts")


def _ended(child: int) -> int:
    """Exit code of a child, or minus the signal that ended it."""
    try:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    except ChildProcessError:  # the program has the system throw such codes away; what was handed back tells
        return 0


def _in_fork(limits: ReadingLimits, numbers: Sequence[int], theirs: int, read: Callable[[], Any]) -> NoReturn:
    code = 1
    try:
        # Ctrl-C is for the other process, which ends this one; of what a C library prints nobody knows the file
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        faulthandler.disable()
        # the collector would copy inherited pages, and close files that the other process is writing
        gc.disable()
        nowhere = os.open(os.devnull, os.O_RDWR)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        answer = _answer(limits, numbers, read)
        with os.fdopen(theirs, "wb") as stream:
            stream.write(answer)
        code = 0
    finally:
        # nothing that was registered for the end of the other process may run here
        os._exit(code)


def _by_interpreter(
    file: UntrustedFile, reader: Callable[..., Any], arguments: tuple[Any, ...]
) -> tuple[dict[str, Any], list[memoryview]]:
    # in a folder: on Windows a file that is open here cannot be opened there
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "numbers")
        path.touch()
        request = {
            "reader": [reader.__module__, reader.__qualname__],
            "arguments": list(arguments),
            "limits": [file.limits.memory_bytes, file.limits.computing_s],
            "numbers": str(path),
        }
        # modules are looked for where this interpreter does, and not in the folder of the file (-P)
        with subprocess.Popen(
            [sys.executable, "-P", "-m", "sloshlab.limited_process"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as child:
            try:
                answer, _ = child.communicate(json.dumps(request).encode(), timeout=file.limits.waiting_s)
            except subprocess.TimeoutExpired:
                raise file.too_late() from None
            finally:
                child.kill()
        if child.returncode or not answer:
            raise file.of_the_dead(child.returncode)
        return json.loads(answer), [memoryview(bytearray(path.read_bytes()))]


def serve() -> None:
    """Serve the one request on standard input."""
    request = json.loads(sys.stdin.buffer.read())
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a reader prints is no answer
    module, name = request["reader"]
    numbers = os.open(request["numbers"], os.O_RDWR | getattr(os, "O_BINARY", 0))
    limits = ReadingLimits(*request["limits"])
    out.write(_answer(limits, [numbers], lambda: _called(module, name, request["arguments"])))
    out.close()


def _called(module: str, name: str, arguments: list[Any]) -> Any:
    return getattr(importlib.import_module(module), name)(*arguments)


def _answer(limits: ReadingLimits, numbers: Sequence[int], read: Callable[[], Any]) -> bytes:
    _Child.store = Store(*numbers)
    answer: dict[str, Any]
    try:
        with _limited(limits):
            answer = {"result": Packed(_Child.store).value(read())}
    except MissingExtraError as error:
        answer = {"error": ["MissingExtraError", error.package, error.extra, error.purpose]}
    except (InputError, SourceError) as error:
        answer = {"error": [type(error).__name__, error.what, error.got, error.allowed, error.remedy]}
    except MemoryError:
        answer = {"memory": True}
    except BaseException:  # noqa: BLE001 - told in the other process, with its traceback
        answer = {"unexpected": traceback.format_exc()}
    # broken text of a file (lone surrogates) is kept as it is
    return json.dumps(answer).encode("ascii")


@contextlib.contextmanager
def _limited(limits: ReadingLimits) -> Iterator[None]:
    """Limits of the system, where it has such; memory is given back for the report of an error."""
    try:
        import resource
    except ImportError:  # Windows
        yield
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, hardest = resource.getrlimit(resource.RLIMIT_CPU)
    spent = time.process_time()
    seconds = math.ceil(limits.computing_s) + int(spent)
    if hardest == resource.RLIM_INFINITY or seconds < hardest:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, hardest))
    before, hardest = resource.getrlimit(resource.RLIMIT_AS)
    allowed = _address_space_bytes() + limits.memory_bytes
    if before != resource.RLIM_INFINITY:
        allowed = min(allowed, before)
    resource.setrlimit(resource.RLIMIT_AS, (allowed, hardest))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, hardest))


def _address_space_bytes() -> int:
    """Of this process, most of which are libraries; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * mmap.PAGESIZE
    except OSError:
        return 64 << 30  # only a system without /proc, where address space says little about memory


def _mapped(descriptor: int) -> memoryview:
    size = os.fstat(descriptor).st_size
    return memoryview(mmap.mmap(descriptor, size)) if size else memoryview(bytearray())


def _error_of_child(answer: list[str]) -> Exception:
    name, *parts = answer
    if name == "MissingExtraError":
        return MissingExtraError(parts[0], extra=parts[1], purpose=parts[2])
    what, got, allowed, remedy = parts
    kind: type[InputError | SourceError] = getattr(errors, name)
    return kind(what, got=got, allowed=allowed, remedy=remedy)


if __name__ == "__main__":
    # under its own name, by which readers know it, and not a second time as the main module
    importlib.import_module("sloshlab.limited_process").serve()
