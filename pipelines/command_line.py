"""The command line: what to read, what to write, and how it ends.

Exit codes: 0 done; 1 the input is bad, one line on stderr; 2 usage; 3 done, but data were lost or a
result is flagged; 130 interrupted, 129 and 143 terminated, nothing half-written. Commands import what they
need when they run, so that ``sloshlab --help`` stays quick.
"""

from __future__ import annotations

import io
import signal
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import typer

from pipelines.commands import demo  # they register themselves, in the order of the help

# isort: split
from pipelines.commands import recordings

# isort: split
from pipelines.commands import analysis

# isort: split
from pipelines.commands import models

# isort: split
from pipelines.commands import flutter

# isort: split
from pipelines.commands import aircraft

# isort: split
from pipelines.commands import wing

# isort: split
from pipelines.commands import case

# isort: split
from pipelines.commands import diagnosis

# isort: split
from pipelines.commands import field_benchmarks

# isort: split
from pipelines.commands import trial

# isort: split
from pipelines.commands import campaign

# isort: split
from pipelines.commands import laboratory

# isort: split
from pipelines.commands import info

# isort: split
from pipelines.commands.application import DONE_BUT_FLAGGED, INPUT_IS_BAD, INTERRUPTED, USAGE, app
from pipelines.commands.completion import PROGRAM, answer_a_shell
from pipelines.report.terminal import complain, say
from sloshlab import interrupt
from sloshlab.errors import RecordingInterruptedError, SloshlabError

__all__ = [
    "DONE_BUT_FLAGGED",
    "INPUT_IS_BAD",
    "INTERRUPTED",
    "USAGE",
    "aircraft",
    "analysis",
    "app",
    "campaign",
    "case",
    "demo",
    "diagnosis",
    "field_benchmarks",
    "flutter",
    "info",
    "laboratory",
    "main",
    "models",
    "recordings",
    "run",
    "trial",
    "wing",
]

# typer brings its own click or uses the installed one; either way this is the root of its usage errors
_UsageError: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        answer_a_shell()
        with interrupt.never_lost():
            words = list(arguments) if arguments is not None else None
            code = int(app(args=words, prog_name=PROGRAM, standalone_mode=False) or 0)
        if code == INTERRUPTED:  # some versions of typer turn Ctrl-C into this code without a word
            raise KeyboardInterrupt
        return code
    except RecordingInterruptedError as error:
        complain(f"sloshlab: {error}")
        return INTERRUPTED
    except SloshlabError as error:
        complain(f"sloshlab: {error}")
        return INPUT_IS_BAD
    except _UsageError as error:
        _show(error)
        return USAGE
    except (KeyboardInterrupt, typer.Abort):
        complain("sloshlab: interrupted; nothing half-written")
        return INTERRUPTED
    except interrupt.Terminated as termination:
        print(f"sloshlab: ended by {termination}; nothing half-written", file=sys.stderr)  # noqa: T201
        return termination.exit_code
    except OSError as error:
        what = f"{error.filename}: " if error.filename else ""
        remedy = "check that the path can be written, and that a folder or file of this name is not in the way"
        complain(f"sloshlab: {what}got {error.strerror or error}; remedy: {remedy}")
        return INPUT_IS_BAD


def _show(error: Any) -> None:
    """A usage error, or the help of a command that was called without anything."""
    text = io.StringIO()
    error.show(text)
    for line in text.getvalue().expandtabs().splitlines():
        if line.startswith("Error:"):
            complain(line)
        else:
            say(line, error=True)


def main() -> NoReturn:
    """Entry point of the ``sloshlab`` command."""
    code = run()
    for number in (signal.SIGINT, *interrupt.TERMINATIONS):
        signal.signal(number, signal.SIG_IGN)  # what is done is done: nothing is left to interrupt
    sys.exit(code)


if __name__ == "__main__":
    main()
