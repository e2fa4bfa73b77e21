"""Every case of a trial diagnosed by a process of its own, which can know no truth."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from sealed_trial.perturbed_case import write_perturbed_case
from sealed_trial.sealing.key import PREFIX, is_key
from sealed_trial.sealing.selection import EVERYTHING, Selection
from sealed_trial.sealing.trial_folder import READABLE, check_data, read_commitments
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError

DIAGNOSES: Final = "diagnoses"
OUTCOME: Final = "outcome.json"
_LOOKED_THROUGH_BYTES: Final = 4096
_LARGEST_OUTCOME_BYTES: Final = 65536
_MEMORY_EVERY_S: Final = 0.3
"""What the system keeps as the peak of a process, ru_maxrss, begins with that of the process which started it."""
_SESSION: Final = 3
"""Field of `/proc/PID/stat` after the name of the process (proc(5))."""
DIAGNOSE: Final = (sys.executable, "-m", "pipelines.command_line", "diagnose")


@dataclass(frozen=True)
class Outcome:
    """How the diagnosis of a case ended.

    Attributes
    ----------
    case, status : str
        'done', 'crashed' or 'timed_out'.
    exit_code : int
    wall_s, processor_s, memory_mib : float
        Of the process and its children; what they share of their memory counts once.
    last_words : str
        End of its stderr.
    """

    case: str
    status: str
    exit_code: int
    wall_s: float
    processor_s: float
    memory_mib: float
    last_words: str


def require_no_key(trial: Path, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
    """Refuse to go on where the key can be reached.

    Looks at the arguments and files they name, at the environment and files it names, at the trial and beside it.

    Raises
    ------
    InputError
        If a key was found.
    """
    for word in (*arguments, *environment.values()):
        if is_key(word) or any(_holds_key(Path(part)) for part in word.split(os.pathsep)[:64]):
            raise InputError("trial run", got="a key in an argument or the environment", allowed="no key in reach")
    beside = trial.resolve().parent
    for folder in (trial, beside, Path.cwd()):
        for path in folder.glob("*"):
            if _holds_key(path):
                raise InputError(
                    "trial run", got=f"the key {path}", allowed="no key in reach", remedy="keep it elsewhere"
                )


def _holds_key(path: Path) -> bool:
    try:
        if not path.is_file() or path.stat().st_size > _LOOKED_THROUGH_BYTES:
            return False
        return path.read_bytes().startswith(PREFIX.encode())
    except (OSError, ValueError):
        return False


def run_trial(
    trial: Path,
    *,
    n_workers: int,
    time_limit_s: float,
    command: Sequence[str] = DIAGNOSE,
    chosen: Selection = EVERYTHING,
    diagnoses: str = DIAGNOSES,
    perturbation: int | None = None,
    finished: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Diagnose all chosen cases that have not been; what was done before stays.

    Parameters
    ----------
    trial : Path
    n_workers : int
        Processes at once.
    time_limit_s : float
        Of wall time per case.
    command : sequence of str
        Is given the case and `-o FOLDER`.
    chosen : Selection
    diagnoses : str
        Folder of the trial that takes the answers.
    perturbation : int, optional
        Seed by which the recordings are moved a little; as they are, by default.
    finished : callable
        Told every outcome.

    Raises
    ------
    InputError
        If data are not what was published, or a case is chosen that there is not.
    """
    commitments = read_commitments(trial)
    if commitments.purpose == "sealed" and (trial / READABLE).exists():
        raise InputError(f"{trial / READABLE}", got="readable truths", allowed="a sealed trial without them")
    published = {case.case: case for case in commitments.cases}
    names = chosen.of(list(published))
    for name in names:
        check_data(trial, published[name])
    return run_folders(
        [trial / "cases" / name for name in names],
        trial / diagnoses,
        n_workers=n_workers,
        time_limit_s=time_limit_s,
        command=command,
        perturbation=perturbation,
        finished=finished,
    )


def run_folders(
    cases: Sequence[Path],
    answers: Path,
    *,
    n_workers: int,
    time_limit_s: float,
    command: Sequence[str] = DIAGNOSE,
    options_of: Callable[[Path], Sequence[str]] = lambda case: (),
    perturbation: int | None = None,
    finished: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Diagnose case folders that have not been; what was done before stays.

    Parameters
    ----------
    cases : sequence of Path
        Folders of different names.
    answers : Path
        Takes a folder of the name of each case.
    n_workers, time_limit_s, command, perturbation, finished
        As of `run_trial`.
    options_of : callable
        (folder of a case) → more words for the command.
    """
    outputs = {case.name: answers / case.name for case in cases}
    outcomes = {name: outcome for name, output in outputs.items() if (outcome := _known(output)) is not None}
    waiting = [case for case in cases if case.name not in outcomes]
    stopping = threading.Event()
    watched = _Watched(command, options_of, time_limit_s, stopping)
    with ThreadPoolExecutor(n_workers) as pool:
        tasks = [pool.submit(_answered, case, outputs[case.name], perturbation, watched) for case in waiting]
        try:
            for task in as_completed(tasks):
                outcome = task.result()
                outcomes[outcome.case] = outcome
                finished(outcome)
        except BaseException:
            stopping.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [outcomes[case.name] for case in cases]


@dataclass(frozen=True)
class _Watched:
    """How every case is diagnosed: by which command, how long at most, and until when at all."""

    command: Sequence[str]
    options_of: Callable[[Path], Sequence[str]]
    time_limit_s: float
    stopping: threading.Event


def _known(output: Path) -> Outcome | None:
    path = output / OUTCOME
    return read_outcome(path) if path.exists() else None


def read_outcome(path: Path) -> Outcome:
    """How the diagnosis of a case ended, from its file.

    Raises
    ------
    InputError
        If it is something else: it may have come with a folder from anywhere.
    """
    try:
        if path.stat().st_size > _LARGEST_OUTCOME_BYTES:
            raise ValueError("too large")
        stored: dict[str, Any] = json.loads(path.read_bytes())
        return Outcome(**stored)
    except (ValueError, TypeError, RecursionError) as error:
        allowed = "the file that `sloshlab trial run` wrote"
        raise InputError(f"{path}", got="something else", allowed=allowed, remedy="remove it") from error


def _answered(case: Path, output: Path, perturbation: int | None, watched: _Watched) -> Outcome:
    """One case, or the same a little moved, in a process of its own."""
    if watched.stopping.is_set():
        raise KeyboardInterrupt
    with _as_given_or_moved(case, perturbation) as folder:
        return _diagnosed(folder, output, watched)


@contextlib.contextmanager
def _as_given_or_moved(case: Path, perturbation: int | None) -> Iterator[Path]:
    if perturbation is None:
        yield case
        return
    with tempfile.TemporaryDirectory(prefix="sloshlab-trial-") as temporary:
        moved = Path(temporary) / case.name
        write_perturbed_case(case, moved, perturbation)
        yield moved


def _diagnosed(case: Path, output: Path, watched: _Watched) -> Outcome:
    """One case in a process of its own, watched."""
    output.mkdir(parents=True, exist_ok=True)
    words = [*watched.command, str(case), "-o", str(output), *watched.options_of(case)]
    with (output / "stderr.txt").open("w+b") as errors:
        started = time.monotonic()
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True
        )
        status, code, usage = _waited(process.pid, started + watched.time_limit_s, watched.stopping)
        wall = time.monotonic() - started
        errors.seek(max(0, errors.tell() - 2000))
        last = (errors.read().decode(errors="replace").strip().splitlines() or [""])[-1][-500:]
    process.returncode = code  # was waited for by its number, for its use of processor and memory
    if status == "done" and (code not in (0, 3) or not (output / "verdict.json").is_file()):
        status = "crashed"
    outcome = Outcome(case.name, status, code, round(wall, 2), round(usage[0], 2), round(usage[1], 1), last)
    write_bytes(output / OUTCOME, json.dumps(asdict(outcome), indent=1, sort_keys=True).encode() + b"\n")
    return outcome


def _waited(pid: int, until: float, stopping: threading.Event) -> tuple[str, int, tuple[float, float]]:
    """Status, exit code, processor seconds and peak memory [MiB] of a child, killed when its time is over."""
    status, largest_mib, looked_at = "done", 0.0, 0.0
    while True:
        found, wait_status, usage = os.wait4(pid, os.WNOHANG)
        if found:
            spent = usage.ru_utime + usage.ru_stime, largest_mib or usage.ru_maxrss / 1024
            if stopping.is_set():
                raise KeyboardInterrupt
            return status, os.waitstatus_to_exitcode(wait_status), spent
        if stopping.is_set() or time.monotonic() > until:
            status = "timed_out"
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)
        if time.monotonic() - looked_at > _MEMORY_EVERY_S:
            largest_mib, looked_at = max(largest_mib, _memory_mib(pid)), time.monotonic()
        time.sleep(0.05)


def _memory_mib(session: int) -> float:
    """Memory of all processes of a session, what they share counted once; zero where the system does not tell."""
    total_kib = 0
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):  # it has ended meanwhile, or is not ours
            after_name = (process / "stat").read_text().rpartition(")")[2].split()
            if int(after_name[_SESSION]) == session:
                lines = (process / "smaps_rollup").read_text().splitlines()
                total_kib += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return total_kib / 1024
