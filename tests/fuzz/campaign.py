"""Damaged files to each reader: whatever they hold, it ends in a result or in one line, soon, in little memory.

A batch is read within one limited process, as a process for each would take most of the time. Where that process
dies or a reader says anything but one line, each file of the batch is read once more, by a program of its own.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sloshlab.errors import InputError, SloshlabError
from sloshlab.limited_process import ReadingLimits, UntrustedFile
from tests.fuzz.mutations import mutated
from tests.fuzz.targets import TARGETS, good_contents

MOST_MEMORY_KIB = 2 << 20
"""Of any process that reads a damaged file."""

BATCH = 50
_LIMITS = ReadingLimits(memory_bytes=3 << 29, computing_s=60.0)
# the limits of a reader are below: it must end by itself
_LONGEST_S = 300


@dataclass
class Findings:
    """What went wrong, and what was ended by the limits of its reader, each as ``target number: what``."""

    n_inputs: int = 0
    wrong: list[str] = field(default_factory=list)
    contained: list[str] = field(default_factory=list)


def content_of(name: str, number: int, more_seeds: Sequence[bytes] = ()) -> bytes:
    """The damaged file of that number."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), number])
    return mutated([*good_contents(name), *more_seeds], rng)


def outcome_of(name: str, path: Path) -> str:
    """``read``, the one line of a refusal, or what must not come out after an exclamation mark."""
    try:
        TARGETS[name].read(path)
    except SloshlabError as error:
        return str(error) if "\n" not in str(error) else f"! more than one line: {error}"
    except MemoryError:
        return "! no memory left"
    except Exception as error:  # noqa: BLE001 - it is what is looked for
        return f"! {type(error).__name__}: {error}"
    return "read"


def _batch(name: str, first: int, n: int, folder: str) -> list[int]:
    """Numbers of the files that must be read once more."""
    path = Path(folder, TARGETS[name].file_name)
    again = []
    for number in range(first, first + n):
        path.write_bytes(content_of(name, number))
        if outcome_of(name, path).startswith("!"):
            again.append(number)
    return again


def _troubling(name: str, first: int, n: int, folder: str) -> list[int]:
    """Numbers of the files that must be read once more, those that end the process included."""
    try:
        return UntrustedFile(name, _LIMITS).read(_batch, name, first, n, folder)
    except InputError:
        if n == 1:
            return [first]
        return [again for number in range(first, first + n) for again in _troubling(name, number, 1, folder)]


def fuzzed(name: str, first: int, n: int, findings: Findings, kept: Path | None = None) -> None:
    """Read `n` damaged files of a target, from number `first` on."""
    with tempfile.TemporaryDirectory() as folder:
        TARGETS[name].prepare(Path(folder))
        good_contents(name)
        for start in range(first, first + n, BATCH):
            n_here = min(BATCH, first + n - start)
            for number in _troubling(name, start, n_here, folder):
                _read_alone(name, number, findings, kept)
            findings.n_inputs += n_here
    import resource  # where there is one: Windows can collect what is in this module

    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    if peak > MOST_MEMORY_KIB:
        findings.wrong.append(f"{name} {first} … {first + n - 1}: {peak} KiB of memory")


def _read_alone(name: str, number: int, findings: Findings, kept: Path | None) -> None:
    command = [sys.executable, "-m", "tests.fuzz", "--one", name, str(number)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S)
        said = done.stdout.strip() or f"! exit {done.returncode} {done.stderr[-300:]}"
    except subprocess.TimeoutExpired:
        said = f"! no end in {_LONGEST_S} s"
    if said.startswith("!"):
        findings.wrong.append(f"{name} {number}: {said}")
    elif "crashed" in said or "more than the" in said or "no end" in said:
        findings.contained.append(f"{name} {number}: {said}")
    else:
        return
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
        (kept / f"{name.replace(' ', '_')}_{number}").write_bytes(content_of(name, number))
