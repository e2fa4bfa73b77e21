"""How long a command takes to begin: help of each, the words of a completion, and six seconds of a virtual sweep.

Times are by the clock, each the best of several after one that fills the caches of files, bytecode and compiled
loops; bytecode is kept, as it is where nothing forbids it, in a folder of the measurement.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import typer.main

HELP_LABEL = "help of a command, the slowest of all [s]"
COMPLETION_LABEL = "words of a completion [s]"
REFUSAL_LABEL = "a file that is not there, refused [s]"
VIRTUAL_LABEL = "six seconds of a virtual sweep, start to file [s]"
INTERPRETER_LABEL = "Python alone [s]"
IMPORT_LABEL = "import of sloshlab [s]"
N_REPEATS = 5
REPOSITORY = Path(__file__).resolve().parents[2]
RIG = REPOSITORY / "raw_data" / "shaker" / "rig_fill_0.50.toml"
PROGRAM = ("-m", "pipelines.command_line")


def start_figures(folder: Path) -> dict[str, float]:
    """Seconds by label."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    virtual = ["virtual", "shaker_sweep", "--rig", str(RIG), "--duration-s", "6", "--overwrite"]
    asked = {"_SLOSHLAB_COMPLETE": "complete_bash", "COMP_WORDS": "sloshlab\ndemo\n", "COMP_CWORD": "2"}
    helps = {" ".join(path): best_s([*PROGRAM, *path, "--help"], n=2) for path in commands()}
    slowest = max(helps, key=lambda path: helps[path])
    return {
        INTERPRETER_LABEL: best_s(["-c", "pass"]),
        IMPORT_LABEL: best_s(["-c", "import sloshlab"]),
        HELP_LABEL: best_s([*PROGRAM, *slowest.split(), "--help"]),
        COMPLETION_LABEL: best_s([*PROGRAM], more=asked),
        REFUSAL_LABEL: best_s([*PROGRAM, "check", str(folder / "absent.nc")], code=1),
        VIRTUAL_LABEL: best_s([*PROGRAM, *virtual, "-o", str(folder / "sweep.nc")]),
    }


def commands(group: Any = None, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every command, by its words; the program itself is the empty one."""
    from pipelines.command_line import application

    yield path
    for name, command in getattr(group or typer.main.get_command(application()), "commands", {}).items():
        yield from commands(command, (*path, name))


def best_s(
    words: Sequence[str], *, n: int = N_REPEATS, code: int = 0, more: Mapping[str, str] | None = None
) -> float:
    """The shortest of several runs by the clock [s], after one that is not counted."""
    path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path, **(more or {})}
    taken = []
    for _ in range(n + 1):
        began = time.perf_counter()
        done = subprocess.run([sys.executable, *words], env=environment, capture_output=True, check=False)
        taken.append(time.perf_counter() - began)
        if done.returncode != code:
            raise RuntimeError(f"{' '.join(words)}: {done.stderr.decode()}")
    return min(taken[1:])


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        for label, seconds in start_figures(Path(name)).items():
            print(f"{label:<62}{seconds:>10.3g}")
