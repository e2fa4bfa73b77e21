"""Every case of a trial diagnosed by a process of its own, which can know no truth."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from campaigns.executor import Executor
from campaigns.local_executor import LocalExecutor
from campaigns.task import Ending, Task
from campaigns.watched_command import run_watched
from campaigns.working import terminations_kept, work_through
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
    executor: Executor | None = None,
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
    executor : Executor, optional
        In place of processes of this machine.

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
        executor=executor,
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
    executor: Executor | None = None,
) -> list[Outcome]:
    """Diagnose case folders that have not been; what was done before stays.

    Parameters
    ----------
    cases : sequence of Path
        Folders of different names.
    answers : Path
        Takes a folder of the name of each case.
    n_workers, time_limit_s, command, perturbation, finished, executor
        As of `run_trial`.
    options_of : callable
        (folder of a case) → more words for the command.

    Raises
    ------
    InputError
        If an answer cannot be kept.
    """
    outputs = {case.name: answers / case.name for case in cases}
    outcomes = {name: outcome for name, output in outputs.items() if (outcome := _known(output)) is not None}
    waiting = [case for case in cases if case.name not in outcomes]

    def arguments_of(case: Path) -> dict[str, Any]:
        return {
            # as they were given: words of the command are seen in what it writes
            "case": str(case),
            "output": str(outputs[case.name]),
            "folder": str(Path.cwd()),
            "command": list(command),
            "options": list(options_of(case)),
            "time_limit_s": time_limit_s,
            "perturbation": perturbation,
        }

    def ended(number: int, ending: Ending) -> None:
        case = waiting[number].name
        if ending.status in ("failed", "full"):
            remedy = "mend it, then give the same command again"
            raise InputError(f"answer of {case}", got=ending.line, remedy=remedy)
        if ending.status == "done":
            outcomes[case] = Outcome(**ending.result)
        else:  # not kept: its process was ended by somebody, and the next run tries again
            outcomes[case] = Outcome(case, "crashed", -1, round(ending.seconds, 2), 0.0, 0.0, ending.line)
        finished(outcomes[case])

    tasks = (Task(case.name, "sealed_trial.running:answered_case", arguments_of(case)) for case in waiting)
    with terminations_kept():
        work_through(tasks, executor or LocalExecutor(n_workers, one_core=False), finished=ended)
    return [outcomes[case.name] for case in cases]


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


def answered_case(arguments: Mapping[str, Any], say_share: Callable[[float], None]) -> dict[str, Any]:
    """One case, or the same a little moved, in a process of its own; this is what a worker does.

    Parameters
    ----------
    arguments : mapping
        ``case`` and ``output``, seen from ``folder``; the ``command`` with its ``options``, ``time_limit_s`` and
        ``perturbation``.
    say_share : callable

    Returns
    -------
    dict
        The outcome.

    Raises
    ------
    InputError
        If a key is in reach.
    """
    os.chdir(arguments["folder"])
    output = Path(arguments["output"])
    # on another computer there may be another environment
    require_no_key(Path(arguments["case"]).parent.parent, [], os.environ)
    with _as_given_or_moved(Path(arguments["case"]), arguments["perturbation"]) as case:
        words = [*arguments["command"], str(case), "-o", str(output), *arguments["options"]]
        return asdict(answered(case, output, words, arguments["time_limit_s"]))


@contextlib.contextmanager
def _as_given_or_moved(case: Path, perturbation: int | None) -> Iterator[Path]:
    if perturbation is None:
        yield case
        return
    with tempfile.TemporaryDirectory(prefix="sloshlab-trial-") as temporary:
        moved = Path(temporary) / case.name
        write_perturbed_case(case, moved, perturbation)
        yield moved


def answered(case: Path, output: Path, words: Sequence[str], time_limit_s: float) -> Outcome:
    """One case diagnosed by a command in a process of its own, watched; its outcome is kept beside the answer.

    Parameters
    ----------
    case, output : Path
        Folder of the case, and of its answer.
    words : sequence of str
        The command.
    time_limit_s : float
    """
    output.mkdir(parents=True, exist_ok=True)
    ending = run_watched(words, output / "stderr.txt", time_limit_s)
    status = "timed_out" if ending.is_timed_out else "done"
    if status == "done" and (ending.exit_code not in (0, 3) or not (output / "verdict.json").is_file()):
        status = "crashed"
    outcome = Outcome(
        case.name,
        status,
        ending.exit_code,
        round(ending.wall_s, 2),
        round(ending.processor_s, 2),
        round(ending.memory_mib, 1),
        ending.last_words,
    )
    write_bytes(output / OUTCOME, json.dumps(asdict(outcome), indent=1, sort_keys=True).encode() + b"\n")
    return outcome
